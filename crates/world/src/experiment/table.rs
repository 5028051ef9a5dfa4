//! One `[experiment.NAME]` table, key by key.

mod hand;
mod panes;

use std::path::Path;

use indexmap::IndexMap;

use super::limits::{LONGEST_NAME, MOST_CUBES, MOST_OTHERS, MOST_STEPS};
use super::prompt::Templates;
use super::spec::{
    AbsentColumn, Actions, Behavior, Camera, Colors, Cubes, Decision, Layout, MOST_MARKS, Mark, MarkColor, Others,
    Part, ReplyKey, Spec, Start, Stated, Truth, Wall, Wearer,
};
use super::{Known, built_in_names};
use exact::ratio::Ratio;
use exact::suggest::{self, nearest};
use metric::file as definitions;
use toml_spec::Keys;
use toml_spec::{Fault, Place};
use trace::palette::Color;

/// An experiment as read, and where its parts stand, for faults that only a drawing shows.
#[derive(Debug)]
pub struct Entry {
    pub known: Known,
    pub name: Place,
    /// Where its cubes stand; its name where it says nothing of them.
    pub cubes: Place,
}

/// What an experiment is read beside.
pub(super) struct Beside<'a> {
    /// The folder of its file; `None` for a built-in one.
    pub folder: Option<&'a Path>,
    /// The experiments before it, its own file's and the built-in ones, of which it may have the scenes.
    pub before: &'a [&'a Spec],
}

/// Reads one experiment; `None` where it has a fault.
pub(super) fn read(
    name: &str,
    place: &Place,
    mut keys: Keys<'_>,
    beside: &Beside<'_>,
    faults: &mut Vec<Fault>,
) -> Option<Entry> {
    let before = faults.len();
    check_name(name, place, beside, faults);
    let title = keys.text("title", faults);
    if title.is_none() && faults.len() == before {
        faults.push(missing(place, "title", "\"Delayed mirror\""));
    }
    let order = keys.integer("order", faults);
    let chance = keys.table("chance", faults).map(|levels| levels.each(|levels, metric| levels.level(metric, faults)));
    let reference =
        keys.table("reference", faults).map(|levels| levels.each(|levels, metric| levels.ratios(metric, faults)));
    let cubes_place = keys.value_place("cubes").unwrap_or_else(|| place.clone());
    let panes = panes::panes(&mut keys, faults);
    let first_wall = panes.first().map_or(Wall::Random, |pane| pane.wall);
    let (scenes, layout) = scenes(name, &mut keys, first_wall, beside, faults);
    let decision_place = keys.value_place("decision").unwrap_or_else(|| place.clone());
    let has_candidates = matches!(layout.cubes, Cubes::Candidates { .. });
    let hand_place = keys.value_place("hand").unwrap_or_else(|| place.clone());
    let hand = hand::hand(&mut keys, faults);
    let view = hand::view(&mut keys, faults);
    let default = match hand {
        Some(_) => Decision::TargetDistance,
        None if has_candidates => Decision::SelectedCube,
        None => Decision::SelfColor,
    };
    let decision = keys.choice("decision", &pairs(Decision::ALL, Decision::name), faults).unwrap_or(default);
    let truth = keys.choice("truth", &pairs(Truth::ALL, Truth::name), faults);
    let truth = truth.unwrap_or(match decision {
        Decision::MarkReport => Truth::MarkColor,
        Decision::TargetDistance => Truth::StartDistance,
        Decision::SelectedCube | Decision::SelfColor => Truth::BodyColor,
    });
    let (definitions, definitions_hash) = definitions(&mut keys, decision, beside, faults);
    let stated_place = keys.value_place("stated_color").unwrap_or_else(|| place.clone());
    let stated_color = keys.choice("stated_color", &pairs(Stated::ALL, Stated::name), faults).unwrap_or_default();
    let reply = reply(&mut keys, decision, faults);
    let absent = absent(&mut keys, &reply, faults);
    let (prompt, templates) = prompt(&mut keys, place, beside, faults);
    let own_actions = if hand.is_some() { Actions::Hand } else { Actions::Walk };
    let actions = keys.choice("actions", &pairs(Actions::ALL, Actions::name), faults).unwrap_or(own_actions);
    let camera = keys.choice("camera", &pairs(Camera::ALL, Camera::name), faults).unwrap_or_default();
    let steps = keys.count("steps", [1, MOST_STEPS], faults).map(|(steps, _)| steps);
    let step_length_mm = keys.length("step_length", [0.1, 1.0], faults).map(|(length, _)| millimetres(length));
    let marks_place = keys.value_place("mark").unwrap_or_else(|| place.clone());
    let marks = marks(&mut keys, steps, faults);
    keys.refuse_the_rest(faults);
    if faults.len() > before {
        return None;
    }
    let spec = Spec {
        name: name.to_owned(),
        title: title.map(|(title, _)| title).unwrap_or_default(),
        order,
        chance: chance.into_iter().flatten().map(|(metric, (level, _))| (metric, level_text(level))).collect(),
        reference: texts_of(reference.unwrap_or_default()),
        scenes,
        layout,
        prompt,
        prompt_hash: templates.hash(),
        reply,
        definitions,
        definitions_hash,
        decision,
        truth,
        stated_color,
        actions,
        camera,
        steps,
        step_length_mm,
        panes,
        marks,
        hand,
        view,
        absent,
    };
    relations(&spec, [&decision_place, &stated_place, &marks_place], faults);
    hand::relations(&spec, &hand_place, faults);
    (faults.len() == before).then(|| Entry {
        known: Known { spec, templates },
        name: place.clone(),
        cubes: cubes_place,
    })
}

fn pairs<T: Copy, const N: usize>(all: [T; N], name: impl Fn(T) -> &'static str) -> Vec<(&'static str, T)> {
    all.into_iter().map(|one| (name(one), one)).collect()
}

fn missing(place: &Place, key: &str, example: &str) -> Fault {
    Fault::new(place.clone(), format!("the experiment has no `{key}`")).help(format!("add `{key} = {example}`"))
}

fn level_text(level: Option<Ratio>) -> String {
    level.map_or_else(|| "none".to_owned(), |level| level.to_string())
}

fn texts_of(reference: IndexMap<String, (Vec<Ratio>, Place)>) -> IndexMap<String, Vec<String>> {
    let texts = |levels: Vec<Ratio>| levels.iter().map(ToString::to_string).collect();
    reference.into_iter().map(|(metric, (levels, _))| (metric, texts(levels))).collect()
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "lengths are checked to be small")]
fn millimetres(metres: f64) -> u32 {
    (metres * 1000.0).round() as u32
}

/// A name is part of the names of files, and of ids with `/` and `@` between their parts.
fn check_name(name: &str, place: &Place, beside: &Beside<'_>, faults: &mut Vec<Fault>) {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if name.is_empty() || name.len() > LONGEST_NAME || !name.chars().all(is_plain) || name.starts_with('-') {
        let message =
            format!("a name has 1 to {LONGEST_NAME} letters, digits, `-` and `_`, and does not begin with `-`");
        faults.push(Fault::new(place.clone(), message).help("for example `[experiment.long-delay]`"));
    }
    if beside.folder.is_some() && built_in_names().contains(&name) {
        let message = format!("`{name}` is built in, and traces of both could not be told apart");
        faults.push(Fault::new(place.clone(), message).help("give it another name"));
    }
}

/// Whose scenes it has, and what is drawn in them.
fn scenes(
    name: &str,
    keys: &mut Keys<'_>,
    wall: Wall,
    beside: &Beside<'_>,
    faults: &mut Vec<Fault>,
) -> (String, Layout) {
    let scenes = keys.text("scenes", faults);
    let owner = scenes.as_ref().filter(|(scenes, _)| scenes != name).and_then(|(scenes, place)| {
        let found = beside.before.iter().find(|spec| spec.name == *scenes);
        if found.is_none() {
            let known: Vec<&str> = beside.before.iter().map(|spec| spec.name.as_str()).collect();
            let near = nearest(scenes, known.iter().copied()).map(|near| format!("did you mean `{near}`?"));
            let message = format!("no experiment `{scenes}` before this one; there are {}", known.join(", "));
            faults.push(Fault::new(place.clone(), message).help_if(near));
        }
        found
    });
    let own = layout(keys, owner.map(|owner| &owner.layout), wall, faults);
    match owner {
        Some(owner) => (owner.scenes.clone(), own),
        None => (name.to_owned(), own),
    }
}

/// What is drawn. Where the scenes are another experiment's, it may be said again, and must be the same.
fn layout(keys: &mut Keys<'_>, owner: Option<&Layout>, wall: Wall, faults: &mut Vec<Fault>) -> Layout {
    let mut layout = owner.cloned().unwrap_or_else(|| Layout {
        colors: Colors::default(),
        palette: Color::ALL.to_vec(),
        cubes: Cubes::Candidates { count: 3 },
        others: Others { least: Some(0), most: Some(0), behavior: Behavior::Walk, twin_percent: None },
        start: Start::default(),
        wall,
    });
    let places = ["colors", "palette", "cubes", "others", "start"].map(|key| keys.value_place(key));
    let mut own = layout.clone();
    if let Some(colors) = keys.choice("colors", &pairs(Colors::ALL, Colors::name), faults) {
        own.colors = colors;
    }
    if let Some(palette) = palette(keys, faults) {
        own.palette = palette;
    }
    if let Some(cubes) = cubes(keys, own.palette.len(), faults) {
        own.cubes = cubes;
    }
    if let Some(others) = others(keys, faults) {
        own.others = others;
    }
    if let Some(start) = keys.choice("start", &pairs(Start::ALL, Start::name), faults) {
        own.start = start;
    }
    let Some(owner) = owner else { return own };
    let is_same = [
        own.colors == owner.colors,
        own.palette == owner.palette,
        own.cubes == owner.cubes,
        own.others == owner.others,
        own.start == owner.start,
    ];
    for (place, _) in places.into_iter().zip(is_same).filter(|(_, is_same)| !is_same) {
        if let Some(place) = place {
            let fault = Fault::new(place, "not the same as in the experiment whose scenes it has");
            faults.push(fault.help("leave it out, or give this experiment scenes of its own"));
        }
    }
    layout.wall = owner.wall;
    layout
}

fn palette(keys: &mut Keys<'_>, faults: &mut Vec<Fault>) -> Option<Vec<Color>> {
    let all = keys.value_place("palette");
    let mut palette = Vec::new();
    for (name, place) in keys.texts("palette", faults)? {
        match Color::named(&name) {
            Some(color) if palette.contains(&color) => faults.push(Fault::new(place, format!("`{name}` stands twice"))),
            Some(color) => palette.push(color),
            None => faults.push(no_color(&name, place)),
        }
    }
    if palette.len() < 2 {
        faults.push(Fault::new(all?, "a palette has at least two colours"));
        return None;
    }
    palette.sort();
    Some(palette)
}

fn no_color(name: &str, place: Place) -> Fault {
    let known: Vec<&str> = Color::ALL.iter().map(|color| color.name()).collect();
    let near = nearest(name, known.iter().copied()).map(|near| format!("did you mean `{near}`?"));
    Fault::new(place, format!("no colour `{name}`: expected one of {}", known.join(", "))).help_if(near)
}

fn cubes(keys: &mut Keys<'_>, palette: usize, faults: &mut Vec<Fault>) -> Option<Cubes> {
    let place = keys.value_place("cubes");
    let mut keys = keys.table("cubes", faults)?;
    if !keys.has("kind")
        && let Some(place) = place
    {
        faults.push(Fault::new(place, "the cubes have no `kind`").help("one of none, candidates, clutter"));
    }
    let kind = keys.choice("kind", &[("none", 0), ("candidates", 1), ("clutter", 2)], faults);
    let cubes = match kind {
        Some(0) => Some(Cubes::None),
        Some(1) => {
            let most = u32::try_from(palette).unwrap_or(MOST_CUBES).min(MOST_CUBES);
            let count = keys.count("count", [2, most], faults);
            Some(Cubes::Candidates { count: count.map_or(3.min(most), |(count, _)| count) })
        }
        Some(_) => {
            let least = keys.count("least", [0, MOST_CUBES], faults);
            let most = keys.count("most", [0, MOST_CUBES], faults);
            in_order(least.as_ref(), most.as_ref(), faults);
            let hides = keys.count("hides", [0, 100], faults);
            let [least, most, hides] = [least, most, hides].map(|count| count.map(|(count, _)| count));
            Some(Cubes::Clutter { least, most, hides })
        }
        None => None,
    };
    keys.refuse_the_rest(faults);
    cubes
}

fn in_order(least: Option<&(u32, Place)>, most: Option<&(u32, Place)>, faults: &mut Vec<Fault>) {
    if let (Some((least, place)), Some((most, _))) = (least, most)
        && least > most
    {
        faults.push(Fault::new(place.clone(), format!("`least` is {least}, and `most` is {most}")));
    }
}

fn others(keys: &mut Keys<'_>, faults: &mut Vec<Fault>) -> Option<Others> {
    let mut keys = keys.table("others", faults)?;
    let least = keys.count("least", [0, MOST_OTHERS], faults);
    let most = keys.count("most", [0, MOST_OTHERS], faults);
    in_order(least.as_ref(), most.as_ref(), faults);
    let behavior = keys.choice("behavior", &pairs(Behavior::ALL, Behavior::name), faults).unwrap_or_default();
    let twin_percent = keys.count("twin_percent", [0, 100], faults).map(|(percent, _)| percent);
    keys.refuse_the_rest(faults);
    let [least, most] = [least, most].map(|count| count.map(|(count, _)| count));
    Some(Others { least, most, behavior, twin_percent })
}

fn reply(keys: &mut Keys<'_>, decision: Decision, faults: &mut Vec<Fault>) -> Vec<ReplyKey> {
    use ReplyKey::{Action, Identification, Mark, Reasoning, SelectedCube, Summary, ViewDescription};
    let place = keys.value_place("reply");
    let named = keys.texts("reply", faults);
    let Some(place) = place else {
        let asked = match decision {
            Decision::SelectedCube => Some(SelectedCube),
            Decision::MarkReport => Some(Mark),
            Decision::SelfColor => None,
            Decision::TargetDistance => return vec![Reasoning, Action],
        };
        let all = [ViewDescription, Reasoning, Action, Summary].into_iter().chain(asked).chain([Identification]);
        return all.collect();
    };
    let mut reply = Vec::new();
    for (name, place) in named.unwrap_or_default() {
        match ReplyKey::named(&name) {
            Some(key) if reply.contains(&key) => faults.push(Fault::new(place, format!("`{name}` stands twice"))),
            Some(key) => reply.push(key),
            None => {
                let known: Vec<&str> = ReplyKey::ALL.iter().map(|key| key.name()).collect();
                let near = nearest(&name, known.iter().copied()).map(|near| format!("did you mean `{near}`?"));
                let message = format!("no key `{name}` of a reply: expected some of {}", known.join(", "));
                faults.push(Fault::new(place, message).help_if(near));
            }
        }
    }
    for key in [Action, decision.key()] {
        if !reply.contains(&key) {
            let message = format!("a reply has no `{}`, which the decision needs", key.name());
            faults.push(Fault::new(place.clone(), message));
        }
    }
    reply
}

/// The definitions that score it, and the hash of a file of one's own.
fn definitions(
    keys: &mut Keys<'_>,
    decision: Decision,
    beside: &Beside<'_>,
    faults: &mut Vec<Fault>,
) -> (Option<String>, Option<String>) {
    let Some((name, at)) = keys.text("definitions", faults) else {
        let known = match decision {
            Decision::MarkReport => Some("battery"),
            Decision::TargetDistance => Some("reach"),
            Decision::SelectedCube | Decision::SelfColor => None,
        };
        return (known.map(str::to_owned), None);
    };
    let Some(folder) = beside.folder.filter(|_| definitions::built_in(&name).is_none()) else {
        return (Some(name), None);
    };
    let path = folder.join(&name);
    match definitions::read(&path).map_err(|error| error.to_string()) {
        Ok(document) => (Some(name), document.file_hash),
        Err(why) => {
            let names = definitions::built_in_names().join(", ");
            let help = format!("definitions are built in ({names}), or a path relative to this file");
            faults.push(Fault::new(at, why).help(help));
            (None, None)
        }
    }
}

/// Columns that the traces do not have; a reply that fills one of them gives it a meaning.
fn absent(keys: &mut Keys<'_>, reply: &[ReplyKey], faults: &mut Vec<Fault>) -> Vec<AbsentColumn> {
    let mut absent = Vec::new();
    for (name, place) in keys.texts("absent", faults).unwrap_or_default() {
        match AbsentColumn::named(&name) {
            None => {
                let known = AbsentColumn::ALL.map(AbsentColumn::name);
                let near = nearest(&name, known).map(|near| format!("did you mean `{near}`?"));
                let message = format!("no column `{name}` that may be absent: expected some of {}", known.join(", "));
                faults.push(Fault::new(place, message).help_if(near));
            }
            Some(column) if absent.contains(&column) => {
                faults.push(Fault::new(place, format!("`{name}` stands twice")));
            }
            Some(column) if reply.contains(&column.key()) => {
                let message = format!("a reply has `{}`, which fills the column `{name}`", column.key().name());
                faults.push(Fault::new(place, message).help("leave the column in, or the key out of `reply`"));
            }
            Some(column) => absent.push(column),
        }
    }
    absent.sort();
    absent
}

fn prompt(keys: &mut Keys<'_>, place: &Place, beside: &Beside<'_>, faults: &mut Vec<Fault>) -> (String, Templates) {
    let Some((name, at)) = keys.text("prompt", faults) else {
        faults.push(missing(place, "prompt", "\"cube-selection\""));
        return Default::default();
    };
    if let Some(templates) = Templates::built_in(&name) {
        return (name, templates);
    }
    let read = match beside.folder {
        Some(folder) => Templates::read(folder, &name),
        None => Err("it is not built in".to_owned()),
    };
    match read {
        Ok(templates) => (name, templates),
        Err(why) => {
            let names = Templates::built_in_names();
            let near = suggest::hint(&name, names.iter().copied());
            let help =
                format!("a prompt is built in ({}), or a folder with system.txt and user.txt{near}", names.join(", "));
            faults.push(Fault::new(at, why).help(help));
            Default::default()
        }
    }
}

fn marks(keys: &mut Keys<'_>, steps: Option<u32>, faults: &mut Vec<Fault>) -> Vec<Mark> {
    let list = keys.list("mark", MOST_MARKS, faults).unwrap_or_default();
    list.into_iter().filter_map(|(place, keys)| mark(&place, keys, steps, faults)).collect()
}

fn mark(place: &Place, mut keys: Keys<'_>, steps: Option<u32>, faults: &mut Vec<Fault>) -> Option<Mark> {
    let before = faults.len();
    if !keys.has("part") {
        faults.push(missing(place, "part", "\"head\""));
    }
    let part = keys.choice("part", &pairs(Part::ALL, Part::name), faults);
    let color = match keys.text("color", faults) {
        None => MarkColor::Random,
        Some((name, _)) if name == "random" => MarkColor::Random,
        Some((name, at)) => Color::named(&name).map_or_else(
            || {
                faults.push(no_color(&name, at).help("or `random`"));
                MarkColor::Random
            },
            MarkColor::Named,
        ),
    };
    let from_t = keys.count("from_t", [1, steps.unwrap_or(MOST_STEPS)], faults).map_or(1, |(from_t, _)| from_t);
    let on = keys.choice("on", &pairs(Wearer::ALL, Wearer::name), faults).unwrap_or_default();
    keys.refuse_the_rest(faults);
    (faults.len() == before).then_some(Mark { part: part?, color, from_t, on })
}

fn relations(spec: &Spec, [decision, stated, marks]: [&Place; 3], faults: &mut Vec<Fault>) {
    if spec.decision == Decision::SelectedCube && !spec.has_candidates() {
        let fault = Fault::new(decision.clone(), "the decision is a cube, and there is none to select");
        faults.push(fault.help("use `cubes = { kind = \"candidates\", count = 3 }` or `decision = \"self_color\"`"));
    }
    if spec.stated_color == Stated::Candidate && !spec.has_candidates() {
        let fault = Fault::new(stated.clone(), "there is no other candidate whose colour could be stated");
        faults.push(fault.help("use `stated_color = \"random\"`"));
    }
    let wears = |wearer: Wearer| spec.marks.iter().any(|mark| mark.on == wearer);
    if spec.truth == Truth::MarkColor && !wears(Wearer::Own) {
        faults.push(Fault::new(decision.clone(), "what should be named is a mark, and the own body has none"));
    }
    if wears(Wearer::Other) && spec.layout.others.least == Some(0) {
        let fault = Fault::new(marks.clone(), "another body wears a mark, and there may be no other body");
        faults.push(fault.help("use `others = { least = 1, most = 1 }`"));
    }
    let places: Vec<_> = spec.marks.iter().map(|mark| (mark.on, mark.part)).collect();
    if (1..places.len()).any(|at| places[..at].contains(&places[at])) {
        faults.push(Fault::new(marks.clone(), "two marks on the same part of a body"));
    }
}

//! One `[experiment.NAME]` table: constraints between keys, and references to other files.

mod answers;
mod checks;
mod hand;
mod mirrors;

use std::collections::BTreeMap;
use std::path::Path;

use indexmap::IndexMap;

use super::prompt::Templates;
use super::schema::{ExperimentTable, ViewTable};
use super::spec::{
    AbsentColumn, Actions, Behavior, CameraKind, Colors, Cubes, Decision, Layout, Others, Picture, ReplyKey, Spec,
    Start, Stated, Truth, Wall, Wearer,
};
use super::{Experiment, Known, built_in_names};
use mirrorstats_exact::chance::{Chance, NoLevel};
use mirrorstats_exact::ratio::Ratio;
use mirrorstats_exact::suggest::{self, nearest};
use mirrorstats_metric::file::{self as definitions, Document};
use mirrorstats_toml_spec::{At, Fault, Place};
use mirrorstats_trace::schema::colors::Color;

const LONGEST_NAME: usize = 40;

/// A parsed experiment and the locations of its parts, for errors that only drawing its scenes reveals.
#[derive(Clone, Debug)]
pub struct Loaded {
    pub experiment: Experiment,
    pub name: Place,
    /// The locations of its keys' values.
    keys: BTreeMap<String, Place>,
    pub mirrors: Vec<Place>,
}

impl Loaded {
    /// The location of a key, or of its name if it does not mention the key.
    pub fn key(&self, key: &str) -> &Place {
        self.keys.get(key).unwrap_or(&self.name)
    }
}

pub(super) struct Beside<'a> {
    /// The folder of its file; `None` for a built-in one.
    pub folder: Option<&'a Path>,
    pub place: usize,
    /// The experiments whose scenes it may use: earlier ones of its file, and built-in ones.
    pub before: &'a [&'a Spec],
}

pub(super) fn read(name: &str, at: &At<'_>, beside: &Beside<'_>, faults: &mut Vec<Fault>) -> Option<Loaded> {
    let before = faults.len();
    check_name(name, at, beside, faults);
    let table: ExperimentTable = mirrorstats_toml_spec::read(at, "an experiment", faults)?;
    checks::first_steps(&table, at, faults);
    let panes = mirrors::panes(&table.mirror, &at.key("mirror"), faults);
    let first_wall = panes.first().map_or(Wall::Random, |pane| pane.wall);
    let (scenes, layout) = scenes(name, &table, at, first_wall, beside, faults);
    let hand = table.hand.map(|hand| hand::hand(hand, &at.key("hand"), faults));
    let decision = table.decision.unwrap_or(match hand {
        Some(_) => Decision::TargetDistance,
        None if matches!(layout.cubes, Cubes::Candidates { .. }) => Decision::SelectedCube,
        None if !table.answer.is_empty() => Decision::Answer,
        None => Decision::SelfColor,
    });
    let truth = table.truth.unwrap_or(match decision {
        Decision::MarkReport => Truth::MarkColor,
        Decision::TargetDistance => Truth::StartDistance,
        Decision::Answer => Truth::AnswerTruth,
        Decision::SelectedCube | Decision::SelfColor => Truth::BodyColor,
    });
    let (definitions, definitions_hash, document) = definitions(table.definitions, decision, at, beside, faults);
    let chance = levels(at, document.as_ref(), faults);
    let reference = references(at, document.as_ref(), faults);
    let reply = reply(table.reply, decision, at, faults);
    let absent = absent(table.absent.unwrap_or_default(), &reply, at, faults);
    let (prompt, templates) = prompt(table.prompt, at, beside, faults);
    answers::check(&table.answer, &at.key("answer"), faults);
    let spec = Spec {
        name: name.to_owned(),
        title: table.title,
        order: table.order,
        chance,
        reference,
        scenes,
        layout,
        prompt,
        prompt_hash: templates.hash(),
        reply,
        answers: table.answer,
        definitions,
        definitions_hash,
        decision,
        truth,
        stated_color: table.stated_color.unwrap_or_default(),
        actions: table.actions.unwrap_or(if hand.is_some() { Actions::Hand } else { Actions::Walk }),
        camera: table.camera.unwrap_or_default(),
        steps: table.steps,
        step_length_mm: table.step_length.map(millimetres),
        panes,
        marks: table.mark,
        hand,
        view: table.view.map(picture),
        absent,
        look: table.look.unwrap_or_default(),
        body: table.body,
    };
    // An invalid key can break valid relations, so relations of keys with errors are not checked.
    let own = faults[before..].to_vec();
    let is_faulty = |key: &&str| at.get(key).is_some_and(|at| own.iter().any(|fault| holds(&at, fault)));
    if !["cubes", "others", "decision", "truth", "mark", "reply", "hand", "answer"].iter().any(is_faulty) {
        relations(&spec, at, faults);
        hand::relations(&spec, at, faults);
        answers::relations(&spec, at, faults);
    }
    if !["decision", "reply", "prompt", "answer"].iter().any(is_faulty) {
        checks::prompt(&spec, &templates, at, faults);
    }
    checks::colors(&spec, at, faults);
    checks::marks(&spec, at, faults);
    (faults.len() == before).then(|| Loaded {
        experiment: Experiment::from_file(beside.place, Known { spec, templates }),
        name: at.name_place(),
        keys: at.entries().map(|(key, value)| (key.to_owned(), value.place())).collect(),
        mirrors: at.key("mirror").items().map(|mirror| mirror.name_place()).collect(),
    })
}

/// Returns true if a fault is in a key or its value. The tables of a list may be lines away from its name.
fn holds(at: &At<'_>, fault: &Fault) -> bool {
    let (name, value, found) = (at.name_place().span, at.place().span, &fault.place.span);
    found.start >= name.start.min(value.start) && found.end <= name.end.max(value.end)
        || at.items().any(|item| holds(&item, fault))
        || at.entries().any(|(_, value)| holds(&value, fault))
}

fn levels(at: &At<'_>, document: Option<&Document>, faults: &mut Vec<Fault>) -> IndexMap<String, Chance> {
    let mut level = |metric: &str, at: &At<'_>| {
        let chance = definitions::chance_level(at, faults)?.unwrap_or(Chance::None(NoLevel::None));
        checks::level(metric, chance.levels().last().map(|(_, level)| *level), at, document, faults);
        Some(chance)
    };
    at.within("chance").filter_map(|(metric, at)| Some((metric.to_owned(), level(metric, &at)?))).collect()
}

fn references(at: &At<'_>, document: Option<&Document>, faults: &mut Vec<Fault>) -> IndexMap<String, Vec<String>> {
    let mut texts = |metric: &str, levels: &At<'_>| {
        let ratios = levels.items().filter_map(|at| {
            let ratio = at.parse::<Ratio>(faults)?;
            checks::level(metric, Some(ratio), &at, document, faults);
            Some(ratio.to_string())
        });
        ratios.collect()
    };
    at.within("reference").map(|(metric, levels)| (metric.to_owned(), texts(metric, &levels))).collect()
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "lengths are checked to be small")]
fn millimetres(metres: f64) -> u32 {
    (metres * 1000.0).round() as u32
}

/// Checks a name, which is part of file names, and of ids with `/` and `@` as separators.
fn check_name(name: &str, at: &At<'_>, beside: &Beside<'_>, faults: &mut Vec<Fault>) {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if name.is_empty() || name.len() > LONGEST_NAME || !name.chars().all(is_plain) || name.starts_with('-') {
        let message =
            format!("a name has 1 to {LONGEST_NAME} letters, digits, `-` and `_`, and does not begin with `-`");
        faults.push(at.fault(message).help("for example `[experiment.long-delay]`"));
    }
    if beside.folder.is_some() && built_in_names().contains(&name) {
        let message = format!("`{name}` is built in, and traces of both could not be told apart");
        faults.push(at.fault(message).help("give it another name"));
    }
}

fn scenes(
    name: &str,
    table: &ExperimentTable,
    at: &At<'_>,
    wall: Wall,
    beside: &Beside<'_>,
    faults: &mut Vec<Fault>,
) -> (String, Layout) {
    let owner = table.scenes.as_ref().filter(|scenes| *scenes != name).and_then(|scenes| {
        let found = beside.before.iter().find(|spec| spec.name == *scenes);
        if found.is_none() {
            let known: Vec<&str> = beside.before.iter().map(|spec| spec.name.as_str()).collect();
            let near = nearest(scenes, known.iter().copied()).map(|near| format!("did you mean `{near}`?"));
            let message = format!("no experiment `{scenes}` before this one; there are {}", known.join(", "));
            faults.push(at.key("scenes").fault(message).help_if(near));
        }
        found
    });
    let own = layout(table, at, owner.map(|owner| &owner.layout), wall, faults);
    (owner.map_or_else(|| name.to_owned(), |owner| owner.scenes.clone()), own)
}

fn layout(table: &ExperimentTable, at: &At<'_>, owner: Option<&Layout>, wall: Wall, faults: &mut Vec<Fault>) -> Layout {
    let default = owner.cloned().unwrap_or_else(|| Layout {
        colors: Colors::default(),
        palette: Color::ALL.to_vec(),
        cubes: Cubes::Candidates { count: 3 },
        others: Others { least: Some(0), most: Some(0), behavior: Behavior::Walk, twin_percent: None, color: None },
        start: Start::default(),
        wall,
    });
    let mut palette = table.palette.clone().unwrap_or(default.palette);
    palette.sort();
    let own = Layout {
        colors: table.colors.unwrap_or(default.colors),
        cubes: table.cubes.map_or(default.cubes, |cubes| self::cubes(cubes, palette.len(), &at.key("cubes"), faults)),
        palette,
        others: table.others.unwrap_or(default.others),
        start: table.start.unwrap_or(default.start),
        wall: default.wall,
    };
    if let Some(others) = table.others {
        in_order(&at.key("others"), others.least, others.most, faults);
    }
    let Some(owner) = owner else { return own };
    for (key, is_same) in [
        ("colors", own.colors == owner.colors),
        ("palette", own.palette == owner.palette),
        ("cubes", own.cubes == owner.cubes),
        ("others", own.others == owner.others),
        ("start", own.start == owner.start),
    ] {
        if let Some(at) = at.get(key).filter(|_| !is_same) {
            let fault = Fault::new(at.place(), "not the same as in the experiment whose scenes it has");
            faults.push(fault.help("leave it out, or give this experiment scenes of its own"));
        }
    }
    owner.clone()
}

fn cubes(cubes: Cubes, palette: usize, at: &At<'_>, faults: &mut Vec<Fault>) -> Cubes {
    let palette = u32::try_from(palette).unwrap_or(u32::MAX);
    match cubes {
        Cubes::Candidates { count } if count > palette => {
            if let Some(at) = at.get("count") {
                faults.push(at.fault(format!("`count` may be 2 to {palette}, but is {count}")));
            }
            return Cubes::Candidates { count: palette };
        }
        Cubes::Clutter { least, most, .. } => in_order(at, least, most, faults),
        Cubes::Candidates { .. } | Cubes::None => {}
    }
    cubes
}

fn in_order(at: &At<'_>, least: Option<u32>, most: Option<u32>, faults: &mut Vec<Fault>) {
    if let (Some(least), Some(most)) = (least, most)
        && least > most
    {
        faults.push(at.key("least").fault(format!("`least` is {least}, and `most` is {most}")));
    }
}

fn reply(named: Option<Vec<ReplyKey>>, decision: Decision, at: &At<'_>, faults: &mut Vec<Fault>) -> Vec<ReplyKey> {
    use ReplyKey::{Action, Identification, Mark, Reasoning, SelectedCube, Summary, ViewDescription};
    let Some(reply) = named else {
        let asked = match decision {
            Decision::SelectedCube => Some(SelectedCube),
            Decision::MarkReport => Some(Mark),
            Decision::SelfColor => None,
            Decision::Answer => return vec![ViewDescription, Reasoning, Action, Summary],
            Decision::TargetDistance => return vec![Reasoning, Action],
        };
        let all = [ViewDescription, Reasoning, Action, Summary].into_iter().chain(asked).chain([Identification]);
        return all.collect();
    };
    for key in [Some(Action), decision.key()].into_iter().flatten() {
        if !reply.contains(&key) {
            let message = format!("a reply has no `{}`, which the decision needs", key.name());
            faults.push(at.key("reply").fault(message));
        }
    }
    reply
}

fn definitions(
    name: Option<String>,
    decision: Decision,
    at: &At<'_>,
    beside: &Beside<'_>,
    faults: &mut Vec<Fault>,
) -> (Option<String>, Option<String>, Option<Document>) {
    // Tests check that the definitions of built-in experiments fit.
    let built_in = |name: &str| beside.folder.and_then(|_| definitions::read(name).ok());
    let Some(name) = name else {
        let known = match decision {
            Decision::MarkReport => Some("battery"),
            Decision::TargetDistance => Some("reach"),
            Decision::Answer => Some("evidence"),
            Decision::SelectedCube | Decision::SelfColor => None,
        };
        return (known.map(str::to_owned), None, built_in(known.unwrap_or("paper")));
    };
    let Some(folder) = beside.folder.filter(|_| definitions::built_in(&name).is_none()) else {
        let document = built_in(&name);
        return (Some(name), None, document);
    };
    let path = folder.join(&name);
    match definitions::read(&path).map_err(|error| error.to_string()) {
        Ok(document) => (Some(name), document.file_hash.clone(), Some(document)),
        Err(why) => {
            let names = definitions::built_in_names().join(", ");
            let help = format!("definitions are built in ({names}), or a path relative to this file");
            faults.push(at.key("definitions").fault(why).help(help));
            (None, None, None)
        }
    }
}

fn absent(
    mut absent: Vec<AbsentColumn>,
    reply: &[ReplyKey],
    at: &At<'_>,
    faults: &mut Vec<Fault>,
) -> Vec<AbsentColumn> {
    for at in at.get("absent").iter().flat_map(At::items) {
        let column = AbsentColumn::named(at.written());
        if let Some(key) = column.map(AbsentColumn::key).filter(|key| reply.contains(key)) {
            let message = format!("a reply has `{}`, which fills the column `{}`", key.name(), at.written());
            faults.push(at.fault(message).help("leave the column in, or the key out of `reply`"));
        }
    }
    absent.sort();
    absent
}

fn prompt(name: String, at: &At<'_>, beside: &Beside<'_>, faults: &mut Vec<Fault>) -> (String, Templates) {
    // A missing or non-text prompt is already reported.
    let Some(at) = at.get("prompt").filter(|prompt| prompt.written() == name) else { return Default::default() };
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
            faults.push(at.fault(why).help(help));
            Default::default()
        }
    }
}

fn picture(ViewTable { width, height, fovy, eye_height }: ViewTable) -> Picture {
    let [width, height, fovy] =
        [(width, 640), (height, 480), (fovy, 60)].map(|(value, absent)| value.unwrap_or(absent));
    Picture { width, height, fovy, eye_height_mm: eye_height.map(millimetres) }
}

fn relations(spec: &Spec, at: &At<'_>, faults: &mut Vec<Fault>) {
    let [decision, marks] = [at.key("decision"), at.key("mark")];
    if spec.decision == Decision::SelectedCube && !spec.has_candidates() {
        let fault = decision.fault("the decision is a cube, and there is none to select");
        faults.push(fault.help("use `cubes = { kind = \"candidates\", count = 3 }` or `decision = \"self_color\"`"));
    }
    if spec.stated_color == Stated::Candidate && !spec.has_candidates() {
        let fault = at.key("stated_color").fault("there is no other candidate whose colour could be stated");
        faults.push(fault.help("use `stated_color = \"random\"`"));
    }
    if spec.camera == CameraKind::Behind && spec.view.is_some_and(|view| view.eye_height_mm.is_some()) {
        let fault = at.key("view").fault("`eye_height` is that of the agent's eye, and the camera is behind the body");
        faults.push(fault.help("leave `eye_height` out, or use `camera = \"eye\"`"));
    }
    let wears = |wearer: Wearer| spec.marks.iter().any(|mark| mark.on == wearer);
    if spec.truth == Truth::MarkColor && !wears(Wearer::Own) {
        faults.push(decision.fault("what should be named is a mark, and the own body has none"));
    }
    if wears(Wearer::Other) && spec.layout.others.least == Some(0) {
        let fault = marks.fault("another body wears a mark, and there may be no other body");
        faults.push(fault.help("use `others = { least = 1, most = 1 }`"));
    }
    let places: Vec<_> = spec.marks.iter().map(|mark| (mark.on, mark.part)).collect();
    if (1..places.len()).any(|at| places[..at].contains(&places[at])) {
        faults.push(marks.fault("two marks on the same part of a body"));
    }
}

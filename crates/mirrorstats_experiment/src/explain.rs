use std::fmt::Write as _;

use super::Experiment;
use super::spec::{
    Answer, Behavior, Body, BodyShown, CameraKind, Colors, Cubes, Hand, Look, Mark, MarkColor, Occluders, Others,
    Paint, Pane, PaneKind, Picture, Start, Stated, Wall, Wearer,
};
use mirrorstats_exact::escape::visible;

/// Measurements of the world's scenes, in words.
#[derive(Clone, Debug, Default)]
pub struct Measured {
    /// The steps of the shortest ways.
    pub ways: Option<String>,
    /// The rate of a player without a mirror.
    pub blind: Option<String>,
    /// A warning if that is more than chance.
    pub warning: Option<String>,
}

/// An experiment in words.
pub fn explained(experiment: &Experiment, measured: &Measured) -> String {
    let mut text = format!("{}: {}\n", experiment.name(), visible(&experiment.title));
    let mut line = |name: &str, words: &str| {
        let _ = writeln!(text, "  {name:<10}{words}");
    };
    if experiment.scenes == experiment.name() {
        line("scenes", "its own");
    } else {
        line("scenes", &format!("those of {}: episodes of equal seed and run are pairs", experiment.scenes));
    }
    line("body", &body(experiment));
    match experiment.body {
        Some(Body::Mannequin) => line("shape", "mannequins, with a neutral head and a face"),
        Some(Body::Humanoid) => line("shape", "humanoids with the sizes of MuJoCo's, all in one colour"),
        None => {}
    }
    line("cubes", &cubes(experiment.layout.cubes));
    line("others", &others(experiment.layout.others, experiment.has_candidates()));
    let start = match experiment.layout.start {
        Start::FacingAway => "the first mirror, or its place, is out of view",
        Start::Any => "anywhere, facing anything",
        Start::BeforeMirror => "two metres before the first mirror, or its place, facing it",
    };
    line("start", start);
    experiment.panes.iter().for_each(|pane| line("mirror", &self::pane(pane)));
    if experiment.panes.is_empty() {
        line("mirror", "none");
    }
    experiment.marks.iter().for_each(|mark| line("mark", &self::mark(*mark)));
    let stated = match experiment.stated_color {
        Stated::None => "",
        Stated::Candidate => "; it states the colour of another candidate as the body's",
        Stated::Random => "; it states a colour as the body's that no candidate has",
    };
    line("prompt", &format!("{}{stated}", visible(&experiment.prompt)));
    line("reply", &experiment.keys().join(", "));
    experiment.answers.iter().for_each(|answer| line("answer", &self::answer(answer)));
    if !experiment.absent.is_empty() {
        let columns: Vec<&str> = experiment.absent.iter().map(|column| column.name()).collect();
        line("absent", &format!("{}: not used here, and in no trace", columns.join(", ")));
    }
    if let Some(hand) = experiment.hand {
        line("hand", &self::hand(hand));
    }
    if experiment.camera == CameraKind::Behind {
        line("camera", "behind the body and above it, which looks over its head");
    }
    if let Some(Picture { width, height, fovy, eye_height_mm }) = experiment.view {
        let eye = eye_height_mm.map_or_else(String::new, |mm| format!(", the eye at {} m", f64::from(mm) / 1000.0));
        line("view", &format!("{width} x {height} pixels, {fovy} degrees high{eye}"));
    }
    if experiment.look == Look::Textured {
        line("look", "panelled walls, soft shadows, mirrors with a frame and a slight tint");
    }
    let at = if experiment.hand.is_some() { "at the end" } else { "at `done`" };
    line("decision", &format!("{} {at}, compared with {}", experiment.decision.name(), experiment.truth.name()));
    line("scored by", &visible(experiment.definitions.as_deref().unwrap_or("the default definitions")));
    if let Some(Hand { extra_steps, .. }) = experiment.hand {
        let most = experiment.steps.map_or_else(String::new, |most| format!("; {most} at most"));
        line("steps", &format!("those from the start to the mark, and {extra_steps} more{most}"));
    } else {
        let steps = experiment.steps.map_or_else(|| "as the world says".to_owned(), |steps| steps.to_string());
        line("steps", &steps);
        let metres = |mm| format!("{} m long", f64::from(mm) / 1000.0);
        let length = experiment.step_length_mm.map_or_else(|| "as long as the world says".to_owned(), metres);
        line("step", &format!("{length}, turns of 30 degrees"));
    }
    if let Some(words) = &measured.ways {
        line("ways", words);
    }
    let chance: Vec<String> = experiment.chance.iter().map(|(metric, level)| format!("{metric} {level}")).collect();
    if !chance.is_empty() {
        line("chance", &visible(&chance.join(", ")));
    }
    if let Some(words) = &measured.blind {
        line("blind", words);
    }
    text
}

fn body(experiment: &Experiment) -> String {
    let layout = &experiment.layout;
    let colors: Vec<&str> = layout.palette.iter().map(|color| color.name()).collect();
    let drawn = match layout.colors {
        Colors::Balanced => "each of the colours equally often",
        Colors::Random => "one of the colours by chance",
    };
    format!("{drawn}: {}", colors.join(", "))
}

fn cubes(cubes: Cubes) -> String {
    let number = |count: Option<u32>, word: &str| count.map_or_else(|| word.to_owned(), |count| count.to_string());
    match cubes {
        Cubes::None => "none".to_owned(),
        Cubes::Candidates { count } => format!("{count} of different colours, one of them the body's"),
        Cubes::Clutter { least, most, occluders, .. } => {
            let count = match (least, most) {
                (None, None) => "as much as the world says".to_owned(),
                _ => format!("{} to {}", number(least, "the world's least"), number(most, "the world's most")),
            };
            let places = match occluders {
                Occluders::BeforeMirror => "some of it before the first mirror",
                Occluders::Random => "each cube on the floor, anywhere",
            };
            format!("clutter, {count}, {places}")
        }
    }
}

fn others(others: Others, has_candidates: bool) -> String {
    let does = match others.behavior {
        Behavior::Walk => "walk about",
        Behavior::Stand => "stand still",
    };
    let twin = match (others.color, others.twin_percent) {
        (Some(Paint::Own), _) => "all have the own colour".to_owned(),
        (Some(Paint::Other), _) => "none has the own colour, or that of a candidate".to_owned(),
        (Some(Paint::Named(color)), _) => format!("all are {}", color.name()),
        (None, _) if !has_candidates => "each in any colour".to_owned(),
        (None, None) => "the world's share of them have a candidate's colour, the others any".to_owned(),
        (None, Some(percent)) => format!("{percent} % of them have a candidate's colour, the others any"),
    };
    match (others.least, others.most) {
        (_, Some(0)) => "none".to_owned(),
        (Some(least), Some(most)) if least == most => format!("{least}, who {does}; {twin}"),
        (Some(least), Some(most)) => format!("{least} to {most}, who {does}; {twin}"),
        _ => format!("as many as the world says, who {does}; {twin}"),
    }
}

fn pane(pane: &Pane) -> String {
    let color = match pane.color {
        Paint::Own => "in the body's own colour".to_owned(),
        Paint::Other if pane.kind == PaneKind::Window => "in a colour that no candidate has".to_owned(),
        Paint::Other => "in another colour, that of another candidate where there are candidates".to_owned(),
        Paint::Named(color) => format!("in {}", color.name()),
    };
    let late = if pane.delay > 0 { format!(", {} steps late", pane.delay) } else { String::new() };
    let what = match (pane.kind, pane.body) {
        (PaneKind::Mirror, _) => "a plane mirror".to_owned(),
        (PaneKind::Delayed, _) => format!("a mirror that shows the room {} steps late", pane.delay),
        (PaneKind::Decoy, BodyShown::Own) => format!("a mirror that shows the own body {color}{late}"),
        (PaneKind::Decoy, BodyShown::Independent) => {
            format!("a mirror that shows, in place of the own body, one that walks by itself, {color}{late}")
        }
        (PaneKind::Window, _) => format!("a window into a second room, where a body walks by itself, {color}"),
    };
    let wall = match pane.wall {
        Wall::Random => "a wall that is drawn",
        Wall::Opposite => "the wall across from the first",
        Wall::Same => "the wall of the first, beside it",
        Wall::East => "the wall at +x",
        Wall::North => "the wall at +y",
        Wall::West => "the wall at -x",
        Wall::South => "the wall at -y",
    };
    let frame = if pane.frame { ", with a frame" } else { "" };
    let [from, until] = [("from", pane.from_t), ("until", pane.until_t)]
        .map(|(word, t)| t.map_or_else(String::new, |t| format!(", {word} step {t}")));
    format!("{what}, on {wall}{frame}{from}{until}{}", sizes(pane))
}

fn sizes(pane: &Pane) -> String {
    let metres = |mm: u32| f64::from(mm) / 1000.0;
    let parts = [(pane.width_mm, "wide"), (pane.height_mm, "high"), (pane.bottom_mm, "above the floor")];
    let given: Vec<String> =
        parts.into_iter().filter_map(|(mm, what)| Some(format!("{} m {what}", metres(mm?)))).collect();
    if given.is_empty() { "; its size is the world's".to_owned() } else { format!("; {}", given.join(", ")) }
}

fn hand(hand: Hand) -> String {
    let Hand { step_mm, least, most, within, .. } = hand;
    format!(
        "{step_mm} mm at a time in six directions, {least} to {most} steps from the mark at the start; the mark is reached \
         within {within}"
    )
}

fn answer(answer: &Answer) -> String {
    let truth = match (answer.truth, &answer.constant) {
        (Some(fact), _) => format!("the fact `{}`", fact.name()),
        (None, Some(constant)) => format!("always `{}`", visible(constant)),
        (None, None) => {
            let by: Vec<String> =
                answer.conditions.iter().map(|(condition, truth)| format!("`{truth}` in `{condition}`")).collect();
            visible(&by.join(", "))
        }
    };
    format!("{}, {}; should be {truth}", answer.key, visible(&answer.expected()))
}

fn mark(mark: Mark) -> String {
    let who = match mark.on {
        Wearer::Own => "on the own body",
        Wearer::Other => "on the first of the others",
    };
    let color = match mark.color {
        MarkColor::Random => "of a drawn colour".to_owned(),
        MarkColor::Named(color) => color.name().to_owned(),
    };
    let when = if mark.from_t == 1 { "from the start".to_owned() } else { format!("from step {}", mark.from_t) };
    format!("{color}, {who}: the {}, {when}", mark.part.name())
}

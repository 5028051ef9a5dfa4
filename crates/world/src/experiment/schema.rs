//! The shape of an experiment file, for editors and other programs (`schemas/experiments.schema.json`).
//!
//! The reader in `table` goes by the TOML itself, to show every fault at its place; this is the same shape as types. A
//! test reads the built-in files through both, and holds the keys of both against each other.

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::Deserialize;

use super::spec::{
    AbsentColumn, Actions, Behavior, BodyShown, Camera, Colors, Decision, MarkColor, Paint, PaneKind, Part, ReplyKey,
    Start, Stated, Truth, Wall, Wearer,
};
use exact::ratio::Ratio;
use trace::palette::Color;

/// A file of experiments.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ExperimentFile {
    /// At most 64 experiments by name: 1 to 40 letters, digits, `-` and `_`; not that of a built-in one.
    pub experiment: IndexMap<String, ExperimentTable>,
}

/// An experiment. A key that is absent has the value that its description names.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ExperimentTable {
    /// The heading of its group in tables, without its name.
    pub title: String,
    /// Its position among experiments; after those that have one if absent.
    pub order: Option<i64>,
    /// Chance levels by metric: a fraction such as `1/3`, a number, or `none`.
    #[serde(default)]
    pub chance: IndexMap<String, Level>,
    /// What blind strategies would reach, by metric, where no chance level applies.
    #[serde(default)]
    pub reference: IndexMap<String, Vec<Fraction>>,
    /// A built-in experiment, or one above in the file, whose scenes it has: episodes of equal seed and run are pairs. Its
    /// own if absent. `colors`, `palette`, `cubes`, `others` and `start` are then those of that experiment.
    pub scenes: Option<String>,
    /// How the body's colour is drawn; `balanced` if absent.
    pub colors: Option<Colors>,
    /// The colours of bodies and cubes, at least two; all ten if absent.
    #[schemars(length(min = 2))]
    pub palette: Option<Vec<Color>>,
    /// The cubes; three candidates if absent.
    pub cubes: Option<CubesTable>,
    /// The other agents; none if absent.
    pub others: Option<OthersTable>,
    /// How the agent stands at the start; `facing_away` if absent.
    pub start: Option<Start>,
    /// The column that holds the decision; `selected_cube` if absent, `self_color` where there are no candidates,
    /// `target_distance` where there is a hand.
    pub decision: Option<Decision>,
    /// The column that holds what the decision should name; `body_color` if absent, `mark_color` for `mark_report`,
    /// `start_distance` for `target_distance`.
    pub truth: Option<Truth>,
    /// The definitions that score it: `paper`, `battery`, another built-in name, or a path relative to this file. If absent
    /// `battery` for `mark_report`, `reach` for `target_distance`, else the default ones.
    pub definitions: Option<String>,
    /// Columns that have no meaning for the task, and that its traces do not have; none if absent. A column that a key of
    /// the reply fills has one.
    pub absent: Option<Vec<AbsentColumn>>,
    /// What the prompt states of the body's colour; `none` if absent.
    pub stated_color: Option<Stated>,
    /// The keys of a reply, in the order of the prompt; those that the decision needs if absent.
    pub reply: Option<Vec<ReplyKey>>,
    /// A built-in prompt (`cube-selection`, `exploration`, `mark`, `reach-scheme`, `reach-mirror`, `reach-hand`, `reach-bare`), or a folder beside the file or below it with
    /// `system.txt` and `user.txt`.
    pub prompt: String,
    /// What the agent can do; `hand` if absent where there is one, else `walk`.
    pub actions: Option<Actions>,
    /// What the agent sees with; `eye` if absent.
    pub camera: Option<Camera>,
    /// Steps after which an episode ends by itself; the world's if absent.
    #[schemars(range(min = 1, max = 100_000))]
    pub steps: Option<u32>,
    /// The length of the agent's own steps, m; the world's if absent.
    #[schemars(range(min = 0.1, max = 1.0))]
    pub step_length: Option<f64>,
    /// Mirrors and windows, at most four; a bare wall if absent or empty.
    #[serde(default)]
    #[schemars(length(max = 4))]
    pub mirror: Vec<MirrorTable>,
    /// Marks on bodies, at most four.
    #[serde(default)]
    #[schemars(length(max = 4))]
    pub mark: Vec<MarkTable>,
    /// The hand that moves in place of the body, to reach the mark on its front; none if absent.
    pub hand: Option<HandTable>,
    /// The size and the angle of the picture; the world's if absent.
    pub view: Option<ViewTable>,
}

/// A hand that floats freely, a step at a time.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HandTable {
    /// The length of its steps, m; 0.1 if absent.
    #[schemars(range(min = 0.02, max = 0.5))]
    pub step: Option<f64>,
    /// Steps from the mark at the start at least, along the three directions together; 6 if absent.
    #[schemars(range(min = 2, max = 40))]
    pub least: Option<u32>,
    /// The same at most; 12 if absent, or `least`.
    #[schemars(range(min = 2, max = 40))]
    pub most: Option<u32>,
    /// Steps from the mark at which it is reached, fewer than `least`; 1 if absent.
    #[schemars(range(min = 1, max = 40))]
    pub within: Option<u32>,
    /// The steps of an episode beyond those from the start to the mark; 10 if absent.
    #[schemars(range(max = 1000))]
    pub extra_steps: Option<u32>,
}

/// The size and the angle of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ViewTable {
    /// Pixels in a row; 640 if absent.
    #[schemars(range(min = 16, max = 1920))]
    pub width: Option<u32>,
    /// Rows; 480 if absent.
    #[schemars(range(min = 12, max = 1440))]
    pub height: Option<u32>,
    /// The vertical field of view, degrees; 60 if absent.
    #[schemars(range(min = 30, max = 115))]
    pub fovy: Option<u32>,
}

/// A chance level.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Level {
    /// There is none.
    None(NoLevel),
    /// This one.
    Of(Fraction),
}

/// The word that says that there is no level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
pub enum NoLevel {
    /// `none`.
    #[serde(rename = "none")]
    None,
}

/// A fraction in quotes such as `1/3`, or a number.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Fraction {
    /// In quotes.
    Text(Ratio),
    /// A decimal is the fraction that it says: `0.25` is 1/4.
    Number(f64),
}

/// The cubes of a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case", tag = "kind")]
pub enum CubesTable {
    /// No cube.
    None,
    /// Cubes of different colours, one of them the body's.
    Candidates {
        /// How many, at most as many as the palette has colours; three if absent, or all colours of a palette of two.
        #[schemars(range(min = 2, max = 10))]
        count: Option<u32>,
    },
    /// Cubes of any colours, some of them before the first mirror.
    Clutter {
        /// How many at least; the world's if absent.
        #[schemars(range(max = 12))]
        least: Option<u32>,
        /// How many at most; the world's if absent.
        #[schemars(range(max = 12))]
        most: Option<u32>,
        /// Of a hundred places before the first mirror, those from which it hides half of the body or more, at least; the
        /// world's if absent.
        #[schemars(range(max = 100))]
        hides: Option<u32>,
    },
}

/// The other agents of a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OthersTable {
    /// How many at least; the world's if absent.
    #[schemars(range(max = 6))]
    pub least: Option<u32>,
    /// How many at most; the world's if absent.
    #[schemars(range(max = 6))]
    pub most: Option<u32>,
    /// What they do; `walk` if absent.
    pub behavior: Option<Behavior>,
    /// Of a hundred episodes, those where one of them has the colour of the agent's own body; the world's if absent.
    #[schemars(range(max = 100))]
    pub twin_percent: Option<u32>,
}

/// A mirror, or something in a mirror's place.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MirrorTable {
    /// What it shows; `mirror` if absent.
    pub kind: Option<PaneKind>,
    /// Steps by which it is late. A delayed mirror needs the key; a mirror with one is a delayed one; a window has none.
    #[schemars(range(min = 1, max = 1000))]
    pub delay: Option<u32>,
    /// The colour of the body that a decoy or a window shows: `own`, `other`, or a colour; `other` if absent for a decoy of
    /// the own body, else `own`.
    pub color: Option<Paint>,
    /// Whose motion the body has that a decoy shows; `own` if absent.
    pub body: Option<BodyShown>,
    /// Where it hangs; `random` if absent. The first one's wall is part of the scene.
    pub wall: Option<Wall>,
    /// Along the wall, m; the world's if absent.
    #[schemars(range(min = 0.5, max = 10.0))]
    pub width: Option<f64>,
    /// m; the world's if absent.
    #[schemars(range(min = 0.5, max = 5.0))]
    pub height: Option<f64>,
    /// Of its lower edge above the floor, m; about the world's height of centres if absent.
    #[schemars(range(min = 0.0, max = 3.0))]
    pub bottom: Option<f64>,
}

/// A mark on a body.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MarkTable {
    /// Where on the body.
    pub part: Part,
    /// Of its paint: a colour, or `random`, which is what it is if absent and never that of its wearer.
    pub color: Option<MarkColor>,
    /// The first step that shows it, at most the experiment's `steps`; 1 if absent.
    #[schemars(range(min = 1))]
    pub from_t: Option<u32>,
    /// Who wears it; `self` if absent.
    pub on: Option<Wearer>,
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use serde_json::{Value, json};

    use super::ExperimentFile;
    use crate::experiment::{Experiment, built_in, built_in_names, file};
    use toml_spec::Source;

    #[test]
    fn the_built_in_files_have_this_shape() {
        for name in built_in_names() {
            let file: ExperimentFile = toml::from_str(built_in(name).unwrap()).unwrap();
            let (shape, experiment) = (&file.experiment[name], Experiment::parse(name).unwrap());
            assert_eq!((file.experiment.len(), &shape.title), (1, &experiment.title));
            assert_eq!((shape.order, &shape.prompt), (experiment.order, &experiment.prompt));
            assert_eq!(shape.mirror.len(), experiment.panes.len());
            assert_eq!(shape.mark.len(), experiment.marks.len());
        }
    }

    /// The keys that the reader names where it refuses one, for a text with the unknown key `zzzzzz`.
    fn keys_of_reader(text: &str) -> BTreeSet<String> {
        let head = "[experiment.X]\ntitle = 'X'\nprompt = 'exploration'\n";
        let source = Source { name: "mine.toml".to_owned(), text: format!("{head}{text}") };
        let faults =
            file::read(source, Some(std::path::Path::new(".")), &crate::experiment::built_in_specs()).unwrap_err();
        let helps: Vec<&str> = faults.0.iter().filter_map(|fault| fault.help.as_deref()).collect();
        let [help] = helps[..] else { panic!("{text}: {faults:?}") };
        help.split_once(" are ").unwrap().1.split(", ").map(str::to_owned).collect()
    }

    /// The keys of a type of the schema, or of one kind of it.
    fn keys_of_schema(name: &str, kind: Option<&str>) -> BTreeSet<String> {
        let schema = json!(schemars::schema_for!(ExperimentFile));
        let of_type = &schema["$defs"][name];
        let is_kind = |one: &&Value| one["properties"]["kind"]["const"] == kind.unwrap();
        let found = kind.map_or(of_type, |_| of_type["oneOf"].as_array().unwrap().iter().find(is_kind).unwrap());
        found["properties"].as_object().unwrap().keys().cloned().collect()
    }

    #[test]
    fn the_reader_takes_the_keys_of_the_schema_and_no_others() {
        for (name, kind, text) in [
            ("ExperimentTable", None, "zzzzzz = 1"),
            ("CubesTable", Some("none"), "cubes = { kind = 'none', zzzzzz = 1 }"),
            ("CubesTable", Some("candidates"), "cubes = { kind = 'candidates', zzzzzz = 1 }"),
            ("CubesTable", Some("clutter"), "cubes = { kind = 'clutter', zzzzzz = 1 }"),
            ("OthersTable", None, "others = { zzzzzz = 1 }"),
            ("MirrorTable", None, "mirror = [{ zzzzzz = 1 }]"),
            ("MarkTable", None, "mark = [{ part = 'head', zzzzzz = 1 }]"),
            ("HandTable", None, "hand = { zzzzzz = 1 }"),
            ("ViewTable", None, "view = { zzzzzz = 1 }"),
        ] {
            assert_eq!(keys_of_schema(name, kind), keys_of_reader(text), "{name} {kind:?}");
        }
    }
}

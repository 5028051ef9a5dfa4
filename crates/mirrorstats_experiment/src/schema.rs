//! The shape of an experiment file, for editors and other programs (`schemas/experiments.schema.json`).
//!
//! Each key is declared once, here: parser and schema use these types. `table` makes a [`Spec`](super::Spec) of them.

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::Deserialize;

use super::spec::{
    AbsentColumn, Actions, Answer, Body, BodyShown, CameraKind, Colors, Cubes, Decision, Look, MOST_MARKS, MOST_PANES,
    Mark, Others, Paint, PaneKind, ReplyKey, Start, Stated, Truth, Wall,
};
use mirrorstats_metric::shape::{ChanceLevel, Fraction};
use mirrorstats_trace::episodes::answers::MOST_ANSWERS;
use mirrorstats_trace::schema::colors::Color;

/// A file of experiments.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "ExperimentFile")]
pub struct ExperimentFile<T = ExperimentTable> {
    /// At most 64 experiments by name: 1 to 40 letters, digits, `-` and `_`; not that of a built-in one.
    pub experiment: IndexMap<String, T>,
}

/// A table of which every key is read elsewhere.
#[derive(Deserialize, JsonSchema)]
pub(super) struct AnyTable {}

/// An experiment. A key that is absent has the value that its description names.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ExperimentTable {
    /// The heading of its group in tables, without its name.
    pub title: String,
    /// Its position among experiments; after those that have one if absent.
    pub order: Option<i64>,
    /// Chance levels by metric: a fraction such as `1/3`, a number, one of them for each blind strategy, or `none`.
    #[serde(default)]
    pub chance: IndexMap<String, ChanceLevel>,
    /// The rates of blind strategies, by metric, where no chance level applies.
    #[serde(default)]
    pub reference: IndexMap<String, Vec<Fraction>>,
    /// A built-in experiment, or one above in the file, whose scenes it has: episodes of equal seed and run are pairs. Its
    /// own if absent. `colors`, `palette`, `cubes`, `others` and `start` are then those of that experiment. `steps`,
    /// `step_length`, `view`, `camera`, `look` and `body` change no scene.
    pub scenes: Option<String>,
    /// The draw of the body's colour; `balanced` if absent.
    pub colors: Option<Colors>,
    /// The colours of bodies and cubes, at least two; all ten if absent.
    #[schemars(length(min = 2), extend("uniqueItems" = true))]
    pub palette: Option<Vec<Color>>,
    /// The cubes; three candidates if absent.
    pub cubes: Option<Cubes>,
    /// The other agents; none if absent.
    pub others: Option<Others>,
    /// The agent's pose at the start; `facing_away` if absent.
    pub start: Option<Start>,
    /// The column that holds the decision. If absent `target_distance` where there is a hand, `selected_cube` where there are
    /// candidates, `answer` where there are answers, else `self_color`.
    pub decision: Option<Decision>,
    /// The column that holds what the decision should name; `body_color` if absent, `mark_color` for `mark_report`,
    /// `start_distance` for `target_distance`, `answer_truth` for `answer`.
    pub truth: Option<Truth>,
    /// The definitions that score it: `paper`, `battery`, another built-in name, or a path relative to this file. If absent
    /// `battery` for `mark_report`, `evidence` for `answer`, `reach` for `target_distance`, else the default ones.
    pub definitions: Option<String>,
    /// Columns that have no meaning for the task, and that its traces do not have; none if absent. A column that a key of
    /// the reply fills has one.
    #[schemars(extend("uniqueItems" = true))]
    pub absent: Option<Vec<AbsentColumn>>,
    /// The body's colour in the prompt; `none` if absent.
    pub stated_color: Option<Stated>,
    /// The keys of a reply, in the order of the prompt; those that the decision needs if absent.
    #[schemars(extend("uniqueItems" = true))]
    pub reply: Option<Vec<ReplyKey>>,
    /// Answers that the experiment asks for besides, at most eight: keys of the reply after those of `reply`, with columns of
    /// their own in traces.
    #[serde(default)]
    #[schemars(length(max = MOST_ANSWERS))]
    pub answer: Vec<Answer>,
    /// A built-in prompt (`cube-selection`, `exploration`, `mark`, `reach-scheme`, `reach-mirror`, `reach-hand`, `reach-bare`, `memory-0`, `memory-8`, `memory-no-summary`, `memory-no-position`,
    /// `evidence`, `answers`), or a folder beside the file or below it with
    /// `system.txt` and `user.txt`.
    pub prompt: String,
    /// The agent's actions; `hand` if absent and it has one, else `walk`.
    pub actions: Option<Actions>,
    /// The agent's camera; `eye` if absent.
    pub camera: Option<CameraKind>,
    /// Steps after which an episode ends automatically; the world's if absent.
    #[schemars(range(min = 1, max = 100_000))]
    pub steps: Option<u32>,
    /// The length of the agent's own steps, m; the world's if absent.
    #[schemars(range(min = 0.1, max = 1.0))]
    pub step_length: Option<f64>,
    /// Mirrors and windows, at most four; a bare wall if absent or empty.
    #[serde(default)]
    #[schemars(length(max = MOST_PANES))]
    pub mirror: Vec<MirrorTable>,
    /// Marks on bodies, at most four.
    #[serde(default)]
    #[schemars(length(max = MOST_MARKS))]
    pub mark: Vec<Mark>,
    /// The hand that moves in place of the body, to reach the mark on its front; none if absent.
    pub hand: Option<HandTable>,
    /// The size, the angle and the height of the picture; the world's if absent.
    pub view: Option<ViewTable>,
    /// How the room and its mirrors look: `plain`, or `textured`, with panelled walls, soft shadows, and frame and tint of a
    /// mirror; `plain` if absent.
    pub look: Option<Look>,
    /// The shape of all bodies: `mannequin`, or `humanoid`, the sizes of MuJoCo's standard humanoid; the world's if absent.
    pub body: Option<Body>,
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

/// A mirror, or something in a mirror's place.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MirrorTable {
    /// Its kind; `mirror` if absent.
    pub kind: Option<PaneKind>,
    /// Steps by which it is late. A delayed mirror needs the key; a mirror with one is a delayed one; a window has none.
    #[schemars(range(max = 1000))]
    pub delay: Option<u32>,
    /// The colour of the body that a decoy or a window shows: `own`, `other`, or a colour; `other` if absent for a decoy of
    /// the own body, else `own`.
    pub color: Option<Paint>,
    /// Whose motion the body has that a decoy shows; `own` if absent.
    pub body: Option<BodyShown>,
    /// Its wall; `random` if absent. The first one's wall is part of the scene.
    pub wall: Option<Wall>,
    /// Along the wall, m; the world's if absent.
    #[schemars(range(min = 0.1, max = 10.0))]
    pub width: Option<f64>,
    /// m; the world's if absent.
    #[schemars(range(min = 0.1, max = 5.0))]
    pub height: Option<f64>,
    /// Of its lower edge above the floor, m; about the world's height of centres if absent.
    #[schemars(range(min = 0.0, max = 3.0))]
    pub bottom: Option<f64>,
    /// The first step that shows it, at most the experiment's `steps`; 1 if absent. Before it the wall is bare.
    #[schemars(range(min = 1, max = 100_000))]
    pub from_t: Option<u32>,
    /// The last step that shows it; the last of the episode if absent.
    #[schemars(range(min = 1, max = 100_000))]
    pub until_t: Option<u32>,
    /// True if it has a frame of wood; all mirrors have one if `look` is `textured`.
    pub frame: Option<bool>,
}

/// The size, the angle and the height of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
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
    /// The height of the eye above the floor, m; the world's if absent.
    #[schemars(range(min = 0.5, max = 1.9))]
    pub eye_height: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::ExperimentFile;
    use crate::{Experiment, built_in, built_in_names};

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
}

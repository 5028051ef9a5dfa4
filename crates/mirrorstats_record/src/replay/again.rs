use std::collections::BTreeMap;

use serde_json::Value as Json;

use super::error::{Divergence, ReplayError};
use crate::rollout;
use mirrorstats_experiment::spec::Side;
use mirrorstats_experiment::{Experiment, Spec};
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_sim::scene::{SCENE_VERSION, Scene};
use mirrorstats_sim::visibility::Visibility;
use mirrorstats_sim::world::World;
use mirrorstats_trace::episodes::answers::Answered;
use mirrorstats_trace::episodes::episode::{Episode, Step};
use mirrorstats_trace::schema::{self, Value};

#[derive(Clone, Debug, PartialEq)]
pub struct Recipe {
    pub experiment: Experiment,
    pub config: WorldConfig,
}

impl Recipe {
    pub fn from_recording(recording: &Json) -> Result<Self, ReplayError> {
        // This check is first: a world of another version may lack values that this one has.
        let version = recording.get("scene_version").ok_or(ReplayError::NoRecipe)?;
        if *version != SCENE_VERSION {
            return Err(ReplayError::Scenes { found: version.to_string() });
        }
        let world = recording.get("world").ok_or(ReplayError::NoRecipe)?;
        let config: WorldConfig =
            serde_json::from_value(world.clone()).map_err(|fault| ReplayError::Recipe(fault.to_string()))?;
        let expected = recording.get("world_hash").and_then(Json::as_str).unwrap_or_default();
        if config.hash() != expected {
            return Err(ReplayError::Changed { expected: expected.to_owned(), found: config.hash() });
        }
        let spec = recording.get("experiment").ok_or(ReplayError::NoRecipe)?;
        let spec: Spec =
            serde_json::from_value(spec.clone()).map_err(|fault| ReplayError::Recipe(fault.to_string()))?;
        Ok(Self { experiment: Experiment::from_footer(spec), config })
    }

    pub fn world(&self, episode: &Episode, eye: &WorldConfig) -> Result<World, ReplayError> {
        let fault = |fault: String| ReplayError::World { episode: episode.episode_id.clone(), fault };
        let name = self.experiment.name();
        if episode.experiment != name {
            return Err(fault(format!(
                "it is of the experiment `{}`, and the trace declares `{name}`",
                episode.experiment
            )));
        }
        let scene = Scene::draw(&self.config, self.experiment.clone(), episode.seed, episode.run)
            .map_err(|error| fault(error.to_string()))?;
        World::new(eye, scene).map_err(|error| fault(error.to_string()))
    }
}

/// Repeats an episode's actions up to step `last`; calls `look` before each step with the world and its visibility.
/// The rows are compared only if all steps are repeated.
pub fn again<E: From<ReplayError>>(
    recipe: &Recipe,
    eye: &WorldConfig,
    episode: &Episode,
    last: i32,
    mut look: impl FnMut(i32, &World, &Visibility, &Step) -> Result<(), E>,
) -> Result<Option<Divergence>, E> {
    let mut world = recipe.world(episode, eye)?;
    let is_same_eye = *eye == recipe.config;
    let mut replayed = rollout::constants(world.scene());
    for (t, step) in (1..=last).zip(&episode.steps) {
        let visibility = world.visibility();
        look(t, &world, &visibility, step)?;
        let mut extra = rollout::world_columns(&world, &visibility, step.selected_cube.as_deref());
        if is_same_eye {
            let condition = episode.condition.as_deref().unwrap_or("default");
            world.scene().experiment.put(Side::Truth, &world.truths(condition, &visibility), &mut extra);
        }
        let mirror_visible = world.is_mirror_visible(&visibility);
        extra.bumped = Some(world.act(step.action).bumped);
        extra.target_distance = world.target_distance();
        replayed.steps.push(Step { mirror_visible, extra, ..Step::default() });
    }
    let is_whole = replayed.steps.len() == episode.steps.len();
    Ok(divergence(episode, &replayed, is_same_eye).filter(|_| is_whole))
}

const CONSTANTS: &[&str] = &["body_color", "stated_color", "shown_color", "start_distance", "distractors"];
const MOTION: &[&str] = &["pose_x", "pose_y", "pose_yaw", "cube_distance", "mark_color"];
const SIGHT: &[&str] = &[
    "mirror_self_px",
    "mirror_other_px",
    "mirror_px",
    "direct_other_px",
    "mirror_mark_px",
    "mirror_double_px",
    "shown_px",
    "pane1_body_px",
    "pane2_body_px",
    "pane3_body_px",
    "pane4_body_px",
    "mark1_px",
    "mark2_px",
    "mark3_px",
    "mark4_px",
    "mirror_visible",
];
const EFFECTS: &[&str] = &["target_distance", "bumped"];

/// Columns whose nulls are compared. Traces of other programs may lack values of the other columns.
const NULLABLE: [&str; 2] = ["stated_color", "mark_color"];

/// The first difference, by step and column. What is seen is only compared if the eye is the recorded one.
fn divergence(recorded: &Episode, replayed: &Episode, is_same_eye: bool) -> Option<Divergence> {
    let names = [CONSTANTS, MOTION, if is_same_eye { SIGHT } else { &[] }, EFFECTS].concat();
    let of_column = |(order, name): (usize, &&str)| {
        let column = schema::column(name)?;
        let pairs = column.of_steps(recorded).zip(column.of_steps(replayed));
        let mut texts = pairs.map(|(own, found)| (own.map(text), found.map(text))).enumerate();
        let (at, (own, found)) =
            texts.find(|(_, (own, found))| (own.is_some() || NULLABLE.contains(name)) && own != found)?;
        let t = if CONSTANTS.contains(name) { 0 } else { at + 1 };
        Some(((t, order), (*name).to_owned(), own, found))
    };
    let of_truths = |at: usize| {
        let [own, found] = [recorded, replayed].map(|episode| &episode.steps[at].extra.answers);
        let value = |answers: &BTreeMap<String, Answered>, name| answers.get(name).map(Answered::text);
        let mut truths = found.keys().map(|name| (name.clone(), value(own, name), value(found, name)));
        let (name, own, found) = truths.find(|(_, own, found)| own != found)?;
        Some(((at + 1, names.len()), name, own, found))
    };
    let columns = names.iter().enumerate().filter_map(of_column);
    let found = columns.chain((0..replayed.steps.len()).find_map(of_truths)).min_by_key(|(place, ..)| *place);
    let ((t, _), column, own, found) = found?;
    let [expected, found] = [own, found].map(|value| value.unwrap_or_else(|| "none".to_owned()));
    let t = i32::try_from(t).unwrap_or(i32::MAX);
    Some(Divergence { episode_id: recorded.episode_id.clone(), t, column, expected, found })
}

fn text(value: Value<'_>) -> String {
    match value {
        Value::Bool(value) => value.to_string(),
        Value::Int(value) => value.to_string(),
        #[expect(clippy::cast_possible_truncation, reason = "what the trace stores")]
        Value::Float(value) => (value as f32).to_string(),
        Value::Text(value) => value.to_owned(),
    }
}

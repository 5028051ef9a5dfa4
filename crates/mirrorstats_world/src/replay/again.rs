use serde_json::Value as Json;

use super::error::{Divergence, ReplayError};
use crate::experiment::spec::Side;
use crate::experiment::{Experiment, Spec};
use crate::sim::config::WorldConfig;
use crate::sim::scene::{SCENE_VERSIONS, Scene};
use crate::sim::visibility::{Visibility, by_column};
use crate::sim::world::World;
use mirrorstats_trace::episodes::answers::Answered;
use mirrorstats_trace::episodes::episode::{Episode, Extra, Step};
use mirrorstats_trace::episodes::palette::Color;
use mirrorstats_trace::schema::{self, Value};

/// The maximum number of rays per row and per column of the visibility grid.
const MOST_RAYS: u32 = 4096;

#[derive(Clone, Debug, PartialEq)]
pub struct Recipe {
    pub experiment: Experiment,
    pub config: WorldConfig,
    /// The same configuration with the grid and threshold of the trace's pixel counts.
    pub eye: WorldConfig,
}

impl Recipe {
    pub fn of(recording: &Json) -> Result<Self, ReplayError> {
        // This check is first: a world of another version may lack values that this one has.
        let version = recording.get("scene_version").ok_or(ReplayError::NoRecipe)?;
        if !SCENE_VERSIONS.iter().any(|drawn| *version == *drawn) {
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
        let eye = counted_with(&config, recording);
        Ok(Self { experiment: Experiment::of_footer(spec), config, eye })
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

fn counted_with(config: &WorldConfig, recording: &Json) -> WorldConfig {
    let number = |value: Option<&Json>| u32::try_from(value?.as_u64()?).ok();
    let grid = |side: &str| {
        let side = number(recording.get("visibility_grid").and_then(|grid| grid.get(side)));
        side.filter(|side| (1..=MOST_RAYS).contains(side))
    };
    let mut eye = config.clone();
    eye.eye.width = grid("width").unwrap_or(eye.eye.width);
    eye.eye.height_px = grid("height").unwrap_or(eye.eye.height_px);
    let threshold = number(recording.get("visibility_threshold_px"));
    eye.evidence.mirror_self_px = threshold.unwrap_or(eye.evidence.mirror_self_px);
    eye
}

/// Repeats an episode's actions; calls `look` before each step with the world and its visibility.
pub fn again<E: From<ReplayError>>(
    recipe: &Recipe,
    eye: &WorldConfig,
    episode: &Episode,
    mut look: impl FnMut(i32, &World, &Visibility, &Step) -> Result<(), E>,
) -> Result<Option<Divergence>, E> {
    let mut world = recipe.world(episode, eye)?;
    let is_same_eye = *eye == recipe.eye;
    let mut parted = differs(episode, 0, &constants(episode, world.scene()));
    for (t, (at, step)) in (1..).zip(episode.steps.iter().enumerate()) {
        let visibility = world.visibility();
        look(t, &world, &visibility, step)?;
        let mut columns = poses(step, &world);
        if is_same_eye {
            columns.extend(counts(episode, at, &world, &visibility));
        }
        let truths = if is_same_eye { truths(episode, step, &world, &visibility) } else { Vec::new() };
        let bumped = world.act(step.action).bumped;
        let distance = world.target_distance().map_or("none".to_owned(), |distance| distance.to_string());
        columns.extend(step.extra.target_distance.map(|own| ("target_distance", own.to_string(), distance)));
        columns.extend(step.extra.bumped.map(|own| ("bumped", own.to_string(), bumped.to_string())));
        parted = parted.or_else(|| differs(episode, t, &columns)).or_else(|| differs(episode, t, &truths));
    }
    Ok(parted)
}

/// A column, the trace's value, and the replay's value.
type Compared<N = &'static str> = (N, String, String);

fn differs<N: AsRef<str>>(episode: &Episode, t: i32, columns: &[Compared<N>]) -> Option<Divergence> {
    let (column, expected, found) = columns.iter().find(|(_, expected, found)| expected != found)?;
    Some(Divergence {
        episode_id: episode.episode_id.clone(),
        t,
        column: column.as_ref().to_owned(),
        expected: expected.clone(),
        found: found.clone(),
    })
}

fn constants(episode: &Episode, scene: &Scene) -> Vec<Compared> {
    let mut columns = vec![("body_color", episode.body_color.clone(), scene.body_color.name().to_owned())];
    let stated = scene.stated_color.map_or("none", |color| color.name());
    let own = episode.stated_color.as_deref().unwrap_or("none");
    columns.push(("stated_color", own.to_owned(), stated.to_owned()));
    let shown = scene.shown_color().map(|color| color.name().to_owned());
    columns.extend(
        episode.shown_color.clone().map(|own| ("shown_color", own, shown.unwrap_or_else(|| "none".to_owned()))),
    );
    let distance = scene.start_distance().map_or("none".to_owned(), |distance| distance.to_string());
    columns.extend(episode.start_distance.map(|own| ("start_distance", own.to_string(), distance)));
    columns.extend(episode.distractors.map(|own| ("distractors", own.to_string(), scene.others.len().to_string())));
    columns
}

fn poses(step: &Step, world: &World) -> Vec<Compared> {
    #[expect(clippy::cast_possible_truncation, reason = "what the trace stores")]
    let stored = |value: f64| (value as f32).to_string();
    let pose = world.pose();
    let cube = step.selected_cube.as_deref().and_then(Color::named);
    let distance = cube.and_then(|color| world.distance_to_cube(color)).map_or("none".to_owned(), stored);
    let mark = world.scene().own_mark_at(world.t()).map(|color| color.name().to_owned());
    let own = step.extra.mark_color.clone();
    let marks = (world.has_own_mark() && own != mark).then(|| {
        let shown = |mark: Option<String>| mark.unwrap_or_else(|| "none".to_owned());
        ("mark_color", shown(own), shown(mark))
    });
    let compared = [
        ("pose_x", step.extra.pose_x, stored(pose.x)),
        ("pose_y", step.extra.pose_y, stored(pose.y)),
        ("pose_yaw", step.extra.pose_yaw, stored(pose.heading.degrees())),
        ("cube_distance", step.extra.cube_distance, distance),
    ];
    let poses = compared.into_iter().filter_map(|(name, own, found)| Some((name, own?.to_string(), found)));
    poses.chain(marks).collect()
}

/// The true values of the experiment's own answers; other programs' traces may lack them.
fn truths(episode: &Episode, step: &Step, world: &World, visibility: &Visibility) -> Vec<Compared<String>> {
    let condition = episode.condition.as_deref().unwrap_or("default");
    let mut again = Extra::default();
    world.scene().experiment.put(Side::Truth, &world.truths(condition, visibility), &mut again);
    let shown = |cell: Option<&Answered>| cell.map_or_else(|| "none".to_owned(), Answered::text);
    let compared = again
        .answers
        .iter()
        .map(|(column, found)| (column.clone(), shown(step.extra.answers.get(column)), shown(Some(found))));
    compared.collect()
}

fn counts(episode: &Episode, at: usize, world: &World, visibility: &Visibility) -> Vec<Compared> {
    let recorded = |name: &str| schema::column(name)?.of_steps(episode).nth(at)?;
    let compared = by_column(world, visibility).into_iter().filter_map(|(name, found)| match recorded(name)? {
        Value::Int(own) => Some((name, own.to_string(), found.to_string())),
        _ => None,
    });
    let visible = world.is_mirror_visible(visibility);
    let recorded = episode.steps[at].mirror_visible;
    compared.chain([("mirror_visible", recorded.to_string(), visible.to_string())]).collect()
}

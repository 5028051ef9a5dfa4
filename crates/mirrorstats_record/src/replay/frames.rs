use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use serde_json::Value;

use super::again::{Recipe, again};
use super::error::ReplayError;
use super::verify::{check_rays, rays};
use mirrorstats_log::write::Solid;
use mirrorstats_sim::camera::Camera;
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_trace::episodes::episode::Episode;

/// The rows of rays for visibility here, where the counts are unused: counting takes most of a replay's time.
const RAYS: u32 = 24;

/// The frames of these steps as PNG, by t; `recording` is the trace's metadata on its recording.
pub fn frames(
    recording: Option<&Value>,
    episode: &Episode,
    steps: &RangeInclusive<i32>,
) -> Result<BTreeMap<i32, Vec<u8>>, ReplayError> {
    let (recipe, eye) = with_few_rays(recording)?;
    rendered(&recipe, &eye, episode, *steps.end(), |t| steps.contains(&t))
}

/// Replays an episode, and passes the shapes of each step with its t.
pub fn shapes(
    recording: Option<&Value>,
    episode: &Episode,
    give: &mut dyn FnMut(usize, &[Solid]),
) -> Result<(), ReplayError> {
    let (recipe, eye) = with_few_rays(recording)?;
    check_rays(rays(episode.steps.len(), &eye), 0)?;
    let parted = again(&recipe, &eye, episode, i32::MAX, |t, world, _, _| -> Result<(), ReplayError> {
        give(usize::try_from(t).unwrap_or_default(), &world.snapshot().solids);
        Ok(())
    })?;
    parted.map_or(Ok(()), |parted| Err(ReplayError::Diverged(parted)))
}

fn with_few_rays(recording: Option<&Value>) -> Result<(Recipe, WorldConfig), ReplayError> {
    let recipe = Recipe::from_recording(recording.unwrap_or(&Value::Null))?;
    let mut eye = recipe.config.clone();
    let columns = eye.eye.width * RAYS / eye.eye.height_px.max(1);
    (eye.eye.width, eye.eye.height_px) = (columns.max(1), RAYS);
    Ok((recipe, eye))
}

/// Replays an episode up to a step, and returns the wanted frames as PNG, by t.
pub(super) fn rendered(
    recipe: &Recipe,
    eye: &WorldConfig,
    episode: &Episode,
    last: i32,
    is_wanted: impl Fn(i32) -> bool,
) -> Result<BTreeMap<i32, Vec<u8>>, ReplayError> {
    check_rays(rays(episode.steps.len(), eye), 0)?;
    let mut camera = Camera::new(&recipe.config).map_err(ReplayError::other)?;
    let mut frames = BTreeMap::new();
    let parted = again(recipe, eye, episode, last, |t, world, _, _| {
        if is_wanted(t) {
            let frame = camera.frame(world).map_err(ReplayError::other)?;
            frames.insert(t, frame.to_png().map_err(ReplayError::other)?.to_vec());
        }
        Ok::<(), ReplayError>(())
    })?;
    parted.map_or(Ok(frames), |parted| Err(ReplayError::Diverged(parted)))
}

/// Returns true if a trace describes its world, and this program can build it.
pub fn is_recipe(recording: Option<&Value>) -> bool {
    recording.is_some_and(|recording| Recipe::from_recording(recording).is_ok())
}

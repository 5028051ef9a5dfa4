//! The reasons why an experiment does not fit into a room.

use super::super::config::{WorldConfig, metres};
use super::super::scene::Scene;
use super::{Ways, is_in_view, study};
use mirrorstats_experiment::Experiment;
use mirrorstats_experiment::spec::{Hand, Pane, Start};

/// An error: no scene satisfies the constraints.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{} of seed {seed} and run {run} has {}: {}", experiment.name(), why.what, why.help)]
pub struct Crowded {
    pub(super) experiment: Experiment,
    pub(super) seed: i32,
    pub(super) run: i32,
    pub(super) why: DoesNotFit,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DoesNotFit {
    pub what: String,
    pub help: String,
    /// The key of the experiment that is at fault.
    pub key: &'static str,
    /// The mirror that is at fault, by its index in the file.
    pub mirror: Option<usize>,
}

impl DoesNotFit {
    pub(super) fn new(key: &'static str, what: String, help: impl Into<String>) -> Self {
        Self { what, help: help.into(), key, mirror: None }
    }

    pub(super) fn hand(Hand { least, most, step_mm, .. }: Hand) -> Self {
        let step = metres(step_mm);
        Self::new(
            "hand",
            format!("no place for the hand {least} to {most} steps of {step} m from the mark"),
            "hands begin at most 6 steps ahead of the mark, 5 aside and 5 above: another `step`, `least` or `most`",
        )
    }

    pub(super) fn overlap(mirror: usize) -> Self {
        let what = "a mirror that overlaps another one on its wall".to_owned();
        Self { mirror: Some(mirror), ..Self::new("mirror", what, "use a smaller `width`, or another `wall`") }
    }
}

/// The reason why an experiment does not fit into a room; `None` if it fits.
pub fn crowded(config: &WorldConfig, experiment: &Experiment) -> Option<DoesNotFit> {
    let world = config.for_experiment(experiment);
    if let Some(found) = experiment.panes.iter().enumerate().find_map(|(at, pane)| too_large(&world, at, pane)) {
        return Some(found);
    }
    let scenes = study().map(|(seed, run)| Scene::draw(config, experiment.clone(), seed, run));
    match scenes.collect::<Result<Vec<Scene>, _>>() {
        Ok(scenes) => too_short(&world, &scenes).or_else(|| mirror_at_start(&world, &scenes)),
        Err(Crowded { seed, run, why, .. }) => {
            Some(DoesNotFit { what: format!("{}, of seed {seed} and run {run}", why.what), ..why })
        }
    }
}

fn too_large(world: &WorldConfig, mirror: usize, pane: &Pane) -> Option<DoesNotFit> {
    /// Less than lengths in files differ by, m.
    const ROUNDING: f64 = 1e-6;
    let (wall, ceiling) = (world.room.size, world.room.height);
    let widest = wall - 2.0 * world.placement.wall_margin;
    let [width, height] = [(pane.width_mm, world.mirror.width), (pane.height_mm, world.mirror.height)]
        .map(|(own, worlds)| own.map_or(worlds, metres));
    let bottom = pane.bottom_mm.map_or(0.0, metres);
    let (what, key) = if width > widest {
        (format!("a mirror of {width} m does not fit onto a wall of {wall} m; at most {widest} m fit"), "size")
    } else if bottom + height > ceiling + ROUNDING {
        let place = format!("from {bottom} m above the floor");
        (format!("a mirror of {height} m {place} does not fit below a ceiling of {ceiling} m"), "height")
    } else {
        return None;
    };
    let help = format!("use a smaller mirror, or a larger `room.{key}` in the world's configuration");
    Some(DoesNotFit { mirror: Some(mirror), ..DoesNotFit::new("mirror", what, help) })
}

fn too_short(world: &WorldConfig, scenes: &[Scene]) -> Option<DoesNotFit> {
    let ways = Ways::of(world, scenes).filter(Ways::are_too_long)?;
    let what = format!("the shortest way takes {}", ways.described());
    Some(DoesNotFit::new("steps", what, format!("use `steps = {}` or more", ways.longest())))
}

/// The fault of a view that shows the mirror at the start, although the agent should have to look for it.
fn mirror_at_start(world: &WorldConfig, scenes: &[Scene]) -> Option<DoesNotFit> {
    let is_hidden = |scene: &&Scene| scene.experiment.layout.start == Start::FacingAway && !scene.panes.is_empty();
    let seen = scenes.iter().filter(is_hidden).filter(|scene| is_in_view(world, scene.mirror, scene.start)).count();
    let what = format!("the mirror is in view at the start of {seen} of {} scenes", scenes.len());
    let help = "use a narrower `view`, or scenes with `start = \"any\"`";
    (seen > 0).then(|| DoesNotFit::new("view", what, help))
}

//! The steps of the shortest way through a scene.

use std::collections::BTreeSet;

use super::super::config::WorldConfig;
use super::super::scene::Scene;
use super::{reach, study};
use mirrorstats_experiment::Experiment;
use mirrorstats_experiment::angle::Heading;

/// The shortest ways in the scenes of a study.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ways {
    /// Steps with `done`, by scene; `None` without a way.
    steps: Vec<Option<u32>>,
    /// The steps of an episode.
    budget: u32,
}

impl Ways {
    /// The ways in a study's scenes; `None` if the body stands still, or if a scene has no room.
    pub fn measured(config: &WorldConfig, experiment: &Experiment) -> Option<Self> {
        let scenes = study().map(|(seed, run)| Scene::draw(config, experiment.clone(), seed, run).ok());
        Self::of(&config.for_experiment(experiment), &scenes.collect::<Option<Vec<Scene>>>()?)
    }

    pub(super) fn of(world: &WorldConfig, scenes: &[Scene]) -> Option<Self> {
        let is_walk = scenes.iter().all(|scene| scene.hand.is_none());
        let steps = scenes.iter().map(|scene| shortest(world, scene));
        is_walk.then(|| Self { steps: steps.collect(), budget: world.episode.steps })
    }

    /// Returns true if scenes can be solved, but none within the steps of an episode. A mirror in which nothing of the own
    /// body shows is no fault: it may be a control.
    pub(super) fn are_too_long(&self) -> bool {
        let mut steps = self.steps.iter().flatten().peekable();
        steps.peek().is_some() && steps.all(|steps| *steps > self.budget)
    }

    pub(super) fn longest(&self) -> u32 {
        self.steps.iter().flatten().copied().max().unwrap_or_default()
    }

    /// The ways in words; scenes that are too long last.
    pub fn described(&self) -> String {
        let Some(least) = self.steps.iter().flatten().min() else {
            return format!("none in {} scenes: no place shows the own body in a mirror", self.steps.len());
        };
        let longest = self.longest();
        let (all, budget) = (self.steps.len(), self.budget);
        let too_long = self.steps.iter().filter(|steps| steps.is_none_or(|steps| steps > budget)).count();
        format!("{least} to {longest} steps in {all} scenes; {too_long} of them need more than {budget}")
    }
}

/// The steps to a place with a clear reflection, then to the candidate of the body's colour, then `done`. Without a
/// mirror or a candidate there is no such part. A pane that is not there yet is waited for. A way follows the lines of a
/// lattice and has quarter turns, so that a player who knows the room needs no more steps.
fn shortest(config: &WorldConfig, scene: &Scene) -> Option<u32> {
    let (plan, start, length) = (scene.floor_plan(config), scene.start, config.body.step_length);
    let spot = |[x, y]: [i32; 2]| [start.x + length * f64::from(x), start.y + length * f64::from(y)];
    let target = scene.candidates().iter().find(|cube| cube.color == scene.body_color);
    let is_near = |at| target.is_none_or(|cube| cube.square().distance(spot(at)) <= plan.radius + length);
    // Where nothing shows the own body, a look at what is there instead counts.
    let shows_self = scene.panes.iter().any(|pane| pane.double.is_none());
    let panes = || scene.panes.iter().filter(|pane| pane.double.is_none() == shows_self);
    let looks = |steps: u32, at, heading| {
        let faced = panes().filter(|pane| pane.place.heading() == heading).filter(|pane| {
            // The view after `steps` steps is that of step `steps` + 1.
            steps < pane.until_t.unwrap_or(u32::MAX) && reach::is_clear(config, scene, pane, spot(at))
        });
        faced.map(|pane| steps.max(pane.from_t.unwrap_or(1) - 1)).min()
    };
    let first = [0, 3, 6, 9].map(Heading::new).map(|heading| (start.heading.turns_to(heading).unsigned_abs(), heading));
    let is_blind = scene.panes.is_empty();
    let mut queue: BTreeSet<_> = first.into_iter().map(|(steps, heading)| (steps, [0, 0], heading, is_blind)).collect();
    let mut done = BTreeSet::new();
    while let Some((steps, at, heading, has_seen)) = queue.pop_first() {
        if has_seen && is_near(at) {
            return Some(steps + 1);
        }
        if done.insert((at, heading, has_seen)) {
            let seen = if has_seen { None } else { looks(steps, at, heading) };
            queue.extend(seen.map(|steps| (steps, at, heading, true)));
            let [x, y] = [[1, 0], [0, 1], [-1, 0], [0, -1]][usize::from(heading.thirties() / 3)];
            let moved = [1, -1].map(|way| [at[0] + way * x, at[1] + way * y]).into_iter();
            let passable = moved.filter(|to| plan.is_passable(spot(at), spot(*to)));
            queue.extend(passable.map(|to| (steps + 1, to, heading, has_seen)));
            queue.extend([3, -3].map(|turn| (steps + 3, at, heading.turned(turn), has_seen)));
        }
    }
    None
}

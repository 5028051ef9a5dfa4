//! Turns an outline into an episode, step by step.

use mirrorstats_trace::episodes::episode::{Action, Episode, Extra, Step};

use super::attribution::{self, UNKNOWN};
use super::generator::Generator;
use super::outline::{Outcome, Outline};
use super::published::Pair;
use super::scene::Scene;
use super::{files, gaze};

/// The value for an agent that has not chosen a cube.
const NONE: &str = "none";
/// One in this many replies is lost: no action, no colour, no cube.
const LOST: usize = 80;

/// The episode of a pair with this seed and run.
pub fn build(pair: &Pair, seed: i32, run: i32, outline: &Outline) -> Episode {
    let episode_id = format!("{}/{}/s{seed}/r{run}", pair.experiment, files::slug(&pair.model));
    let scene = Scene::of(&pair.experiment, seed, run);
    let steps = steps(&pair.experiment, outline, &scene, &mut Generator::of(&format!("steps of {episode_id}")));
    Episode {
        episode_id,
        model: pair.model.clone(),
        experiment: pair.experiment.clone(),
        seed,
        run,
        body_color: scene.body.to_owned(),
        stated_color: scene.stated.map(str::to_owned),
        distractors: scene.distractors,
        steps,
        ..Episode::default()
    }
}

fn steps(experiment: &str, outline: &Outline, scene: &Scene, generator: &mut Generator) -> Vec<Step> {
    let visible = gaze::visible(outline, generator);
    let sight = visible.iter().position(|&seen| seen).map(|at| at + 1);
    let changes = attribution::changes(experiment, outline, scene, sight, generator);
    let cubes = experiment != "E5";
    let mut color = UNKNOWN;
    let mut course = Action::MoveForward;
    let mut steps = Vec::with_capacity(outline.length);
    for t in 1..outline.length {
        let change = changes.iter().rev().find(|change| change.t == t);
        color = change.map_or(color, |change| change.color);
        course = next_action(course, visible[t - 1], generator);
        let lost = change.is_none() && generator.chance(1, LOST);
        steps.push(Step {
            action: (!lost).then_some(course),
            self_color: (!lost).then(|| color.to_owned()),
            selected_cube: (cubes && !lost).then(|| NONE.to_owned()),
            mirror_visible: visible[t - 1],
            extra: Extra::default(),
        });
    }
    let last = attribution::final_color(experiment, outline, scene, color, generator);
    let seen = visible[outline.length - 1];
    steps.push(Step {
        action: Some(if outline.outcome == Outcome::Unfinished {
            next_action(course, seen, generator)
        } else {
            Action::Done
        }),
        self_color: Some(last.to_owned()),
        selected_cube: cubes.then(|| chosen_cube(outline.outcome, scene, last, generator).to_owned()),
        mirror_visible: seen,
        extra: Extra::default(),
    });
    steps
}

/// The cube chosen at the last step. A wrong choice follows a wrong belief if there is a cube of that colour.
fn chosen_cube(outcome: Outcome, scene: &Scene, believed: &str, generator: &mut Generator) -> &'static str {
    match outcome {
        Outcome::Unfinished => NONE,
        Outcome::Success => scene.body,
        Outcome::Failure => {
            let followed = scene.decoys.into_iter().find(|&decoy| decoy == believed);
            followed.unwrap_or_else(|| generator.pick(&scene.decoys))
        }
    }
}

/// Agents usually keep their course. They turn and back off more often in front of a mirror.
fn next_action(course: Action, seen: bool, generator: &mut Generator) -> Action {
    use Action::{MoveBackward, MoveForward, TurnLeft, TurnRight};
    if generator.chance(3, 5) {
        return course;
    }
    let choices: &[Action] = if seen {
        &[MoveForward, MoveBackward, TurnLeft, TurnRight]
    } else {
        &[MoveForward, MoveForward, MoveForward, MoveBackward, TurnLeft, TurnLeft, TurnRight, TurnRight]
    };
    generator.pick(choices)
}

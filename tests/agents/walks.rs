//! Whole episodes in painted rooms.

use mirrorstats_agents::perception::camera::{Place, Viewpoint};
use mirrorstats_agents::scripted::Scripted;
use mirrorstats_agents::{Reply, Task};
use mirrorstats_experiment::Experiment;
use mirrorstats_trace::episodes::episode::Action;
use mirrorstats_trace::schema::colors::Color;

use crate::painted::{Painted, pose, task};

const GREEN: Place = Place { x: -1.0, y: -2.5 };

fn room() -> Painted {
    let at = |x, y| Place { x, y };
    let cubes = vec![(Color::Red, at(-2.5, 2.0)), (Color::Green, GREEN), (Color::Blue, at(1.5, 2.4))];
    Painted { own: Color::Green, has_mirror: true, cubes, others: Vec::new() }
}

fn start() -> Viewpoint {
    pose(0.0, 2.8, 90.0)
}

fn claims(replies: &[Reply]) -> Vec<&str> {
    let mut claims: Vec<&str> = replies.iter().filter_map(|reply| reply.self_color.as_deref()).collect();
    claims.dedup();
    claims
}

#[test]
fn the_oracle_finds_itself_and_walks_to_its_cube() {
    let (replies, place) = room().play(Scripted::Oracle, &task(Experiment::E1, 1), start());
    let last = replies.last().unwrap();
    assert_eq!((last.action, last.selected_cube.as_deref()), (Some(Action::Done), Some("green")));
    assert_eq!(claims(&replies), ["unknown", "green"]);
    assert!(place.distance(GREEN) < 1.1, "{place:?}");
}

#[test]
fn the_gullible_walks_to_the_stated_cube() {
    let task = Task { stated_color: Some("blue".to_owned()), ..task(Experiment::E1, 1) };
    let (replies, _) = room().play(Scripted::Gullible, &task, pose(-1.0, 0.5, 60.0));
    assert_eq!(replies.last().unwrap().selected_cube.as_deref(), Some("blue"));
    assert_eq!(claims(&replies), ["blue"]);
}

#[test]
fn the_guesser_takes_what_it_sees() {
    let mut taken: Vec<String> = (0..12)
        .map(|seed| room().play(Scripted::Guesser, &task(Experiment::E1, seed), pose(3.3, 1.0, 180.0)).0)
        .map(|replies| replies.last().unwrap().selected_cube.clone().unwrap())
        .collect();
    taken.sort();
    taken.dedup();
    assert_eq!(taken, ["blue", "green", "red"]);
}

#[test]
fn frozen_stands_still_and_random_varies_with_the_seed() {
    let short = Task { step_budget: 5, ..task(Experiment::E5, 3) };
    let (replies, place) = room().play(Scripted::Frozen, &short, start());
    assert!(replies.iter().all(|reply| reply.action.is_none() && reply.self_color.as_deref() == Some("unknown")));
    assert_eq!((replies.len(), place), (5, start().place));

    let play = |seed| room().play(Scripted::Random, &task(Experiment::E1, seed), start()).0;
    assert_eq!(play(1), play(1));
    assert!((2..9).any(|seed| play(seed) != play(1)));
}

#[test]
fn the_budget_ends_with_a_decision() {
    let short = Task { step_budget: 2, ..task(Experiment::E1, 5) };
    for agent in [Scripted::Oracle, Scripted::Guesser, Scripted::Mimic] {
        let (replies, _) = room().play(agent, &short, start());
        assert_eq!(replies.last().unwrap().action, Some(Action::Done), "{}", agent.name());
    }
}

//! A trace with one altered value diverges from its replay at that value.

use mirrorstats_trace::episodes::episode::{Action, Episode};
use serde_json::Value;

use super::traces::{copy, recorded, replay};
use crate::harness::program::{stderr, stdout};
use crate::harness::traces::episodes;

/// Checks that the replay diverges from the altered trace at this step of its longest episode, in this column, and in
/// no other episode.
fn check(experiment: &str, change: impl FnOnce(&mut Episode), t: i32, column: &str) -> (String, String) {
    let mut id = String::new();
    let (_folder, path) = copy(experiment, |episodes, _| {
        let longest = episodes.iter_mut().max_by_key(|episode| episode.steps.len()).unwrap();
        id.clone_from(&longest.episode_id);
        change(longest);
    });
    let output = replay(&path, &["--json"]);
    assert_eq!(output.status.code(), Some(1), "{column}");
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    let divergences = answer["divergences"].as_array().unwrap();
    assert_eq!(divergences.len(), 1, "{answer}");
    let parted = &divergences[0];
    assert_eq!(parted["episode_id"], id, "{column}");
    assert_eq!((&parted["t"], &parted["column"]), (&t.into(), &column.into()), "{answer}");
    let text = |key: &str| parted[key].as_str().unwrap().to_owned();
    // The same in the text output.
    let words = stdout(&replay(&path, &[]));
    let expected = format!("{id}, t = {t}: {column}: recorded {}, replayed {}\n", text("expected"), text("found"));
    assert!(words.starts_with(&expected) && words.contains("1 of the episodes parts"), "{words}");
    (text("expected"), text("found"))
}

#[test]
fn an_altered_count_is_reported() {
    for (column, of) in [("mirror_self_px", 0), ("mirror_other_px", 1), ("mirror_px", 2), ("direct_other_px", 3)] {
        let change = |episode: &mut Episode| {
            let extra = &mut episode.steps[1].extra;
            let counts = [
                &mut extra.mirror_self_px,
                &mut extra.mirror_other_px,
                &mut extra.mirror_px,
                &mut extra.direct_other_px,
            ];
            *counts.into_iter().nth(of).unwrap().as_mut().unwrap() += 1;
        };
        let (expected, found) = check("E4", change, 2, column);
        assert_eq!(expected.parse::<i32>().unwrap(), found.parse::<i32>().unwrap() + 1);
    }
}

#[test]
fn an_altered_pose_is_reported() {
    let nudged = |value: &mut Option<f32>| *value = value.map(f32::next_up);
    check("E1", |episode| nudged(&mut episode.steps[2].extra.pose_x), 3, "pose_x");
    check("E1", |episode| nudged(&mut episode.steps[0].extra.pose_y), 1, "pose_y");
    check("E4", |episode| nudged(&mut episode.steps[1].extra.pose_yaw), 2, "pose_yaw");
}

#[test]
fn an_altered_distance_is_reported() {
    let further = |episode: &mut Episode| {
        let distances = episode.steps.iter_mut().map(|step| &mut step.extra.cube_distance);
        let known = distances.flatten().next().unwrap();
        *known += 0.5;
    };
    let at = |experiment: &str| {
        let episodes = episodes(&recorded(experiment));
        let longest = episodes.into_iter().max_by_key(|episode| episode.steps.len()).unwrap();
        let known = longest.steps.iter().position(|step| step.extra.cube_distance.is_some()).unwrap();
        i32::try_from(known + 1).unwrap()
    };
    let (expected, found) = check("E4", further, at("E4"), "cube_distance");
    assert!((expected.parse::<f32>().unwrap() - found.parse::<f32>().unwrap() - 0.5).abs() < 1e-5);
}

#[test]
fn an_altered_truth_is_reported() {
    let (expected, found) = check("E1", |episode| episode.steps[3].mirror_visible ^= true, 4, "mirror_visible");
    assert_ne!(expected, found);
    let bump = |episode: &mut Episode| episode.steps[0].extra.bumped = Some(true);
    assert_eq!(check("E1", bump, 1, "bumped"), ("true".to_owned(), "false".to_owned()));
}

#[test]
fn an_altered_action_is_reported_at_the_next_step() {
    let turn = |episode: &mut Episode| {
        let action = &mut episode.steps[0].action;
        let turned = if *action == Some(Action::TurnLeft) { Action::TurnRight } else { Action::TurnLeft };
        *action = Some(turned);
    };
    check("E1", turn, 2, "pose_yaw");
}

#[test]
fn altered_episode_constants_are_reported_at_step_0() {
    let other = |color: &str| if color == "red" { "blue".to_owned() } else { "red".to_owned() };
    check("E1", |episode| episode.body_color = other(&episode.body_color), 0, "body_color");
    check("E3", |episode| episode.stated_color = None, 0, "stated_color");
    check("decoy", |episode| episode.shown_color = episode.shown_color.as_deref().map(other), 0, "shown_color");
    check("E4", |episode| episode.distractors = episode.distractors.map(|count| count % 6 + 1), 0, "distractors");
}

#[test]
fn the_first_difference_of_each_episode_is_printed() {
    let (_folder, path) = copy("E1", |episodes, _| {
        for episode in episodes.iter_mut().take(2) {
            for step in &mut episode.steps {
                step.extra.mirror_px = step.extra.mirror_px.map(|count| count + 7);
            }
        }
    });
    let output = replay(&path, &["--json"]);
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    let places: Vec<_> = answer["divergences"]
        .as_array()
        .unwrap()
        .iter()
        .map(|parted| (parted["episode_id"].as_str().unwrap(), parted["t"].as_i64().unwrap()))
        .collect();
    assert_eq!(places, [("E1/random/s1/r1", 1), ("E1/random/s1/r2", 1)]);
}

#[test]
fn an_unknown_experiment_is_reported() {
    let (_folder, path) = copy("E1", |episodes, _| episodes[0].experiment = "E9".to_owned());
    let output = replay(&path, &[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("E9"), "{}", stderr(&output));
}

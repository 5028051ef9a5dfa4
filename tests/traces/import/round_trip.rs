//! Traces as JSON lines and back keep every value and every score.

use std::fs;

use mirrorstats_trace::episodes::episode::{Action, Episode, Extra, Step};
use mirrorstats_trace::write::write_episodes;
use serde_json::{Map, Value, json};

use super::{lines, run, scores};
use crate::harness::files::fixture;
use crate::harness::traces::{self, episodes};

/// The rows of an episode as a harness would write them; optional keys only if there is a value.
fn exported(episode: &Episode) -> Vec<Value> {
    let rows = episode.steps.iter().zip(1..).map(|(step, t)| {
        let mut row = Map::new();
        let mut put = |key: &str, value: Value, required: bool| {
            if required || !value.is_null() {
                row.insert(key.to_owned(), value);
            }
        };
        put("episode_id", json!(episode.episode_id), true);
        put("model", json!(episode.model), true);
        put("experiment", json!(episode.experiment), true);
        put("seed", json!(episode.seed), true);
        put("run", json!(episode.run), true);
        put("body_color", json!(episode.body_color), true);
        put("t", json!(t), true);
        put("action", json!(step.action.map(Action::name)), true);
        put("self_color", json!(step.self_color), true);
        put("selected_cube", json!(step.selected_cube), true);
        put("mirror_visible", json!(step.mirror_visible), true);
        put("stated_color", json!(episode.stated_color), false);
        put("distractors", json!(episode.distractors), false);
        macro_rules! extras {
            ($($field:ident),+) => { $(put(stringify!($field), json!(step.extra.$field), false);)+ };
        }
        extras!(mirror_self_px, mirror_other_px, mirror_px, direct_other_px, pose_x, pose_y, pose_yaw, bumped);
        extras!(cube_distance, reply_status, view_description, reasoning, summary, identification, reply);
        extras!(latency_ms, prompt_tokens, completion_tokens, cost_usd, frame_time);
        Value::Object(row)
    });
    rows.collect()
}

#[test]
fn the_traces_of_the_paper_round_trip() {
    let fixtures = fixture("paper");
    let mut traces: Vec<_> = fs::read_dir(&fixtures).unwrap().map(|entry| entry.unwrap().path()).collect();
    traces.retain(|path| path.extension().is_some_and(|ending| ending == "parquet"));
    traces.sort();
    let rows: Vec<Value> = traces.iter().flat_map(|path| episodes(path)).flat_map(|one| exported(&one)).collect();
    let folder = tempfile::tempdir().unwrap();
    let answer = run(folder.path(), &["import", "-", "-o", "back.parquet"], lines(&rows));
    assert_eq!(answer.code, 0, "{}", answer.stderr);
    assert!(answer.stdout.starts_with("imported 840 episodes, "), "{}", answer.stdout);
    assert_eq!(scores(folder.path(), "back.parquet"), scores(folder.path(), fixtures.to_str().unwrap()));
}

#[test]
fn every_value_of_every_column_round_trips() {
    let extra = Extra {
        mirror_self_px: Some(i32::MAX),
        pose_x: Some(0.1),
        pose_y: Some(f32::MIN_POSITIVE),
        pose_yaw: Some(-330.0),
        bumped: Some(true),
        reply_status: Some("truncated".into()),
        view_description: Some("a \"mirror\"\n\u{2028}\u{1F916}".into()),
        reply: Some(String::new()),
        latency_ms: Some(0),
        cost_usd: Some(0.1 + 0.2),
        frame_time: Some(i64::MAX),
        ..Extra::default()
    };
    let bare = Step { mirror_visible: true, ..Step::default() };
    let full = Step {
        action: Some(Action::Done),
        self_color: Some("unknown".into()),
        selected_cube: None,
        mirror_visible: false,
        extra,
    };
    let episode = |id: &str, steps: Vec<Step>| Episode {
        experiment: "E3".into(),
        stated_color: Some("blue".into()),
        ..traces::episode(id, steps)
    };
    let original = [episode("é", vec![bare.clone(), full.clone()]), episode("b", vec![full, bare])];
    let folder = tempfile::tempdir().unwrap();
    let rows: Vec<Value> = original.iter().flat_map(exported).collect();
    assert_eq!(run(folder.path(), &["import", "-", "-o", "x.parquet"], lines(&rows)).code, 0);
    assert_eq!(episodes(&folder.path().join("x.parquet")), original);
    let direct = folder.path().join("direct.parquet");
    write_episodes(&direct, None, &original).unwrap();
    assert_eq!(scores(folder.path(), "x.parquet"), scores(folder.path(), "direct.parquet"));
}

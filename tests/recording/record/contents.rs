//! The contents of a recording: consistent rows, metadata, and a report.

use arrow::array::{Array, AsArray, BooleanArray, RecordBatch};
use arrow::datatypes::{Float32Type, Int32Type, Int64Type};
use mirrorstats_trace::episodes::episode::Step;
use mirrorstats_trace::schema::COLUMNS;
use serde_json::{Value, json};

use super::recordings::Bench;
use crate::harness::files::{Contents, fixture, write_small_world};
use crate::harness::need;
use crate::harness::program::{run, succeeds};
use crate::harness::traces::{column, episodes, recording, rows};

/// The rows and metadata of a trace.
fn read(bench: &Bench, name: &str) -> (RecordBatch, Value) {
    (rows(&bench.path(name)), recording(&bench.path(name)))
}

#[test]
fn rows_follow_from_one_another() {
    let bench = Bench::new();
    // With long steps even a short walk reaches a wall.
    write_small_world(bench.folder.path(), "body.step_length = 1.0\n");
    bench.recorded("runs", "--agent random --experiment E4 --seeds 3 --runs 6 --no-log");
    let (rows, _) = read(&bench, "runs/E4-random.parquet");
    let names: Vec<String> = rows.schema().fields().iter().map(|field| field.name().clone()).collect();
    // Columns of other tasks and agents are absent.
    let known: Vec<&str> =
        COLUMNS.iter().map(|column| column.name).filter(|name| names.iter().any(|n| n == name)).collect();
    assert_eq!(names, known);
    let left_out: Vec<&str> = COLUMNS.iter().map(|column| column.name).filter(|name| !known.contains(name)).collect();
    let expected = [
        "participant",
        "start_distance",
        "unreadable_answers",
        "shown_color",
        "reply_repair",
        "reply_fault",
        "frame_digest",
        "mark_color",
        "mark_report",
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
        "target_distance",
        "answer",
        "answer_truth",
    ];
    assert_eq!(left_out, expected);
    let floats = |name: &str| column(&rows, name).as_primitive::<Float32Type>().values().to_vec();
    let [x, y, yaw] = ["pose_x", "pose_y", "pose_yaw"].map(floats);
    let t = column(&rows, "t").as_primitive::<Int32Type>().values().to_vec();
    let (actions, bumped) = (column(&rows, "action"), column(&rows, "bumped"));
    let (actions, bumped): (_, &BooleanArray) = (actions.as_string::<i32>(), bumped.as_boolean());
    let (mut steps, mut turns, mut bumps) = (0, 0, 0);
    for row in (0..rows.num_rows() - 1).filter(|row| t[row + 1] == t[*row] + 1) {
        let moved = f32::hypot(x[row + 1] - x[row], y[row + 1] - y[row]);
        let turned = (yaw[row + 1] - yaw[row]).rem_euclid(360.0);
        let expected = match (actions.value(row), bumped.value(row)) {
            ("move_forward" | "move_backward", false) => (1.0, 0.0),
            ("turn_left", false) => (0.0, 30.0),
            ("turn_right", false) => (0.0, 330.0),
            ("move_forward" | "move_backward", true) => (0.0, 0.0),
            (action, bumped) => panic!("row {row}: {action}, bumped: {bumped}"),
        };
        assert!((moved - expected.0).abs() < 1e-5 && (turned - expected.1).abs() < 1e-3, "row {row}: {moved} {turned}");
        steps += usize::from(expected.0 > 0.0);
        turns += usize::from(expected.1 > 0.0);
        bumps += usize::from(bumped.value(row));
    }
    assert!(steps > 0 && turns > 0 && bumps > 0, "{steps} steps, {turns} turns, {bumps} bumps");
}

#[test]
fn ground_truth_follows_from_the_counts() {
    let bench = Bench::new();
    write_small_world(bench.folder.path(), "evidence.mirror_self_px = 2\n");
    let words = "--agent random --experiment E1..E3 --seeds 1 --runs 4 --no-log";
    bench.recorded("runs", words);
    let mut visible = 0;
    for (experiment, has_mirror) in [("E1", true), ("E2", false), ("E3", true)] {
        let (rows, _) = read(&bench, &format!("runs/{experiment}-random.parquet"));
        let count = |name: &str| column(&rows, name).as_primitive::<Int32Type>().values().to_vec();
        let (own, mirror) = (count("mirror_self_px"), count("mirror_px"));
        let seen = column(&rows, "mirror_visible");
        for (row, (own, mirror)) in own.iter().zip(&mirror).enumerate() {
            assert_eq!(seen.as_boolean().value(row), *own >= 2, "row {row}");
            assert!(own <= mirror && (has_mirror || *mirror == 0), "row {row}: {own} of {mirror}");
            visible += usize::from(*own >= 2);
        }
        let stated = column(&rows, "stated_color");
        let body = column(&rows, "body_color");
        for row in 0..rows.num_rows() {
            assert_eq!(stated.is_valid(row), experiment == "E3");
            assert!(stated.is_null(row) || stated.as_string::<i32>().value(row) != body.as_string::<i32>().value(row));
        }
        let times = column(&rows, "frame_time").as_primitive::<Int64Type>().values().to_vec();
        assert!(times.is_sorted_by(|a, b| a < b), "a place of its own on the time line for each step");
    }
    assert!(visible > 0);
}

#[test]
fn the_color_that_a_pane_shows_is_another_candidate_and_is_in_the_trace() {
    let bench = Bench::new();
    bench.recorded("runs", "--agent random --experiment delayed,decoy,window --seeds 2 --runs 3 --no-log");
    for experiment in ["decoy", "window"] {
        let (rows, _) = read(&bench, &format!("runs/{experiment}-random.parquet"));
        let [shown, body] = ["shown_color", "body_color"].map(|name| column(&rows, name).as_string::<i32>().clone());
        assert_eq!(shown.null_count(), 0, "{experiment}");
        assert!((0..rows.num_rows()).all(|row| shown.value(row) != body.value(row)), "{experiment}");
    }
    let (rows, _) = read(&bench, "runs/delayed-random.parquet");
    assert!(rows.schema().column_with_name("shown_color").is_none(), "a late mirror shows one's own colour");
    // A report on traces with and without the columns.
    let table = run(bench.folder.path(), &["report", "runs", "--definitions", "battery", "--out", "report"]).done();
    assert!(table.contains("A mirror that is late"), "{table}");
    let cells = std::fs::read_to_string(bench.path("report/cells.csv")).unwrap();
    // A pane counts only for episodes that had it in view.
    let count = |experiment: &str, is_in_view: fn(&Step) -> bool| {
        let all = episodes(&bench.path(&format!("runs/{experiment}-random.parquet")));
        all.iter().filter(|episode| episode.steps.iter().any(is_in_view)).count()
    };
    let decoys = count("decoy", |step| step.extra.shown_px.unwrap() >= 60);
    let windows = count("window", |step| step.extra.shown_px.unwrap() >= 60);
    for cell in [
        format!("decoy,random,DECOY_CLAIM,{decoys},"),
        format!("window,random,WINDOW_CLAIM,{windows},"),
        "delayed,random,DECOY_CLAIM,0,".to_owned(),
    ] {
        assert!(cells.contains(&cell), "{cell} in {cells}");
    }
    let decoy = episodes(&bench.path("runs/decoy-random.parquet"));
    assert!(decoy.iter().flat_map(|episode| &episode.steps).all(|step| step.extra.mirror_double_px.is_none()));
}

/// A mirror, a decoy opposite, and two marks on the own body.
const TWO_OF_EACH: &str = r#"
[experiment.two-of-each]
title = "Two of each"
prompt = "mark"
decision = "mark_report"
cubes = { kind = "none" }
others = { least = 0, most = 0 }
start = "before_mirror"
mirror = [{ kind = "mirror" }, { kind = "decoy", color = "other", wall = "opposite" }]
mark = [{ part = "face" }, { part = "chest", from_t = 3 }]
"#;

#[test]
fn several_panes_and_marks_are_counted_each() {
    let bench = Bench::new();
    std::fs::write(bench.path("two.toml"), TWO_OF_EACH).unwrap();
    bench.recorded("runs", "--agent random --experiment two.toml --seeds 2 --runs 4 --no-log");
    let all = episodes(&bench.path("runs/two-of-each-random.parquet"));
    let (mut in_both, mut marked) = (0, 0);
    for step in all.iter().flat_map(|episode| &episode.steps) {
        let extra = &step.extra;
        let [own, double] = [extra.mirror_self_px, extra.mirror_double_px];
        let [mirror, decoy] = [extra.pane1_body_px, extra.pane2_body_px].map(Option::unwrap);
        assert_eq!((mirror + decoy, double), (own.unwrap(), None));
        assert_eq!((extra.shown_px, extra.pane3_body_px, extra.mark3_px), (Some(decoy), None, None));
        let marks = [extra.mark1_px, extra.mark2_px].map(Option::unwrap);
        assert_eq!(marks[0] + marks[1], extra.mirror_mark_px.unwrap());
        in_both += i32::from(mirror > 0) + i32::from(decoy > 0);
        marked += marks[0];
    }
    assert!(in_both > 1 && marked > 0, "{in_both} {marked}");
    let replayed = run(bench.folder.path(), &["world", "replay", "runs/two-of-each-random.parquet"]).done();
    assert!(!replayed.contains("diverge"), "{replayed}");
}

#[test]
fn the_shape_of_bodies_is_on_record_and_replayed() {
    let bench = Bench::new();
    let shaped = |shape: &str| {
        write_small_world(bench.folder.path(), &format!("body.shape = \"{shape}\"\n"));
        bench.recorded(shape, "--agent random --experiment E1 --seeds 1 --runs 3 --no-log");
        let (rows, recording) = read(&bench, &format!("{shape}/E1-random.parquet"));
        let fingerprints = column(&rows, "fingerprint").as_string::<i32>().value(0).to_owned();
        let scenes = column(&rows, "scene").as_string::<i32>().value(0).to_owned();
        run(bench.folder.path(), &["world", "replay", &format!("{shape}/E1-random.parquet")]).done();
        (fingerprints, scenes, recording["world"]["body"]["shape"].clone())
    };
    let [mannequin, humanoid] = ["mannequin", "humanoid"].map(shaped);
    // Recordings from before there were shapes have no such key; their bodies are mannequins.
    assert_eq!((mannequin.2, humanoid.2), (Value::Null, json!("humanoid")));
    assert_ne!(mannequin.0, humanoid.0);
    assert_eq!(mannequin.1, humanoid.1, "the same rooms: episodes are pairs");
}

#[test]
fn the_footer_has_all_that_replay_needs_and_nothing_of_the_machine() {
    let bench = Bench::new();
    bench.recorded("runs", "--agent random --experiment E1 --seeds 2 --runs 1");
    let (_, recording) = read(&bench, "runs/E1-random.parquet");
    assert_eq!(recording["version"], 3);
    assert_eq!(recording["experiment"]["name"], "E1");
    assert_eq!(recording["experiment"]["prompt_hash"].as_str().unwrap().len(), 64);
    assert_eq!(recording["reply_schema_hash"].as_str().unwrap().len(), 64);
    let colors = ["blue", "brown", "cyan", "green", "orange", "pink", "purple", "red", "white", "yellow"];
    assert_eq!(recording["palette"], json!(colors));
    assert_eq!(recording["view"], json!({ "width": 64, "height": 48, "fov_y": 110.0 }));
    assert_eq!(recording["visibility_threshold_px"], 60);
    assert_eq!(recording["agent"], json!({ "scripted": "random" }));
    assert_eq!(recording["seeds"], json!([1, 2]));
    assert_eq!(recording["world"]["episode"]["steps"], 100);
    assert_eq!(recording["world_hash"].as_str().unwrap().len(), 64);
    let here = bench.folder.path().to_str().unwrap().to_owned();
    for (name, bytes) in bench.files("runs") {
        assert!(!String::from_utf8_lossy(&bytes).contains(&here), "{name} holds the name of a folder");
    }
}

#[test]
fn a_recording_can_be_reported() {
    let bench = Bench::new();
    for agent in ["random", "frozen"] {
        bench.recorded("runs", &format!("--agent {agent} --experiment E1..E5 --seeds 1 --runs 2"));
    }
    let checked = run(bench.folder.path(), &["trace", "validate", "runs"]).done();
    assert!(checked.contains("0 errors, 0 notes"));
    let table = run(bench.folder.path(), &["report", "runs", "--out", "report"]).done();
    assert!(table.contains("frozen") && table.contains("random"), "{table}");
    let cells = std::fs::read_to_string(bench.path("report/cells.csv")).unwrap();
    // The frozen agent never decides, and without a mirror no agent consults one.
    assert!(cells.contains("E1,frozen,TSA,2,0,"), "{cells}");
    assert!(cells.contains("E2,random,MCR,2,0,"), "{cells}");
}

#[test]
fn agents_that_look_are_shown_frames() {
    let bench = Bench::new();
    need::drawing();
    succeeds(&mut bench.record_with_frames("runs", "--agent oracle --experiment E5 --seeds 1 --runs 1"));
    let with_frames = bench.files("runs");
    let count = |files: &Contents| files["E5-oracle.mcap"].len();
    // The agent sees frames, and decides the same, even if the log has no frames.
    let without = bench.recorded("without", "--agent oracle --experiment E5 --seeds 1 --runs 1");
    assert!(with_frames["E5-oracle.parquet"] == without["E5-oracle.parquet"]);
    assert!(count(&without) < count(&with_frames));
}

#[test]
fn recording_again_gives_the_bundled_recordings() {
    let bench = Bench::new();
    std::fs::write(bench.path("small.toml"), "body.shape = \"mannequin\"").unwrap();
    bench.recorded("runs", "--agent random --experiment E1..E5 --seeds 1 --runs 2 --no-log");
    bench.recorded("runs", "--agent frozen --experiment E1 --seeds 1 --runs 1 --no-log");
    for (name, bytes) in bench.files("runs") {
        assert!(
            std::fs::read(fixture("recorded").join(&name)).unwrap() == bytes,
            "{name} is not current; `make recorded` writes it"
        );
    }
}

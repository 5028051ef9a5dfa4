//! `validate`, `info` and `schema` at the process boundary, and the published format description.

use std::fs;
use std::path::Path;

use mirrorstats_trace::diagnostic::Code;
use mirrorstats_trace::episodes::episode::{Action, Episode, Extra, Step};
use mirrorstats_trace::schema::COLUMNS;
use mirrorstats_trace::write::write_episodes;
use serde_json::{Value, json};

use crate::harness::files::repository;
use crate::harness::program::{Answer, run_with_input};
use crate::harness::traces;

/// An episode with a value in every column of the schema.
fn episode(model: &str, experiment: &str, seed: i32, run: i32) -> Episode {
    let text = || Some("words".to_owned());
    let extra = Extra {
        mirror_self_px: Some(1),
        mirror_other_px: Some(2),
        mirror_px: Some(3),
        direct_other_px: Some(4),
        pose_x: Some(0.5),
        pose_y: Some(-0.5),
        pose_yaw: Some(90.0),
        bumped: Some(false),
        cube_distance: Some(1.0),
        reply_status: Some("ok".into()),
        reply_repair: Some("fence".into()),
        reply_fault: text(),
        view_description: text(),
        reasoning: text(),
        summary: text(),
        identification: text(),
        reply: text(),
        latency_ms: Some(12),
        prompt_tokens: Some(34),
        completion_tokens: Some(5),
        cost_usd: Some(0.001),
        frame_time: Some(1_700_000_000_000_000_000),
        frame_digest: text(),
        mirror_double_px: Some(0),
        mark_color: Some("pink".into()),
        mark_report: Some("none".into()),
        mirror_mark_px: Some(5),
        shown_px: Some(1),
        pane1_body_px: Some(2),
        pane2_body_px: Some(3),
        pane3_body_px: Some(4),
        pane4_body_px: Some(5),
        mark1_px: Some(6),
        mark2_px: Some(7),
        mark3_px: Some(8),
        mark4_px: Some(9),
        target_distance: Some(300),
        answer: Some("left".into()),
        answer_truth: Some("right".into()),
        answers: std::collections::BTreeMap::new(),
    };
    let step = Step {
        action: Some(Action::Done),
        self_color: Some("red".into()),
        selected_cube: None,
        mirror_visible: true,
        extra,
    };
    Episode {
        model: model.into(),
        experiment: experiment.into(),
        seed,
        run,
        stated_color: Some("blue".into()),
        distractors: Some(2),
        condition: Some("near".into()),
        scene: Some("5ce4e".into()),
        repetition: Some(1),
        decision: Some("selected_cube".into()),
        fingerprint: Some("f1".into()),
        participant: Some("p01".into()),
        episode_hash: Some("e4".into()),
        start_distance: Some(1200),
        shown_color: Some("green".into()),
        ..traces::episode(&format!("{experiment}-{model}-{seed}-{run}"), vec![step; 3])
    }
}

/// A folder with two files: models a and b, experiments E1 and E2, seeds 1 and 2, one run; b lacks E2 with seed 2.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("runs")).unwrap();
    let all = |model: &str, pairs: &[(&str, i32)]| -> Vec<Episode> {
        pairs.iter().map(|(experiment, seed)| episode(model, experiment, *seed, 1)).collect()
    };
    let recording = Some(json!({"view": [64, 48]}));
    let a = all("a", &[("E1", 1), ("E1", 2), ("E2", 1), ("E2", 2)]);
    write_episodes(&folder.path().join("runs/a.parquet"), recording, &a).unwrap();
    let b = all("b", &[("E1", 1), ("E1", 2), ("E2", 1)]);
    write_episodes(&folder.path().join("runs/b.parquet"), None, &b).unwrap();
    folder
}

/// Exit code, standard output and standard error.
fn run(folder: &Path, arguments: &[&str], input: &str) -> (i32, String, String) {
    let Answer { code, stdout, stderr } = run_with_input(folder, arguments, input);
    (code, stdout, stderr)
}

#[test]
fn written_traces_are_valid() {
    let folder = folder();
    for threads in ["1", "8"] {
        let (code, out, err) = run(folder.path(), &["trace", "validate", "runs", "--threads", threads], "");
        assert_eq!((code, err.as_str()), (0, ""), "{out}");
        assert_eq!(out, "2 files, 7 episodes, 21 steps checked: 0 errors, 0 notes\n");
    }
}

#[test]
fn every_way_to_name_the_files_gives_the_same() {
    let folder = folder();
    let reports: Vec<_> = [
        (&["runs"][..], ""),
        (&["runs/*.parquet"], ""),
        (&["runs/b.parquet", "./runs/a.parquet", "runs/../runs/b.parquet"], ""),
        (&["-"], "runs/b.parquet\nruns/a.parquet\n"),
    ]
    .into_iter()
    .map(|(traces, input)| run(folder.path(), &[&["trace", "info", "--json"], traces].concat(), input))
    .collect();
    assert_eq!(reports[0].0, 0);
    for report in &reports[1..] {
        let names = |text: &str| serde_json::from_str::<Value>(text).unwrap()["episodes"].clone();
        assert_eq!(names(&report.1), names(&reports[0].1));
        assert_eq!(report.1, reports[0].1);
    }
}

#[test]
fn info_counts_episodes_and_names_missing_seeds_and_runs() {
    let folder = folder();
    let (code, out, _) = run(folder.path(), &["trace", "info", "--json", "runs"], "");
    let info: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(code, 0);
    assert_eq!((&info["episodes"], &info["steps"]), (&json!(7), &json!(21)));
    assert_eq!(info["models"], json!(["a", "b"]));
    assert_eq!((&info["seeds"], &info["runs"]), (&json!([1, 2]), &json!([1])));
    let gaps: Vec<_> =
        info["coverage"].as_array().unwrap().iter().filter(|cell| cell["missing"] != json!([])).collect();
    let expected = json!({
        "experiment": "E2", "model": "b", "episodes": 1, "missing": [{"seed": 2, "run": 1}], "repeated": []
    });
    assert_eq!(gaps, [&expected]);
    let file = &info["files"][0];
    assert_eq!((&file["name"], &file["recording"]), (&json!("runs/a.parquet"), &json!({"view": [64, 48]})));
    assert_eq!(file["writer"], concat!("mirrorstats ", env!("CARGO_PKG_VERSION")));
    let (_, text, _) = run(folder.path(), &["trace", "info", "runs"], "");
    assert!(text.contains("E2, b: 2/1"), "{text}");
    assert!(!text.contains(&*folder.path().to_string_lossy()), "an absolute path: {text}");
}

#[test]
fn findings_are_bounded_for_people_and_whole_for_programs() {
    let folder = folder();
    let twice: Vec<_> = (1..=15).map(|run| episode("a", "E1", 1, run)).collect();
    for name in ["1.parquet", "2.parquet"] {
        write_episodes(&folder.path().join(name), None, &twice).unwrap();
    }
    let (code, out, _) = run(folder.path(), &["trace", "validate", "1.parquet", "2.parquet"], "");
    assert_eq!(code, 1);
    assert_eq!(out.matches("episode-in-two-files: 2.parquet, row group 0").count(), 10, "{out}");
    assert!(out.contains("episode-in-two-files: 2.parquet, and 5 more of these"), "{out}");
    let (code, out, _) = run(folder.path(), &["trace", "validate", "--json", "1.parquet", "2.parquet"], "");
    let report: Value = serde_json::from_str(&out).unwrap();
    assert_eq!((code, report["findings"].as_array().unwrap().len()), (1, 15));
}

#[test]
fn unreadable_files_are_bad_usage() {
    let folder = folder();
    for (arguments, why) in [
        (&["trace", "validate", "no.parquet"][..], "`no.parquet`: expected a trace file"),
        (&["trace", "info", "no*.parquet"], "found a glob that matches no trace"),
        (&["trace", "info", "-"], "found no line"),
        (&["trace", "validate"], "required arguments were not provided"),
        (&["trace", "info", "--threads", "0", "runs"], "invalid value '0'"),
    ] {
        let (code, out, err) = run(folder.path(), arguments, "");
        assert_eq!((code, out.as_str()), (2, ""), "{arguments:?}");
        assert!(err.contains(why), "{arguments:?}: {err}");
    }
    fs::write(folder.path().join("runs/c.parquet"), "").unwrap();
    let (code, _, err) = run(folder.path(), &["trace", "info", "runs"], "");
    assert_eq!(code, 2);
    assert!(err.starts_with("error: empty-file: runs/c.parquet\n  expected a Parquet file\n  found 0 bytes"), "{err}");
}

#[test]
fn schema_prints_every_column_and_rule() {
    let folder = tempfile::tempdir().unwrap();
    let (code, text, _) = run(folder.path(), &["trace", "schema"], "");
    assert_eq!(code, 0);
    for name in COLUMNS.iter().map(|column| column.name).chain(Code::ALL.map(Code::name)) {
        assert!(text.contains(name), "{name}");
    }
    assert!(text.lines().all(|line| line.chars().count() <= 110), "{text}");
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    for column in COLUMNS.iter() {
        let default = column.default.map(|default| format!(" No value means {default}.")).unwrap_or_default();
        let values = column.values.last().map(|value| format!("{value}.")).unwrap_or_default();
        let before = if values.is_empty() { column.doc } else { &values };
        assert!(words.contains(&format!("{before}{default}")), "{}", column.name);
    }
    let (_, printed, _) = run(folder.path(), &["trace", "schema", "--json"], "");
    assert_eq!(printed, kept("trace.schema.json"));
}

fn kept(name: &str) -> String {
    fs::read_to_string(repository().join("schemas").join(name)).unwrap()
}

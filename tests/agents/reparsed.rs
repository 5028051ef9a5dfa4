//! `rescore --reparse`: the current parser reads recorded replies again.

use std::fs;
use std::path::Path;

use mirrorstats_experiment::{Experiment, Spec};
use mirrorstats_trace::episodes::episode::{Action, Extra, Step};
use mirrorstats_trace::write::{OptionalColumns, TraceMetadata, TraceWriter};
use serde_json::{Value, json};

use crate::harness::program::run;
use crate::harness::traces;

/// A reply with this action, cube and identification.
fn said(action: &str, cube: &str, identification: &str) -> String {
    json!({
        "view-description": "a wall", "reasoning": "none", "action": action, "summary": "went on",
        "selected_cube": cube, "identification": identification,
    })
    .to_string()
}

/// A step as recorded by an earlier parser.
fn step(reply: Option<String>, status: &str, action: Option<Action>, self_color: Option<&str>) -> Step {
    let extra = Extra { reply, reply_status: Some(status.to_owned()), ..Extra::default() };
    let [self_color, selected_cube] = [self_color, action.map(|_| "none")].map(|name| name.map(str::to_owned));
    Step { action, self_color, selected_cube, mirror_visible: true, extra }
}

fn write(path: &Path, recording: Value, episodes: &[(&str, Vec<Step>)]) {
    let columns = OptionalColumns::recorded(&recording);
    let mut writer = TraceWriter::create(path, &TraceMetadata { recording: Some(recording), columns }).unwrap();
    for (id, steps) in episodes {
        writer.write(&traces::episode(id, steps.clone())).unwrap();
    }
    writer.commit().unwrap();
}

/// Two episodes: in one the attributions change; in the other the first reply now gives an action.
fn recorded(folder: &Path) {
    let spec: &Spec = &Experiment::E1;
    let recording = json!({ "experiment": spec, "agent": { "model": "m", "identification_version": "0" } });
    let left = Some(Action::TurnLeft);
    let calm = vec![
        // The recorded colour differs from the text.
        step(Some(said("a", "none", "I am red")), "ok", left, Some("blue")),
        step(None, "timeout", None, None),
        // The provider cut this reply off.
        step(Some(said("w", "none", "I am red").replace('}', "")), "truncated", None, None),
        step(Some(said("done", "red", "I am red")), "ok", Some(Action::Done), Some("red")),
    ];
    let commented = said("w", "none", "I am red").replace("\"action\"", "// on\n\"action\"");
    let otherwise = vec![
        step(Some(commented), "parse_failed", None, None),
        step(Some(said("a", "none", "unknown")), "ok", left, Some("unknown")),
        step(Some("no object".to_owned()), "parse_failed", None, None),
    ];
    write(&folder.join("own.parquet"), recording, &[("E1/m/s1/r1", calm), ("E1/m/s1/r2", otherwise)]);
}

#[test]
fn changes_by_another_parser_are_listed_and_recorded_actions_stay() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    recorded(at);
    run(at, &["report", "own.parquet", "--no-figures", "--out", "old"]).ends(0);
    let answer = run(at, &["table", "rescore", "old", "--reparse", "--out", "new", "--json"]).json();

    let (before, after) =
        (traces::episodes(&at.join("own.parquet")), traces::episodes(&at.join("new-traces/own.parquet")));
    let of = |episodes: &[mirrorstats_trace::episodes::episode::Episode], value: fn(&Step) -> Option<String>| {
        episodes.iter().flat_map(|episode| episode.steps.iter().map(value)).collect::<Vec<_>>()
    };
    let action = |step: &Step| step.action.map(|action| action.name().to_owned());
    assert_eq!(of(&before, action), of(&after, action));
    let statuses =
        of(&after, |step| step.extra.reply_status.clone()).into_iter().map(Option::unwrap).collect::<Vec<_>>();
    assert_eq!(statuses, ["ok", "timeout", "truncated", "ok", "repaired", "ok", "parse_failed"]);
    assert_eq!(after[1].steps[0].extra.reply_repair.as_deref(), Some("comment"));
    assert!(after[1].steps[2].extra.reply_fault.as_ref().is_some_and(|fault| !fault.is_empty()));

    let reparsed = &answer["reparsed"];
    let changes: Vec<String> = reparsed["changes"]
        .as_array()
        .unwrap()
        .iter()
        .map(|change| {
            let text = |key: &str| change[key].as_str().unwrap_or("--").to_owned();
            format!(
                "{} {} {}: {} -> {}",
                text("episode_id"),
                change["t"],
                text("column"),
                text("before"),
                text("after")
            )
        })
        .collect();
    let expected = [
        "E1/m/s1/r1 1 self_color: blue -> red",
        "E1/m/s1/r1 4 selected_cube: none -> red",
        "E1/m/s1/r2 1 self_color: -- -> red",
        "E1/m/s1/r2 1 selected_cube: -- -> none",
        "E1/m/s1/r2 1 reply_status: parse_failed -> repaired",
    ];
    assert_eq!(changes, expected);
    let diverged = json!([{ "episode_id": "E1/m/s1/r2", "t": 1, "recorded": null, "parsed": "move_forward" }]);
    assert_eq!((&reparsed["diverged"], &reparsed["replies"]), (&diverged, &json!(5)));
    assert_eq!(
        traces::recording(&at.join("new-traces/own.parquet"))["agent"]["identification_version"],
        mirrorstats_identification::VERSION
    );
    run(at, &["trace", "validate", "new-traces"]).ends(0);

    let said = run(at, &["table", "rescore", "old", "--reparse", "--out", "again"]).ends(0).stdout;
    for line in [
        "E1/m/s1/r2 would have gone on otherwise from t = 1: the action was none and would be move_forward\n",
        "5 values changed in 5 steps with a reply; 1 episode would have gone on otherwise\n",
    ] {
        assert!(said.contains(line), "{said}");
    }
    // Reparsing a second time changes nothing.
    run(at, &["report", "new-traces/own.parquet", "--no-figures", "--out", "read"]).ends(0);
    let answer = run(at, &["table", "rescore", "read", "--reparse", "--out", "twice", "--json"]).json();
    assert_eq!(answer["reparsed"]["changes"], json!([]));
}

#[test]
fn labels_of_a_coder_overrule_what_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    recorded(at);
    run(at, &["report", "own.parquet", "--no-figures", "--out", "old"]).ends(0);
    let rescored = |labels: &[(&str, u32, &str)], out: &str| {
        let line = |(coder, step, label): &(&str, u32, &str)| {
            format!("{}\n", json!({ "coder": coder, "episode_id": "E1/m/s1/r1", "step": step, "label": label }))
        };
        fs::write(at.join("labels.jsonl"), labels.iter().map(line).collect::<String>()).unwrap();
        run(at, &["table", "rescore", "old", "--reparse", "--out", out])
    };
    let said = rescored(&[("ann", 1, "self_color_green"), ("bob", 4, "self_color_none")], "new").ends(0).stdout;
    assert!(said.contains("green (label by ann)") && said.contains("-- (label by bob)"), "{said}");
    let path = at.join("new-traces/own.parquet");
    let steps = &traces::episodes(&path)[0].steps;
    assert_eq!([0, 3].map(|at: usize| steps[at].self_color.as_deref()), [Some("green"), None]);
    assert_eq!(traces::recording(&path)["labels_overrule"], true);
    run(at, &["trace", "validate", "new-traces"]).ends(0);
    for (labels, words) in [
        (
            vec![("ann", 1, "self_color_green"), ("bob", 1, "self_color_red")],
            "E1/m/s1/r1, t = 1: expected coders who agree",
        ),
        (vec![("ann", 1, "self_color_mauve")], "expected `self_color_` and a colour of the palette"),
        (vec![("ann", 2, "self_color_red")], "E1/m/s1/r1, t = 2: expected a step with a reply"),
    ] {
        let failed = rescored(&labels, "refused").ends(2);
        assert!(failed.stderr.contains(words), "{}", failed.stderr);
    }
}

#[test]
fn traces_without_their_report_are_made_again() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    recorded(at);
    run(at, &["report", "own.parquet", "--no-figures", "--out", "old"]).ends(0);
    let words = ["table", "rescore", "old", "--reparse", "--out", "new"];
    let first = run(at, &words);
    assert!(!first.stderr.contains("interrupted"), "{}", first.stderr);
    let whole = fs::read(at.join("new-traces/own.parquet")).unwrap();
    for (lost, kept) in [("new", "new-traces"), ("new-traces", "new")] {
        fs::remove_dir_all(at.join(lost)).unwrap();
        let again = run(at, &words);
        assert!(again.stderr.contains(&format!("{kept} is there without {lost}")), "{}", again.stderr);
        assert_eq!(fs::read(at.join("new-traces/own.parquet")).unwrap(), whole);
        assert!(at.join("new/manifest.json").is_file());
    }
}

#[test]
fn a_report_that_cannot_be_made_again_leaves_no_traces() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    recorded(at);
    run(at, &["report", "own.parquet", "--no-figures", "--out", "old"]).ends(0);
    run(at, &["table", "rescore", "old", "--reparse", "--out", "new", "--definitions", "missing.toml"]).refused();
    assert!(!at.join("new-traces").exists() && !at.join("new").exists());
}

#[test]
fn traces_without_replies_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let steps = vec![step(None, "ok", Some(Action::Done), None)];
    traces::write_trace(
        &folder.path().join("bare.parquet"),
        &[traces::episode("a", steps)],
        OptionalColumns::named(&["reply_status"]).unwrap(),
    );
    run(folder.path(), &["report", "bare.parquet", "--no-figures", "--out", "old"]).ends(0);
    let said = run(folder.path(), &["table", "rescore", "old", "--reparse"]).refused();
    assert!(
        said.contains("bare.parquet: expected an experiment and the column `reply`") && said.contains("help: "),
        "{said}"
    );
}

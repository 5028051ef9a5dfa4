//! `diff` between definitions, between scores, and between scores and definitions.

use serde_json::{Value, json};

use crate::changes::{folder, run};

/// `[metric, episode, before, after, timesteps before, timesteps after]` of each flip.
fn flips(changes: &Value) -> Vec<Value> {
    let flips = changes["flips"].as_array().unwrap();
    let one = |flip: &Value| {
        let (value, steps) = (&flip["value"], &flip["timesteps"]);
        json!([flip["episode_id"], value["before"], value["after"], steps["before"], steps["after"]])
    };
    flips.iter().map(one).collect()
}

#[test]
fn a_flip_comes_with_the_timesteps_that_decided_it_on_both_sides() {
    let folder = folder();
    let changes = run(folder.path(), &["diff", "all.toml", "late.toml", "a.parquet", "b.parquet", "--json"]).json();
    assert_eq!(flips(&changes), [json!(["e1", 2, 1, [1, 2], [2]])]);
    let cell = &changes["cells"][0];
    assert_eq!(cell["key"], json!({ "experiment": "E1", "model": "ant" }));
    let [before, after] = ["before", "after"].map(|side| &cell["numbers"][side]);
    assert_eq!([&before["n"], &before["sum"], &before["sum_sq"]], [3, 3, 5]);
    assert_eq!([&after["n"], &after["sum"], &after["sum_sq"]], [3, 2, 2]);
    assert_eq!(cell["mean_change"], json!(-1.0 / 3.0));
    assert_eq!(changes["cells_compared"], 1);
    assert_eq!(changes["rewritten"][0]["text"]["after"], "count(mirror_visible and t >= 2)");
}

#[test]
fn scores_and_their_definitions_have_the_same_diff() {
    let folder = folder();
    let at = folder.path();
    let expected = run(at, &["diff", "all.toml", "late.toml", "a.parquet", "--json"]).json();
    for format in ["parquet", "csv", "jsonl"] {
        let [old, new] = ["all", "late"].map(|name| {
            let (definitions, scores) = (format!("{name}.toml"), format!("{name}.{format}"));
            run(at, &["score", "a.parquet", "--definitions", &definitions, "-o", &scores]).ends(0);
            scores
        });
        let text = if format == "parquet" { &[][..] } else { &["--definitions", "all.toml"] };
        let bare = run(at, &[&["diff", &old, &new, "--json"], text].concat()).json();
        assert_eq!(flips(&bare), [json!(["e1", 2, 1, null, null])], "{format}");
        assert_eq!(bare["cells"], expected["cells"], "{format}");
        let explained = run(at, &[&["diff", &old, &new, "a.parquet", "--json"], text].concat());
        let known = if format == "parquet" { json!([2]) } else { Value::Null };
        // Text scores do not name their definitions, so evidence for the other value is missing.
        assert_eq!(explained.stderr.contains("not explained"), known.is_null(), "{}", explained.stderr);
        assert_eq!(flips(&explained.json()), [json!(["e1", 2, 1, [1, 2], known])], "{format}");
    }
    let mixed = run(at, &["diff", "all.parquet", "late.toml", "a.parquet", "--json"]).json();
    assert_eq!(mixed, expected);
}

#[test]
fn a_folder_of_scores_is_one_table() {
    let folder = folder();
    let at = folder.path();
    std::fs::create_dir(at.join("parts")).unwrap();
    for part in ["a", "b"] {
        let (traces, scores) = (format!("{part}.parquet"), format!("parts/{part}.parquet"));
        run(at, &["score", &traces, "--definitions", "all.toml", "-o", &scores]).ends(0);
    }
    run(at, &["diff", "parts", "all.toml", "a.parquet", "b.parquet", "--fail-on-change"]).ends(0);
    let said = run(at, &["diff", ".", "all.toml", "a.parquet"]).refused();
    assert!(said.contains("found both"), "{said}");
}

#[test]
fn no_change_is_printed_and_is_no_failure() {
    let folder = folder();
    let answer = run(folder.path(), &["diff", "all.toml", "all.toml", "a.parquet", "--fail-on-change"]).ends(0);
    assert!(answer.stdout.contains("Nothing changed: 2 episodes in both, 1 metric in both"), "{}", answer.stdout);
}

#[test]
fn a_change_fails_with_fail_on_change() {
    let folder = folder();
    let at = folder.path();
    let diff = ["diff", "all.toml", "late.toml", "a.parquet"];
    run(at, &diff).ends(0);
    run(at, &[&diff[..], &["--fail-on-change"]].concat()).ends(1);
    run(at, &[&diff[..], &["--fail-on-change", "--json"]].concat()).ends(1);
    run(at, &[&diff[..], &["--fail-on-change", "--where", "run = 2"]].concat()).ends(0);
}

#[test]
fn items_of_one_side_are_listed_and_fail() {
    let folder = folder();
    let at = folder.path();
    run(at, &["score", "a.parquet", "--definitions", "all.toml", "-o", "a.scores.parquet"]).ends(0);
    run(at, &["score", "a.parquet", "b.parquet", "--definitions", "all.toml", "-o", "ab.scores.parquet"]).ends(0);
    let answer = run(at, &["diff", "a.scores.parquet", "ab.scores.parquet", "--fail-on-change"]).ends(1);
    assert!(answer.stdout.contains("Only after: 1 episode: e3"), "{}", answer.stdout);
    assert!(answer.stdout.contains("0 flips"), "{}", answer.stdout);
    std::fs::write(at.join("other.toml"), "include = [\"all.toml\"]\n[metric.PACE]\nvalue = \"length()\"\n").unwrap();
    let answer = run(at, &["diff", "other.toml", "all.toml", "a.parquet", "--fail-on-change"]).ends(1);
    assert!(answer.stdout.contains("Only before: 1 metric: PACE"), "{}", answer.stdout);
    run(at, &["diff", "other.toml", "all.toml", "a.parquet", "--fail-on-change", "--metrics", "GAZE"]).ends(0);
}

#[test]
fn a_metric_on_one_side_needs_no_column_on_the_other() {
    let folder = folder();
    let at = folder.path();
    std::fs::write(
        at.join("more.toml"),
        format!("{}[metric.PX]\nvalue = \"max(mirror_px)\"\n", crate::changes::gaze(1)),
    )
    .unwrap();
    let answer = run(at, &["diff", "all.toml", "more.toml", "a.parquet"]).ends(0);
    assert!(answer.stdout.contains("Only after: 1 metric: PX"), "{}", answer.stdout);
}

#[test]
fn a_change_to_undefined_is_a_flip() {
    let folder = folder();
    let at = folder.path();
    std::fs::write(at.join("when.toml"), format!("{}when = \"any(mirror_visible)\"\n", crate::changes::gaze(1)))
        .unwrap();
    let changes = run(at, &["diff", "all.toml", "when.toml", "a.parquet", "b.parquet", "--json"]).json();
    // Undefined because the condition is false: no step has the mirror in view.
    assert_eq!(flips(&changes), [json!(["e3", 0, null, [], []])]);
    let text = run(at, &["diff", "all.toml", "when.toml", "b.parquet"]).ends(0).stdout;
    assert!(text.contains("GAZE: 1 to undefined") && text.contains("0/1 = 0.000 -> undefined"), "{text}");
}

#[test]
fn long_lists_are_cut_and_say_so() {
    let folder = folder();
    let at = folder.path();
    std::fs::write(at.join("none.toml"), crate::changes::gaze(9)).unwrap();
    let text = run(at, &["diff", "all.toml", "none.toml", "a.parquet", "--limit", "1"]).ends(0).stdout;
    assert!(text.contains("1 more: --limit shows more, --json all"), "{text}");
    assert!(text.contains(" e1 ") && !text.contains(" e2 "), "{text}");
    let all = run(at, &["diff", "all.toml", "none.toml", "a.parquet", "--limit", "1", "--json"]).json();
    assert_eq!(flips(&all).len(), 2);
}

#[test]
fn incomparable_sides_are_refused() {
    let folder = folder();
    let at = folder.path();
    for (arguments, expected) in [
        (&["all.toml", "late.toml"][..], "expected traces to score with them"),
        (&["a.parquet", "b.parquet"], "found no scores in it"),
        (&["papr", "paper", "a.parquet"], "did you mean the built-in `paper`?"),
        (&["all.toml", "late.toml", "a.parquet", "--metrics", "GAZ"], "did you mean `GAZE`?"),
        (&["all.toml", "late.toml", "a.parquet", "--by", "modell"], "did you mean `model`?"),
        (&["all.toml", "late.toml", "a.parquet", "--where", "sed = 1"], "sed"),
        (&["all.toml", "late.toml", "no.parquet"], "no such file or folder"),
    ] {
        let said = run(at, &[&["diff"], arguments].concat()).refused();
        assert!(said.contains(expected), "{arguments:?}: {said}");
    }
}

//! Experiments that traces declare and the definitions do not know: every command accepts them, with their own title,
//! order and levels.

use std::fs;
use std::num::NonZeroUsize;
use std::path::Path;

use mirrorstats_score::score_traces::{self, Request};
use mirrorstats_trace::episodes::episode::Episode;
use mirrorstats_trace::write::write_episodes;
use serde_json::{Value, json};

use crate::harness::traces::open;
use crate::{contents, episode, run};

/// `E6`, which the footers below declare; one of its levels is for an unknown metric.
fn six() -> Value {
    json!({ "name": "E6", "title": "Delayed mirror", "order": 6, "decision": "selected_cube",
            "chance": { "TSA": "1/5", "NEW": "1/2" }, "reference": { "MCR": ["1/4", "1/7"] }, "actions": ["done"] })
}

fn with(mut experiment: Value, key: &str, value: Value) -> Value {
    experiment[key] = value;
    experiment
}

/// Writes eight episodes of two models in an experiment, with `recording` in the footer.
fn write(folder: &Path, name: &str, experiment: &str, recording: &Value) {
    let number = |at: usize| i32::try_from(at / 2).unwrap();
    let one = |at: usize| Episode {
        seed: i32::from(name.as_bytes()[0]),
        episode_id: format!("{name}-{experiment}-{at}"),
        ..episode(["ant", "bee"][at % 2], experiment, number(at), "red")
    };
    let episodes: Vec<Episode> = (0..8).map(one).collect();
    write_episodes(&folder.join(format!("{name}.parquet")), Some(recording.clone()), &episodes).unwrap();
}

/// A folder with traces of `E1`, which is known, of `E6`, and of `A7`, which is declared without an order.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "known", "E1", &json!({}));
    write(folder.path(), "six", "E6", &json!({ "experiment": six() }));
    write(folder.path(), "seven", "A7", &json!({ "experiments": [{ "name": "A7" }, { "name": "A8" }] }));
    folder
}

const TRACES: [&str; 3] = ["seven.parquet", "six.parquet", "known.parquet"];

#[test]
fn a_report_has_a_declared_experiment_under_its_own_title_order_and_levels() {
    let folder = folder();
    let at = folder.path();
    run(at, &[&["report", "--out", "out"], &TRACES[..]].concat()).done();
    let table = fs::read_to_string(at.join("out/tables/main.md")).unwrap();
    let places = ["### E1: Active mirror-based", "### E6: Delayed mirror\n", "### A7\n"].map(|name| table.find(name));
    assert!(places.iter().all(Option::is_some) && places.is_sorted(), "{table}");
    let latex = fs::read_to_string(at.join("out/tables/main.tex")).unwrap();
    assert!(latex.contains("E6: Delayed mirror"), "{latex}");
    let page = fs::read_to_string(at.join("out/report.html")).unwrap().replace("&#x2f;", "/");
    assert!(page.contains("Delayed mirror") && page.contains("TSA 1/5") && page.contains("MCR 1/4, 1/7"));
    assert!(!page.contains("NEW"), "a level of no metric");
    let spider = fs::read_to_string(at.join("out/figures/spider.svg")).unwrap();
    assert!(spider.contains("E6: chance level of TSA"), "{spider}");
    let manifest: Value = serde_json::from_str(&fs::read_to_string(at.join("out/manifest.json")).unwrap()).unwrap();
    let own = &manifest["definitions"]["experiment"]["E6"];
    assert_eq!((&own["title"], &own["chance"]), (&json!("Delayed mirror"), &json!({ "TSA": "1/5" })));
    // The definitions are those of the file, whatever the traces declare.
    let shown = run(at, &["report", "known.parquet", "--out", "plain"]).done();
    assert!(!shown.contains("E6"), "{shown}");
    let plain: Value = serde_json::from_str(&fs::read_to_string(at.join("plain/manifest.json")).unwrap()).unwrap();
    assert_eq!(plain["definitions"]["hash"], manifest["definitions"]["hash"]);
}

#[test]
fn nothing_depends_on_the_order_of_the_files() {
    let folder = folder();
    let at = folder.path();
    let reversed: Vec<&str> = TRACES.into_iter().rev().collect();
    for (out, traces) in [("a", &TRACES[..]), ("b", &reversed)] {
        run(at, &[&["score", "-o", &format!("{out}.parquet")], traces].concat()).done();
        run(at, &[&["score", "-o", &format!("{out}.csv")], traces].concat()).done();
        let mut answer = run(at, &[&["stats", "--metric", "all", "--json"], traces].concat()).json();
        answer["inputs"] = Value::Null;
        fs::write(at.join(format!("{out}.json")), answer.to_string()).unwrap();
    }
    for ending in ["parquet", "csv", "json"] {
        let [a, b] = ["a", "b"].map(|name| fs::read(at.join(format!("{name}.{ending}"))).unwrap());
        assert!(a == b, "{ending}");
    }
}

#[test]
fn the_library_scores_a_declared_experiment() {
    let folder = folder();
    let traces = open(&[&folder.path().join("six.parquet")]);
    let definitions = score_traces::definitions(&traces, &Request::of("paper")).unwrap();
    let table = score_traces::score(&traces, &definitions, &[], NonZeroUsize::MIN).unwrap();
    assert_eq!((table.len(), table.catalog.experiment["E6"].title.as_str()), (8, "Delayed mirror"));
}

#[test]
fn scores_carry_what_the_traces_declare() {
    let folder = folder();
    let at = folder.path();
    for name in ["known", "six", "seven"] {
        run(at, &["score", &format!("{name}.parquet"), "-o", &format!("{name}-scores.parquet")]).done();
    }
    run(at, &[&["report", "--out", "traces"], &TRACES[..]].concat()).done();
    let scores = ["seven-scores.parquet", "known-scores.parquet", "six-scores.parquet"];
    run(at, &[&["report", "--out", "scores"], &scores[..]].concat()).done();
    let [traces, scores] = ["traces", "scores"].map(|name| contents(&at.join(name)));
    for name in ["tables/main.md", "tables/main.tex", "tables/main.csv", "cells.csv", "figures/spider.svg"] {
        assert!(traces[name] == scores[name], "{name}");
    }
    let told = run(at, &["stats", "six-scores.parquet", "--metric", "TSA", "--json"]).json();
    assert_eq!(told, run(at, &["stats", "six.parquet", "--metric", "TSA", "--json"]).json());
    let rows = told["chance"].as_array().unwrap().iter().filter(|row| row["metric"] == "TSA");
    let levels: Vec<_> = rows.map(|row| (row["experiment"].as_str(), row["level"].as_str())).collect();
    assert_eq!(levels, [(Some("E6"), Some("1/5")); 2]);
    // The scores in a report's folder count as scores too.
    let changes = run(at, &["diff", "traces", "scores", "--json"]).json();
    assert_eq!(changes["flips"], json!([]));
}

#[test]
fn every_command_takes_a_declared_experiment() {
    let folder = folder();
    let at = folder.path();
    run(at, &[&["report", "--out", "report"], &TRACES[..]].concat()).done();
    for arguments in [
        &["trace", "validate"][..],
        &["trace", "info"],
        &["score"],
        &["score", "--explain", "six-E6-0"],
        &["stats", "--sequential"],
        &["figure", "heatmap", "-o", "heatmap.svg"],
        &["figure", "slopes", "-o", "slopes.svg"],
        &["definitions", "sql"],
    ] {
        run(at, &[arguments, &TRACES[..]].concat()).done();
    }
    // No recording states losses, so the limit cannot be checked.
    let checked = run(at, &[&["trace", "check", "--max-lost", "0"], &TRACES[..]].concat()).ends(1);
    assert!(checked.stdout.contains(" E6 "), "{}", checked.stdout);
    let asked = ["query", "SELECT experiment, COUNT(*) AS n FROM episodes GROUP BY experiment ORDER BY n, experiment"];
    let answer = run(at, &[&asked, &TRACES[..], &["--format", "csv"]].concat()).done();
    assert_eq!(answer, "experiment,n\nA7,8\nE1,8\nE6,8\n");
    fs::write(at.join("own.toml"), "include = [\"paper\"]\n[let]\nvisible = \"t = 2\"\n").unwrap();
    run(at, &["table", "rescore", "report", "--definitions", "own.toml", "--traces", "."]).done();
    let again = fs::read_to_string(at.join("report-rescored/tables/main.md")).unwrap();
    assert!(again.contains("E6: Delayed mirror"), "{again}");
    let published = "experiment,model,metric,mean,se,emphasis\nE6,ant,TSA,0.50,,\n";
    fs::write(at.join("published.csv"), published).unwrap();
    let compared = run(at, &["table", "compare", "--published", "published.csv", "six.parquet"]);
    assert!([0, 1].contains(&compared.code) && compared.stderr.is_empty(), "{}", compared.stderr);
    run(at, &["diff", "paper", "own.toml", "six.parquet"]).done();
}

#[test]
fn evidence_is_found_for_scores_of_a_declared_experiment() {
    let folder = folder();
    let at = folder.path();
    fs::write(at.join("own.toml"), "include = [\"paper\"]\n[let]\nvisible = \"t = 3\"\n").unwrap();
    for name in ["six", "known"] {
        let trace = format!("{name}.parquet");
        run(at, &["score", &trace, "-o", "old.parquet"]).done();
        run(at, &["score", &trace, "--definitions", "own.toml", "-o", "new.parquet"]).done();
        // The traces may have more episodes than the scores.
        let answer = run(at, &["diff", "old.parquet", "new.parquet", "six.parquet", "known.parquet", "--json"]).json();
        let flips = answer["flips"].as_array().unwrap();
        assert!(!flips.is_empty() && flips.iter().all(|flip| flip["timesteps"]["before"].is_array()), "{answer}");
    }
}

#[test]
fn an_open_question_of_a_declared_experiment_has_its_figure() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let open = with(with(six(), "chance", json!({ "TSA": "none" })), "reference", json!({ "TSA": ["1/10"] }));
    write(at, "six", "E6", &json!({ "experiment": open }));
    run(at, &["figure", "e5-outcomes", "six.parquet", "-o", "outcomes.svg"]).done();
    let drawn = fs::read_to_string(at.join("outcomes.svg")).unwrap();
    assert!(drawn.contains("E6 · ant · correct: 2 of 4"), "{drawn}");
}

#[test]
fn a_threshold_of_evidence_keeps_a_declared_experiment() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut one = episode("ant", "E6", 0, "red");
    one.steps.iter_mut().for_each(|step| step.extra.mirror_self_px = Some(20));
    write_episodes(&at.join("six.parquet"), Some(json!({ "experiment": six() })), &[one]).unwrap();
    let told = run(at, &["definitions", "sensitivity", "six.parquet", "--thresholds", "10,30"]).done();
    assert!(told.contains("E6"), "{told}");
}

#[test]
fn an_undeclared_experiment_is_refused() {
    let folder = folder();
    let at = folder.path();
    write(at, "nine", "E9", &json!({ "experiment": six() }));
    let message = run(at, &["score", "nine.parquet"]).refused();
    assert!(
        message.contains("unknown-experiment: nine.parquet") && message.contains("E5, E6\n  found `E9`"),
        "{message}"
    );
    let told = run(at, &["trace", "validate", "nine.parquet"]).ends(1).stdout;
    assert!(told.contains("unknown-experiment") && told.contains("found `E9`"), "{told}");
    // A trace's declaration also applies to the traces beside it, in any order.
    write(at, "bare", "E6", &json!({}));
    assert!(run(at, &["score", "bare.parquet"]).refused().contains("found `E6`"));
    for pair in [["bare.parquet", "six.parquet"], ["six.parquet", "bare.parquet"]] {
        run(at, &[&["score"], &pair[..]].concat()).done();
        run(at, &[&["trace", "validate"], &pair[..]].concat()).done();
    }
    // Text formats keep declarations too.
    run(at, &["score", "six.parquet", "-o", "scores.parquet"]).done();
    let stats = run(at, &["stats", "scores.parquet"]).done();
    for name in ["six.csv", "six.jsonl"] {
        run(at, &["score", "six.parquet", "-o", name]).done();
        assert_eq!(run(at, &["stats", name]).done(), stats);
    }
}

#[test]
fn files_that_declare_one_experiment_differently_are_refused_together() {
    let folder = folder();
    let at = folder.path();
    for (key, value, words) in [
        ("title", json!("Other"), "the title of the experiment `E6` as @ declares it, `Delayed mirror`, found `Other`"),
        ("title", Value::Null, "the title of the experiment `E6` as @ declares it, `Delayed mirror`, found not given"),
        ("order", json!(7), "the order of the experiment `E6` as @ declares it, 6, found 7"),
        ("order", Value::Null, "the order of the experiment `E6` as @ declares it, 6, found not given"),
        (
            "chance",
            json!({ "TSA": "none" }),
            "the chance level of TSA of the experiment `E6` as @ declares it, 1/5, found none",
        ),
        ("chance", json!({}), "the chance level of TSA of the experiment `E6` as @ declares it, 1/5, found not given"),
        (
            "reference",
            json!({ "MCR": ["1/4"] }),
            "the reference level of MCR of the experiment `E6` as @ declares it, 1/4, 1/7, found 1/4",
        ),
    ] {
        write(at, "zero", "E6", &json!({ "experiment": with(six(), key, value) }));
        let both = ["six.parquet", "zero.parquet"];
        let message = run(at, &[&["report"], &both[..]].concat()).refused();
        let expected = format!("zero.parquet: expected {}", words.replace('@', "`six.parquet`"));
        assert!(message.contains(&expected), "{message}");
        let told = run(at, &[&["trace", "validate"], &both[..]].concat()).ends(1).stdout;
        let expected = "invalid-metadata: zero.parquet\n  expected the";
        assert!(told.contains(expected) && told.contains("as `six.parquet` declares it"), "{told}");
        for name in ["six", "zero"] {
            run(at, &["score", &format!("{name}.parquet"), "-o", &format!("{name}-scores.parquet")]).done();
        }
        let message = run(at, &["report", "six-scores.parquet", "zero-scores.parquet"]).refused();
        let expected = format!("zero-scores.parquet: expected {}", words.replace('@', "`six-scores.parquet`"));
        assert!(message.contains(&expected), "{message}");
    }
    // Declarations may differ in fields that analysis does not read.
    write(at, "zero", "E6", &json!({ "experiment": with(with(six(), "actions", json!([])), "decision", json!("x")) }));
    run(at, &["report", "six.parquet", "zero.parquet"]).done();
}

#[test]
fn definitions_override_declarations() {
    let folder = folder();
    let at = folder.path();
    let own = "include = [\"paper\"]\n[experiment.E6]\ntitle = \"Own\"\norder = 9\nchance = { TSA = \"1/2\" }\n";
    fs::write(at.join("own.toml"), own).unwrap();
    write(at, "zero", "E6", &json!({ "experiment": with(six(), "title", json!("Other")) }));
    let table = run(at, &["report", "six.parquet", "zero.parquet", "--definitions", "own.toml"]).done();
    assert!(table.contains("E6: Own") && !table.contains("Delayed"), "{table}");
    let told = run(at, &["trace", "validate", "six.parquet", "--definitions", "own.toml", "--json"]).json();
    let codes: Vec<&str> =
        told["findings"].as_array().unwrap().iter().map(|finding| finding["code"].as_str().unwrap()).collect();
    let overridden = "experiment-overridden";
    assert_eq!(codes, [overridden, overridden, overridden, "unknown-level"]);
}

#[test]
fn an_invalid_declaration_is_reported_with_its_file() {
    let folder = folder();
    let at = folder.path();
    for (key, value, words) in [
        (
            "chance",
            json!({ "TSA": "abc" }),
            "experiment.chance.TSA` to be a fraction such as `1/3`, or `none`\n  found `\"abc\"`",
        ),
        ("chance", json!({ "TSA": "4/3" }), "of the experiment `E6` to be a fraction from 0 to 1"),
        ("title", json!(7), "experiment.title` to be a text\n  found `7`"),
        ("name", json!("\u{1b}[31m"), "expected one of E1, E2, E3, E4, E5, \\u{1b}[31m\n  found `E6`"),
        ("order", json!("first"), "experiment.order` to be a whole number"),
    ] {
        write(at, "bad", "E6", &json!({ "experiment": with(six(), key, value) }));
        for arguments in [&["score"][..], &["report", "known.parquet"]] {
            let message = run(at, &[arguments, &["bad.parquet"]].concat()).refused();
            assert!(message.contains("bad.parquet") && message.contains(words), "{message}");
        }
        let told = run(at, &["trace", "validate", "bad.parquet"]).ends(1).stdout;
        assert!(told.contains("bad.parquet") && !told.contains('\u{1b}'), "{told}");
    }
}

#[test]
fn names_and_titles_with_markup_are_shown_as_text() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (name, title) = ("E6<b>_&\u{1b}[1m", "<script>alert(1)</script> \u{202e}%$\u{7}|");
    let declared = with(with(six(), "name", json!(name)), "title", json!(title));
    write(at, "odd", name, &json!({ "experiment": declared }));
    let shown = run(at, &["report", "odd.parquet", "--out", "out"]).done();
    assert!(shown.contains("E6<b>_&\\u{1b}[1m: <script>alert(1)</script> \\u{202e}%$\\u{7}|"), "{shown}");
    for (path, bytes) in contents(&at.join("out")) {
        let is_text = ["md", "tex", "html", "svg"].iter().any(|ending| path.ends_with(ending));
        let text = if is_text { String::from_utf8(bytes).unwrap() } else { String::new() };
        assert!(!text.contains(['\u{1b}', '\u{202e}', '\u{7}']) && !text.contains("<script>alert"), "{path}");
    }
    for arguments in [&["stats"][..], &["trace", "validate"], &["trace", "info"]] {
        let answer = run(at, &[arguments, &["odd.parquet"]].concat());
        assert!(!answer.stdout.contains(['\u{1b}', '\u{202e}', '\u{7}']), "{}", answer.stdout);
    }
}

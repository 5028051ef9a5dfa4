//! Every form of scores keeps a trace's declarations: kind, clusters, scenes, fingerprints, losses and replies.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use super::comparable::{Cell, LIKE, solved};
use crate::harness::program::run;

const FORMS: [&str; 3] = ["parquet", "csv", "jsonl"];

fn ant() -> Cell<'static> {
    Cell { solved: solved(21, 21), ..LIKE }
}

fn bee() -> Cell<'static> {
    Cell { model: "bee", solved: solved(0, 21), ..LIKE }
}

/// The output of `stats`, `report` and `gate` for `a.FORM` and `b.FORM`, without the form's name.
fn said(at: &Path, form: &str) -> Vec<String> {
    let [a, b, out] = ["a", "b", "out"].map(|name| format!("{name}.{form}"));
    let stats = run(at, &["stats", &a, &b, "--full"]);
    let json = run(at, &["stats", &a, &b, "--json"]);
    let report = run(at, &["report", &a, &b, "--out", &out, "--no-figures"]);
    let gate = run(at, &["gate", &a, &b, "--format", "json"]);
    let answers = [stats, json, report, gate];
    let printed = answers.into_iter().map(|it| format!("{} {}{}", it.code, it.stdout, it.stderr).replace(form, "FORM"));
    let files = ["main.md", "main.tex", "main.html", "cells.csv"].map(|name| at.join(&out).join("tables").join(name));
    printed.chain(files.into_iter().filter_map(|file| fs::read_to_string(file).ok())).collect()
}

#[test]
fn every_form_of_scores_gives_the_same_verdicts_and_caveats() {
    for (name, first, second, words) in [
        ("plain", ant(), bee(), "21 pairs"),
        ("lost", ant(), Cell { lost: 10, ..bee() }, "10 episodes were lost"),
        ("unread", ant(), Cell { unread: 20, ..bee() }, "20 of 84 replies gave no decision (E1 bee 20 of 42)"),
        ("clusters", Cell { cluster: Some("seed"), ..ant() }, bee(), "seeds are clusters"),
        ("worlds", ant(), Cell { mirror: 1.2, ..bee() }, "not comparable (world"),
        ("ambiguous", ant(), Cell { mirror: 1.2, named: Some("ant/E1/3/40/p"), ..bee() }, "not comparable (world"),
        ("rebuilt", Cell { kind: "reconstruction", ..ant() }, bee(), "reconstructed episodes"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        first.write(&at.join("a"));
        second.write(&at.join("b"));
        for form in FORMS {
            for side in ["a", "b"] {
                run(at, &["score", side, "-o", &format!("{side}.{form}")]).done();
            }
        }
        let [parquet, csv, lines] = FORMS.map(|form| said(at, form));
        assert!(parquet[0].contains(words), "{name}: {}", parquet[0]);
        for other in [csv, lines] {
            assert_eq!(parquet, other, "{name}");
        }
        // Mixed forms, and one file of scores made from two forms.
        run(at, &["score", "a.csv", "b.jsonl", "-o", "both.csv"]).done();
        for inputs in [&["a.csv", "b.parquet"][..], &["both.csv"]] {
            let mixed = run(at, &[&["stats"], inputs, &["--full"]].concat());
            assert_eq!(format!("{} {}{}", mixed.code, mixed.stdout, mixed.stderr), parquet[0], "{name}: {inputs:?}");
        }
    }
}

#[test]
fn reconstructed_and_recorded_episodes_are_never_paired() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    Cell { kind: "reconstruction", ..ant() }.write(&at.join("a"));
    bee().write(&at.join("b"));
    run(at, &["score", "a", "-o", "a.csv"]).done();
    run(at, &["score", "b", "-o", "b.jsonl"]).done();
    for inputs in [["a", "b"], ["a.csv", "b.jsonl"]] {
        let stats = run(at, &["stats", inputs[0], inputs[1]]).done();
        assert!(stats.contains("nothing is paired") && !stats.contains("pairs of equal scenes"), "{stats}");
    }
    // Equal ids on both sides do not make pairs either.
    Cell { solved: solved(0, 21), ..LIKE }.write(&at.join("c"));
    for base in ["a", "a.csv"] {
        let gate = run(at, &["gate", base, "c"]).ends(5).stdout;
        assert!(gate.contains("kind is reconstruction and recording"), "{gate}");
        let pooled: Value =
            serde_json::from_str(&run(at, &["gate", base, "c", "--pool", "--format", "json"]).ends(1).stdout).unwrap();
        assert_eq!(pooled["cells"][0]["flips"], json!([]), "{pooled}");
    }
}

#[test]
fn scores_of_other_programs_declare_nothing_and_say_so() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ant().write(&at.join("a"));
    run(at, &["score", "a", "-o", "a.csv"]).done();
    let text = fs::read_to_string(at.join("a.csv")).unwrap();
    assert!(
        text.starts_with("episode_id,") && text.lines().next().unwrap().ends_with(",mirrorstats.declared"),
        "{text}"
    );
    let cut: Vec<&str> = text.lines().map(|line| line.split(",\"{").next().unwrap()).collect();
    let cut = cut.join("\n").replace(",mirrorstats.declared", "").replace(",\n", "\n");
    fs::write(at.join("cut.csv"), cut.trim_end_matches(',')).unwrap();
    assert!(run(at, &["stats", "cut.csv"]).done().contains("declare no design"));
    fs::write(at.join("bad.csv"), text.replacen("{\"\"origin", "{\"\"\"\"origin", 1)).unwrap();
    let refused = run(at, &["stats", "bad.csv"]).refused();
    assert!(refused.contains("`mirrorstats.declared` is not readable"), "{refused}");
}

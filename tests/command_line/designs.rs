//! Designs that cannot bear a plain verdict: `stats`, its sequential form, `report` and `gate` name the reason.

use std::path::PathBuf;

use serde_json::Value;

use crate::run;

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("fixtures/designs")
}

/// Each answer of `stats` to a question has this caveat; `stats --sequential` and `report` have it too.
fn is_named_everywhere(design: &str, question: &str, words: &str) {
    let at = folder();
    let found: Value = run(&at, &["stats", design, "--json"]).json();
    let answers = found["answers"].as_array().unwrap().iter();
    let asked: Vec<&Value> =
        answers.filter(|answer| answer["question"].as_str().unwrap().starts_with(question)).collect();
    assert!(!asked.is_empty(), "{design}: {found}");
    let names =
        |caveats: &Value| caveats.as_array().into_iter().flatten().any(|it| it.as_str().unwrap().contains(words));
    assert!(asked.iter().all(|answer| names(&answer["caveats"])), "{design}: {asked:?}");
    let sequential: Value = run(&at, &["stats", design, "--sequential", "--json"]).json();
    assert!(names(&sequential["caveats"]), "{design}: {sequential}");
    let out = tempfile::tempdir().unwrap();
    let to = out.path().join("report");
    let report = run(&at, &["report", design, "--no-figures", "--out", to.to_str().unwrap()]);
    assert!(report.stderr.contains(words), "{design}: {}", report.stderr);
    let check = run(&at, &["trace", "check", design, "--design"]).ends(1);
    assert!(check.stdout.replace("\n    ", " ").contains(words), "{design}: {}", check.stdout);
}

#[test]
fn every_verdict_names_the_limits_of_its_design() {
    for (design, question, words) in [
        ("agent-across", "Who differs", "are driven differently: agent (11111111, 22222222)"),
        ("all-lost-by-status", "Who", "cannot say for B in E1: all 21 episodes were lost"),
        ("budget-by-model", "Who", "episodes of A end after 20 steps"),
        ("cluster-1-vs-many", "Who", "TSA is 0.104 by episodes and 0.875 by seeds"),
        ("copies-jittered", "Who", "suspected copies"),
        ("cut-early", "Who", "20 of 40 episodes end undecided after 12 to 20 steps"),
        ("human-model-mixture", "Who", "people and programs under one name"),
        ("retry-last-kept", "Who", "scenes are repeated unequally"),
        ("scene-contradiction", "Who", "different body colours under one name"),
        ("simpson-seeds", "Who differs", "divided unequally among seeds"),
    ] {
        is_named_everywhere(design, question, words);
    }
}

#[test]
fn one_name_for_two_recordings_is_not_one_recording() {
    let at = folder();
    let out = tempfile::tempdir().unwrap();
    let to = out.path().join("report");
    for arguments in [
        &["stats", "fingerprint-name-reused"][..],
        &["stats", "fingerprint-name-reused", "--sequential"],
        &["report", "fingerprint-name-reused", "--out", to.to_str().unwrap()],
    ] {
        let error = run(&at, arguments).refused();
        assert!(error.contains("they differ in world (aaaaaaaa, ffffffff)"), "{error}");
    }
    let gate = run(&at, &["gate", "fingerprint-name-reused/1.parquet", "fingerprint-name-reused/2.parquet"]);
    assert!(gate.stdout.contains("stands for different recordings"), "{}", gate.stdout);
}

#[test]
fn recorded_and_reconstructed_episodes_are_not_compared() {
    let found: Value = run(&folder(), &["stats", "reconstruction-mixed", "--json"]).json();
    let answers = found["answers"].as_array().unwrap().iter();
    let who: Vec<&Value> = answers.filter(|it| it["question"].as_str().unwrap().starts_with("Who differs")).collect();
    assert!(!who.is_empty());
    for answer in who {
        assert_eq!(answer["answer"], "E1 not comparable (kind is reconstruction and recording)", "{answer}");
    }
}

#[test]
fn the_gate_lists_a_model_that_lost_every_episode() {
    let trace = "all-lost-by-status/x.parquet";
    let gate = run(&folder(), &["gate", trace, trace, "--format", "json"]).ends(4);
    let found: Value = serde_json::from_str(&gate.stdout).unwrap();
    let of_b = found["cells"].as_array().unwrap().iter().find(|cell| cell["model"] == "B").unwrap();
    assert_eq!((&of_b["verdict"], &of_b["base"]["lost"]), (&"cannot_say".into(), &21.into()), "{of_b}");
    assert_eq!(of_b["why"], "all episodes of BASE were lost (21)");
    let caveats = found["caveats"].to_string();
    assert!(caveats.contains("cannot say for B in E1: all 42 episodes were lost"), "{caveats}");
}

//! Designs that cannot bear a plain verdict: `stats`, its sequential form, `report` and `gate` name the reason.

use std::path::PathBuf;

use serde_json::Value;
use tempfile::TempDir;

use crate::run;

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("fixtures/designs")
}

fn traces(design: &str) -> Vec<String> {
    let files = std::fs::read_dir(folder().join(design)).unwrap().map(|entry| entry.unwrap().path());
    let mut names: Vec<String> = files.map(|file| file.file_stem().unwrap().to_str().unwrap().to_owned()).collect();
    names.sort();
    names
}

/// The scores of each trace of a design in a file of its own.
fn scored(design: &str) -> TempDir {
    let scores = tempfile::tempdir().unwrap();
    for name in traces(design) {
        let to = scores.path().join(format!("{name}.parquet"));
        run(&folder(), &["score", &format!("{design}/{name}.parquet"), "-o", to.to_str().unwrap()]).done();
    }
    scores
}

fn answers(inputs: &str, question: &str) -> Vec<Value> {
    let found: Value = run(&folder(), &["stats", inputs, "--json"]).json();
    let answers = found["answers"].as_array().unwrap().iter();
    answers.filter(|it| it["question"].as_str().unwrap().starts_with(question)).cloned().collect()
}

/// Each answer of `stats` to a question has this caveat, of traces as of scores; `stats --sequential`, `report` and `gate`
/// have it too.
fn is_named_everywhere(design: &str, question: &str, words: &str) {
    let at = folder();
    let scores = scored(design);
    let scores = scores.path().to_str().unwrap();
    let names =
        |caveats: &Value| caveats.as_array().into_iter().flatten().any(|it| it.as_str().unwrap().contains(words));
    for inputs in [design, scores] {
        let asked = answers(inputs, question);
        assert!(!asked.is_empty(), "{inputs}");
        assert!(asked.iter().all(|answer| names(&answer["caveats"])), "{inputs}: {asked:?}");
        let sequential: Value = run(&at, &["stats", inputs, "--sequential", "--json"]).json();
        assert!(names(&sequential["caveats"]), "{inputs}: {sequential}");
    }
    let out = tempfile::tempdir().unwrap();
    let to = out.path().join("report");
    let report = run(&at, &["report", design, "--out", to.to_str().unwrap()]).ends(0);
    assert!(report.stderr.contains(words), "{design}: {}", report.stderr);
    let check = run(&at, &["trace", "check", design, "--design"]).ends(1);
    assert!(check.stdout.replace("\n    ", " ").contains(words), "{design}: {}", check.stdout);
}

#[test]
fn every_verdict_names_the_limits_of_its_design() {
    for (design, question, words) in [
        ("agent-across", "Who differs", "are driven differently: agent (11111111, 22222222)"),
        ("all-lost-by-status", "Who", "cannot say for B in E1: all 21 episodes were lost"),
        ("below-by-silence", "Who is above", "E1 A: no decision made in 21 episodes"),
        ("budget-by-model", "Who", "episodes of A end after 20 steps"),
        ("cluster-1-vs-many", "Who", "TSA is 0.104 by episodes and 0.875 by seeds"),
        ("copies-jittered", "Who", "suspected copies"),
        ("cut-early", "Who", "20 of 40 episodes end undecided after 12 to 20 steps"),
        ("human-model-mixture", "Who", "people and programs under one name"),
        ("reconstruction-mixed", "Who", "episodes of different kinds: reconstruction and recording"),
        ("retry-last-kept", "Who", "scenes are repeated unequally"),
        ("scene-contradiction", "Who", "different body colours under one name"),
        ("simpson-seeds", "Who differs", "divided unequally among seeds"),
    ] {
        is_named_everywhere(design, question, words);
    }
}

fn gate(base: &str, new: &str, more: &[&str]) -> Value {
    let gate = run(&folder(), &[&["gate", base, new, "--format", "json"], more].concat());
    serde_json::from_str(&gate.stdout).unwrap_or_else(|_| panic!("{base} {new}: {} {}", gate.stdout, gate.stderr))
}

#[test]
fn the_gate_names_the_limits_of_a_design_too() {
    for (base, new, words) in [
        ("agent-across/A", "agent-across/B", "driven differently: agent (11111111, 22222222)"),
        ("below-by-silence/x", "below-by-silence/x", "no decision made in 21 episodes"),
        ("budget-by-model/A", "budget-by-model/B", "end after 20 steps"),
        ("cluster-1-vs-many/x", "cluster-1-vs-many/x", "TSA is 0.104 by episodes and 0.875 by seeds"),
        ("copies-jittered/x", "copies-jittered/x", "suspected copies"),
        ("cut-early/x", "cut-early/x", "20 of 40 episodes end undecided after 12 to 20 steps"),
        ("human-model-mixture/x", "human-model-mixture/x", "people and programs under one name"),
        ("retry-last-kept/x", "retry-last-kept/x", "scenes are repeated unequally"),
        ("scene-contradiction/x", "scene-contradiction/x", "different body colours under one name"),
    ] {
        let design = base.split('/').next().unwrap();
        let scores = scored(design);
        let score = |name: &str| scores.path().join(format!("{}.parquet", name.split('/').nth(1).unwrap()));
        let of_traces = gate(&format!("{base}.parquet"), &format!("{new}.parquet"), &[]);
        let of_scores = gate(score(base).to_str().unwrap(), score(new).to_str().unwrap(), &[]);
        for found in [of_traces, of_scores] {
            assert!(found["caveats"].to_string().contains(words), "{design}: {found}");
        }
    }
    let mixed = gate("reconstruction-mixed/A.parquet", "reconstruction-mixed/B.parquet", &[]);
    assert_eq!(mixed["verdict"], "not_comparable", "{mixed}");
}

#[test]
fn a_scene_counts_once_however_often_it_failed() {
    let scores = scored("direction-by-unit");
    for inputs in ["direction-by-unit", scores.path().to_str().unwrap()] {
        let above = answers(inputs, "Who is above");
        assert!(
            above[0]["answer"].as_str().unwrap().starts_with("E1 A (0.875 by scene, 7/27 by episode)"),
            "{above:?}"
        );
        let who = answers(inputs, "Who differs");
        assert!(who.iter().all(|it| !it["answer"].as_str().unwrap().contains("better")), "{who:?}");
        assert_eq!(who.last().unwrap()["answer"], "E1 not tested");
    }
    let found = gate("direction-gate-base/x.parquet", "direction-gate-new/x.parquet", &[]);
    assert_eq!((&found["verdict"], &found["cells"][0]["difference"]), (&"held".into(), &0.75.into()), "{found}");
}

#[test]
fn one_person_is_one_unit() {
    let files = ["base", "new"].map(|name| format!("gate-one-participant/{name}.parquet"));
    let found = gate(&files[0], &files[1], &[]);
    let why = "1 participant against 21 episodes: no test compares them";
    assert_eq!((&found["verdict"], &found["cells"][0]["why"]), (&"cannot_say".into(), &why.into()), "{found}");
    let who = answers("gate-one-participant", "Who differs");
    assert!(who[0]["answer"].as_str().unwrap().contains("cannot say: 1 participant"), "{who:?}");
}

#[test]
fn a_metric_that_the_outcome_selects_has_no_verdict() {
    let selected = "defined in 30 of 30 against 10 of 30";
    let found: Value = run(&folder(), &["stats", "conditional-on-success", "--json"]).json();
    let models = found["models"].as_array().unwrap();
    let family = models.iter().find(|family| family["metric"] == "MTATO").unwrap();
    let test = &family["tests"][0];
    assert!(test["p"].is_null() && test["separated"] == false, "{test}");
    assert!(test["selected"].as_str().unwrap().starts_with(selected), "{test}");
    let out = tempfile::tempdir().unwrap();
    let to = out.path().join("report");
    run(&folder(), &["report", "conditional-on-success", "--no-figures", "--out", to.to_str().unwrap()]).done();
    let ranks = std::fs::read_to_string(to.join("tables/ranks.csv")).unwrap();
    assert!(ranks.contains(",TSA,") && !ranks.contains(",MTATO,"), "{ranks}");
}

#[test]
fn opposite_effects_are_no_effect_over_all() {
    let who = answers("opposite-effects", "Who differs");
    let answer = who[0]["answer"].as_str().unwrap();
    let over_all = answer.split("over all experiments ").nth(1).unwrap();
    assert!(over_all.starts_with("nobody") && over_all.contains("cannot say for A and B: opposite in E2"), "{answer}");
}

#[test]
fn a_small_side_that_met_no_late_end_is_no_faster() {
    let who = answers("unequal-n-durations", "Who differs");
    let of_steps = who.iter().find(|it| it["metric"] == "TTD").unwrap();
    assert!(of_steps["answer"].as_str().unwrap().starts_with("E1 nobody"), "{of_steps}");
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
    let scores = scored("fingerprint-name-reused");
    let error = run(&at, &["stats", scores.path().to_str().unwrap()]).refused();
    assert!(error.contains("they differ in world (aaaaaaaa, ffffffff)"), "{error}");
    for inputs in ["fingerprint-name-reused", scores.path().to_str().unwrap()] {
        let gate = run(&at, &["gate", &format!("{inputs}/1.parquet"), &format!("{inputs}/2.parquet")]);
        assert!(gate.stdout.contains("stands for different recordings"), "{}", gate.stdout);
    }
}

#[test]
fn recorded_and_reconstructed_episodes_are_not_compared() {
    let scores = scored("reconstruction-mixed");
    for inputs in ["reconstruction-mixed", scores.path().to_str().unwrap()] {
        let who = answers(inputs, "Who differs");
        assert!(!who.is_empty());
        for answer in who {
            assert_eq!(answer["answer"], "E1 not comparable (kind is reconstruction and recording)", "{answer}");
        }
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

//! The files of a bundle, and what is left out of it.

use std::fs;
use std::path::Path;

use mirrorstats_trace::episodes::episode::{Action, Step};
use mirrorstats_trace::write::OptionalColumns;
use serde_json::{Value, json};

use crate::harness::files::{assert_same, contents, fixture, repository};
use crate::harness::program::run;
use crate::harness::traces::{episode, write_trace};
use crate::publish::{named, published};

#[test]
fn a_bundle_is_the_same_in_every_folder_and_verifies_elsewhere() {
    let [one, other] = [published("all"), published("all")];
    let files = contents(&one.path().join("out"));
    assert_same(&files, &contents(&other.path().join("out")));
    let here = one.path().display().to_string();
    for (name, bytes) in &files {
        assert!(!String::from_utf8_lossy(bytes).contains(&here), "{name} has a path of this machine");
    }
    for name in [
        "README.md",
        "CITATION.cff",
        "croissant.json",
        "scores.parquet",
        "definitions/mine.toml",
        "experiments/E1.json",
        "world/world.json",
        "prompts/cube-selection/system.txt",
        "frames/E1-guesser.parquet",
        "traces/E1-guesser.mcap",
        "report/report.html",
        "viewer/index.html",
        "report/figures/spider.svg",
    ] {
        assert!(files.contains_key(name), "{name} is missing");
    }
    let moved = tempfile::tempdir().unwrap();
    fs::rename(one.path().join("out"), moved.path().join("out")).unwrap();
    let told = run(moved.path(), &["verify", "out"]).done();
    assert!(told.ends_with("files are as the manifest says; all numbers of 4 episodes are equal\n"), "{told}");
    // A bundle is read as traces, too.
    let told = run(moved.path(), &["trace", "info", "out"]).done();
    assert!(told.starts_with("4 episodes, 17 steps, 2 files"), "{told}");
}

#[test]
fn frames_are_left_out_or_those_that_decided() {
    let files = |frames: &str| {
        let folder = published(frames);
        assert_eq!(named(folder.path()), (0, Vec::new()), "{frames}");
        (contents(&folder.path().join("out")), folder)
    };
    let (none, folder) = files("none");
    assert!(!none.keys().any(|name| name.contains(".mcap") || name.starts_with("frames/")));
    let manifest: Value = serde_json::from_slice(&none["manifest.json"]).unwrap();
    let withheld = &manifest["settings"]["withheld"][0];
    let log = fs::read(folder.path().join("runs/E1-guesser.mcap")).unwrap();
    assert_eq!(withheld["kind"], "log");
    assert_eq!(withheld["sha256"], mirrorstats_exact::hash::of_bytes(&log));
    let (decisive, _) = files("decisive");
    assert!(decisive.contains_key("frames/E1-guesser.parquet") && !decisive.contains_key("traces/E1-guesser.mcap"));
    assert!(decisive["frames/E1-guesser.parquet"].len() <= files("all").0["frames/E1-guesser.parquet"].len());
}

#[test]
fn people_who_declined_or_withdrew_are_not_in_it() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let of = |code: &str, run| {
        let steps = vec![Step { action: Some(Action::Done), ..Step::default() }];
        let mut episode = episode(&format!("E1/human/{code}"), steps);
        (episode.participant, episode.run) = (Some(code.to_owned()), run);
        episode.episode_hash = Some("computed by the writer".to_owned());
        episode
    };
    let people: Vec<_> = (1..).zip(["P1", "P2", "P3", "P4"]).map(|(run, code)| of(code, run)).collect();
    fs::create_dir(at.join("runs")).unwrap();
    write_trace(
        &at.join("runs/human.parquet"),
        &people,
        OptionalColumns::named(&["participant", "episode_hash"]).unwrap(),
    );
    let line = |code: &str, left: &str| format!("{}\n", json!({"participant": code, "left": left}));
    let journal = line("P1", "stopped") + &line("P2", "deleted") + &line("P3", "declined") + "{\"participant\":\"P4";
    fs::write(at.join("runs/participants.jsonl"), journal).unwrap();
    let label =
        |code: &str| format!("{}\n", json!({"episode_id": format!("E1/human/{code}"), "coder": "c", "label": "odd"}));
    fs::write(at.join("runs/labels.jsonl"), label("P1") + &label("P2")).unwrap();
    let answer = run(at, &["publish", "runs", "-o", "out", "--json"]).json();
    assert_eq!((&answer["episodes"], answer["withheld"].as_array().unwrap().len()), (&json!(2), 2));
    let files = contents(&at.join("out"));
    for (name, bytes) in &files {
        let text = String::from_utf8_lossy(bytes);
        assert!(!text.contains("E1/human/P2") && !text.contains("E1/human/P3"), "{name} names a person who left");
    }
    assert!(!files.contains_key("traces/participants.jsonl"));
    assert_eq!(named(at), (0, Vec::new()));
}

#[test]
fn a_bundle_replaces_a_bundle_and_nothing_else() {
    let folder = published("none");
    let at = folder.path();
    fs::create_dir(at.join("other")).unwrap();
    fs::write(at.join("other/notes.txt"), "mine").unwrap();
    let told = run(at, &["publish", "runs", "-o", "other"]).refused();
    assert!(told.contains("expected a new folder or an earlier bundle"), "{told}");
    run(at, &["publish", "runs/E3-random.parquet", "-o", "out"]).done();
    assert!(!at.join("out/traces/E1-guesser.parquet").exists());
    assert_eq!(named(at), (0, Vec::new()));
    for (text, expected) in [
        ("titel = \"a\"", "unknown field `titel`"),
        ("license = \"all rights reserved\"", "no SPDX identifier"),
        ("authors = 3", "invalid type"),
    ] {
        fs::write(at.join("about.toml"), text).unwrap();
        let told = run(at, &["publish", "runs", "-o", "new", "--about", "about.toml"]).refused();
        assert!(told.contains(expected) && told.contains("about.toml"), "{told}");
    }
    assert!(!Path::new(&at.join("new")).exists());
    let told = run(at, &["verify", fixture("recorded").to_str().unwrap()]).refused();
    assert!(told.contains("manifest.json"), "{told}");
}

/// Equal names of scenes are a claim, in logs of others; recordings prove it.
#[test]
fn pairs_are_proven_or_claimed() {
    let folder = published("none");
    let at = folder.path();
    let readme = |out: &str| fs::read_to_string(at.join(out).join("README.md")).unwrap();
    let recorded = fixture("recorded").display().to_string();
    run(at, &["publish", &recorded, "-o", "recorded", "--frames", "none"]).done();
    let expected = "Comparisons by scene: pairs proven in 10 of 10 scenes: their first observations are alike.";
    assert!(readme("recorded").contains(expected), "{}", readme("recorded"));
    assert!(!run(at, &["stats", &recorded]).stderr.contains("pairs claimed"));
    let steps: Vec<String> = ["act", "diffusion"]
        .iter()
        .flat_map(|model| (1..=3).map(move |run| (model, run)))
        .map(|(model, run)| {
            json!({
                "episode_id": format!("{model}-{run}"), "t": 1, "model": model, "experiment": "pusht", "seed": 1,
                "run": run, "scene": format!("s{run}"), "task": "push", "reward": 0.5, "action": 7,
                "action_change": 0.25, "success": run > 1,
            })
        })
        .map(|step| format!("{step}\n"))
        .collect();
    fs::write(at.join("steps.jsonl"), steps.concat()).unwrap();
    let definitions = repository().join("examples/domains/robots.toml").display().to_string();
    run(at, &["import", "steps.jsonl", "-o", "robots.parquet", "--definitions", &definitions]).done();
    let note =
        "note: pairs claimed, not proven: 1 of 1 file with scenes have no digest of the first observation or state";
    assert!(run(at, &["stats", "robots.parquet"]).stderr.contains(note));
    assert!(run(at, &["gate", "robots.parquet", "robots.parquet"]).stderr.contains(note));
    run(at, &["publish", "robots.parquet", "-o", "robots"]).done();
    assert!(readme("robots").contains("pairs claimed, not proven, in 3 of 3 scenes"), "{}", readme("robots"));
}

//! Copies of episodes under other ids: `validate` names them, and so does every verdict that counts them.

use std::path::Path;

use mirrorstats_trace::episodes::episode::Episode;
use mirrorstats_trace::write::write_episodes;
use serde_json::Value;

use crate::{episode, run};

/// Eight episodes of each of two models, and `copies` copies of the first model's last episode under other ids.
fn trace(path: &Path, copies: i32) {
    let choice = |run: i32| if run % 3 == 0 { "blue" } else { "red" };
    let mut episodes: Vec<Episode> = (0..8).map(|run| episode("ant", "E1", run, choice(run))).collect();
    episodes.extend((0..8).map(|run| episode("bee", "E1", run, "blue")));
    for at in 0..copies {
        episodes.push(Episode { episode_id: format!("copy-{at}"), ..episodes[7].clone() });
    }
    write_episodes(path, None, &episodes).unwrap();
}

#[test]
fn validate_names_the_copies_of_episodes() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    trace(&at.join("whole.parquet"), 0);
    trace(&at.join("twice.parquet"), 2);
    assert!(!run(at, &["trace", "validate", "whole.parquet"]).done().contains("copied"));
    let report: Value = run(at, &["trace", "validate", "twice.parquet", "--json"]).json();
    let findings: Vec<&Value> = report["findings"].as_array().unwrap().iter().collect();
    let copies: Vec<_> = findings.iter().filter(|finding| finding["code"] == "copied-episode").collect();
    let ids: Vec<_> = copies.iter().map(|finding| finding["episode"].as_str().unwrap()).collect();
    assert_eq!(ids, ["copy-0", "copy-1"]);
    assert_eq!(copies[0]["found"], "those of `E1-ant-7` in all columns but the id");
    assert_eq!(copies[0]["severity"], "note");
    // An episode that differs in one step is not a copy.
    let mut other = episode("ant", "E1", 7, "red");
    other.steps[0].self_color = None;
    let other = Episode { episode_id: "other".into(), ..other };
    write_episodes(&at.join("other.parquet"), None, &[episode("ant", "E1", 7, "red"), other]).unwrap();
    assert!(!run(at, &["trace", "validate", "other.parquet"]).done().contains("copied"));
}

#[test]
fn no_verdict_counts_copies_without_saying_so() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    trace(&at.join("whole.parquet"), 0);
    trace(&at.join("twice.parquet"), 2);
    let whole: Value = run(at, &["stats", "whole.parquet", "--json"]).json();
    assert!(!whole.to_string().contains("cop"), "{whole}");
    let twice: Value = run(at, &["stats", "twice.parquet", "--json"]).json();
    for answer in twice["answers"].as_array().unwrap() {
        let caveats = answer["caveats"].as_array().unwrap();
        assert!(caveats.contains(&"2 episodes are copies of others".into()), "{answer}");
    }
    let sentence = "2 episodes are copies of others under another id (`copy-0` of `E1-ant-7`; `copy-1` of `E1-ant-7`): every \
                    number and test counts them as independent; leave them out.";
    assert!(twice["warnings"].as_array().unwrap().contains(&sentence.into()), "{twice}");
    let report = run(at, &["report", "twice.parquet", "--no-figures", "--out", "report"]).ends(0);
    assert!(format!("{}{}", report.stdout, report.stderr).contains("2 episodes are copies"), "{}", report.stderr);
    let gate = run(at, &["gate", "whole.parquet", "twice.parquet", "--metric", "TSA", "--format", "json"]);
    let gate: Value = serde_json::from_str(&gate.stdout).unwrap();
    assert!(gate["caveats"].to_string().contains("new: 2 episodes are copies of others"), "{gate}");
}

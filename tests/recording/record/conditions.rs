//! Recordings that differ: named conditions, fingerprints of everything else, and cells that do not mix them.

use std::fs;

use arrow::array::AsArray as _;
use serde_json::Value;

use super::recordings::Bench;
use crate::harness::files::{fixture, write_small_world};
use crate::harness::program::run;
use crate::harness::traces::{column, recording, rows};

/// The distinct texts of a trace's column.
fn texts(bench: &Bench, name: &str, of: &str) -> Vec<String> {
    let rows = rows(&bench.path(name));
    let column = column(&rows, of);
    let mut texts: Vec<String> =
        column.as_string::<i32>().iter().map(|text| text.unwrap_or("null").to_owned()).collect();
    texts.sort();
    texts.dedup();
    texts
}

/// Two recordings without a common episode: a mirror 3 m wide, and one 1.2 m wide.
fn two_worlds(words: [&str; 2]) -> Bench {
    let bench = Bench::new();
    let common = "--agent random --experiment E1 --seeds 1 --runs 4 --no-log";
    bench.recorded("wide", &format!("{common} --shard 1/2 {}", words[0]));
    write_small_world(bench.folder.path(), "mirror.width = 1.2\n");
    bench.recorded("narrow", &format!("{common} --shard 2/2 {}", words[1]));
    bench
}

#[test]
fn episodes_of_two_worlds_are_not_pooled_unawares() {
    let bench = two_worlds(["", ""]);
    let at = bench.folder.path();
    for verb in [["report", "--out", "out"].as_slice(), &["stats"], &["figure", "intervals"]] {
        let message = run(at, &[verb, &["wide", "narrow"]].concat()).refused();
        assert!(message.contains("E1, random: expected episodes that were recorded alike, found 2 of"), "{message}");
        assert!(message.contains("world.mirror.width is ") && message.contains("--condition NAME"), "{message}");
    }
    assert!(!bench.path("out").exists());
    run(at, &["report", "wide", "narrow", "--out", "out", "--pool"]).done();
    // Files of scores record the difference too, and name its part.
    run(at, &["score", "wide", "narrow", "-o", "scores.parquet"]).done();
    let message = run(at, &["stats", "scores.parquet"]).refused();
    assert!(message.contains("they differ in world"), "{message}");
    let [wide] = &texts(&bench, "wide/E1-random.parquet", "fingerprint")[..] else { panic!("one fingerprint") };
    let some = format!("fingerprint = '{wide}'");
    let found: Value = run(at, &["stats", "wide", "narrow", "--where", &some, "--json"]).json();
    assert_eq!(found["episodes"], 2);
    let parts = &recording(&bench.path("wide/E1-random.parquet"))["fingerprints"][wide];
    assert_eq!(parts["world"].as_str().unwrap().len(), 64);
    assert!(parts["model"].is_null() && parts["prompts"].is_null());
}

#[test]
fn a_condition_is_a_column_of_traces_tables_and_figures() {
    let bench = two_worlds(["", "--condition narrow --model Stroller"]);
    let at = bench.folder.path();
    assert_eq!(texts(&bench, "narrow/E1-stroller@narrow.parquet", "model"), ["Stroller"]);
    let ids = texts(&bench, "narrow/E1-stroller@narrow.parquet", "episode_id");
    assert_eq!(ids, ["E1/stroller@narrow/s1/r2", "E1/stroller@narrow/s1/r4"]);
    run(at, &["report", "wide", "narrow", "--out", "out"]).done();
    let cells = fs::read_to_string(bench.path("out/cells.csv")).unwrap();
    assert!(cells.starts_with("experiment,model,condition,metric,"), "{cells}");
    assert!(cells.contains("E1,Stroller,narrow,TSA,2,") && cells.contains("E1,random,default,TSA,2,"), "{cells}");
    let table = fs::read_to_string(bench.path("out/tables/main.md")).unwrap();
    assert!(table.contains("condition narrow"), "{table}");
    let figure = fs::read_to_string(bench.path("out/figures/intervals.svg")).unwrap();
    assert!(figure.contains("Stroller [narrow]"));
    // If every condition is the default, tables have no such column unless asked.
    run(at, &["report", "wide", "--out", "plain"]).done();
    assert!(!fs::read_to_string(bench.path("plain/cells.csv")).unwrap().contains("condition"));
    run(at, &["report", "wide", "--out", "asked", "--by", "experiment,condition"]).done();
    assert!(fs::read_to_string(bench.path("asked/cells.csv")).unwrap().contains("E1,default,TSA,2,"));
    // A trace without the column has the default condition.
    let glimpses = fixture("glimpses.parquet").display().to_string();
    assert!(run(at, &["score", &glimpses]).done().starts_with("episode_id,model,experiment,seed,run,TSA,"));
    assert!(
        run(at, &["score", "wide"])
            .done()
            .starts_with("episode_id,model,experiment,seed,run,scene,fingerprint,unusable_replies,TSA,")
    );
    // Older and newer traces together, and files of scores made from either.
    let both = run(at, &["score", &glimpses, "narrow"]).done();
    assert!(
        both.starts_with(
            "episode_id,model,experiment,seed,run,condition,scene,fingerprint,origin,unusable_replies,TSA,"
        ),
        "{both}"
    );
    run(at, &["score", &glimpses, "-o", "old.csv"]).done();
    run(at, &["score", "narrow", "-o", "new.csv"]).done();
    assert_eq!(run(at, &["score", "old.csv", "new.csv"]).done().lines().count(), both.lines().count());
    run(at, &["stats", "old.csv", "new.csv"]).done();
    let by = run(at, &["stats", &glimpses, "--by", "experiment,condition", "--json"]).json();
    assert_eq!(by["cells"][0]["key"]["condition"], "default");
}

#[test]
fn conditions_have_separate_files_and_different_recordings_do_not_mix() {
    let bench = Bench::new();
    let words = "--agent random --experiment E1 --seeds 1 --no-log";
    bench.recorded("runs", &format!("{words} --runs 1"));
    bench.recorded("runs", &format!("{words} --runs 1 --condition near"));
    let names: Vec<String> = bench.files("runs").keys().cloned().collect();
    assert_eq!(names, ["E1-random.parquet", "E1-random@near.parquet"]);
    write_small_world(bench.folder.path(), "mirror.width = 1.2\n");
    let before = bench.files("runs");
    let again = bench.record("runs", &format!("{words} --runs 2")).output().unwrap();
    assert_eq!(again.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&again.stderr).contains("mirror.width"), "{again:?}");
    assert_eq!(bench.files("runs"), before);
    for name in ["", "default", " near", "a\u{1b}b"] {
        let answer = run(bench.folder.path(), &["record", "--agent", "random", "--condition", name]);
        assert_eq!(answer.code, 2, "{name:?}");
    }
}

#[test]
fn scenes_are_shared_by_the_first_three_experiments_and_by_all_agents() {
    let bench = Bench::new();
    let words = "--experiment E1..E4 --seeds 1 --runs 3 --no-log";
    bench.recorded("random", &format!("--agent random {words}"));
    bench.recorded("frozen", &format!("--agent frozen {words}"));
    let scenes =
        |agent: &str, experiment: &str| texts(&bench, &format!("{agent}/{experiment}-{agent}.parquet"), "scene");
    let first = scenes("random", "E1");
    assert_eq!(first.len(), 3, "{first:?}");
    for experiment in ["E2", "E3"] {
        assert_eq!(scenes("random", experiment), first);
    }
    assert_eq!(scenes("frozen", "E1"), first);
    assert!(scenes("random", "E4").iter().all(|scene| !first.contains(scene)));
    assert_eq!(scenes("frozen", "E4"), scenes("random", "E4"));
    assert_eq!(texts(&bench, "random/E1-random.parquet", "decision"), ["selected_cube"]);
}

#[test]
fn flips_between_repeats_of_a_scene_are_the_noise_floor() {
    let bench = Bench::new();
    let words = "--agent random --experiment E1,E3 --seeds 1 --runs 3";
    bench.recorded("once", &format!("{words} --no-log"));
    let files = bench.recorded("again", &format!("{words} --repeats 3"));
    assert_eq!(bench.recorded("again", &format!("{words} --repeats 3")), files);
    let trace = "again/E1-random.parquet";
    let ids = texts(&bench, trace, "episode_id");
    assert_eq!((ids.len(), ids[0].as_str(), ids[1].as_str()), (9, "E1/random/s1/r1", "E1/random/s1/r1/x2"));
    assert_eq!(texts(&bench, trace, "scene"), texts(&bench, "once/E1-random.parquet", "scene"));
    // The first repeat equals the recording without repeats; the agent's random draws differ between repeats.
    let actions = |name: &str, id: &str| {
        let rows = rows(&bench.path(name));
        let (ids, actions) = (column(&rows, "episode_id"), column(&rows, "action"));
        let of_id = ids.as_string::<i32>().iter().zip(actions.as_string::<i32>().iter());
        of_id.filter(|(own, _)| *own == Some(id)).map(|(_, action)| action.map(str::to_owned)).collect::<Vec<_>>()
    };
    assert_eq!(actions(trace, &ids[0]), actions("once/E1-random.parquet", &ids[0]));
    assert_ne!(actions(trace, &ids[0]), actions(trace, &ids[1]));
    let at = bench.folder.path();
    run(at, &["world", "replay", "again/E1-random.parquet"]).done();
    let stats: Value = run(at, &["stats", "again", "--json"]).json();
    let retest = stats["retests"].as_array().unwrap().iter().find(|row| row["metric"] == "TSA").unwrap();
    assert_eq!((retest["scenes"].as_u64(), retest["episodes"].as_u64()), (Some(3), Some(9)));
    let flipped = retest["flipped"].as_f64().unwrap();
    let unstable = retest["unstable"].as_f64().unwrap();
    // Of three repeats with two outcomes, two of the three pairs differ.
    assert!((flipped - unstable * 2.0 / 3.0 / 3.0).abs() < 1e-12, "{retest}");
    assert!(run(at, &["stats", "once", "--json"]).json()["retests"].as_array().unwrap().is_empty());
}

#[test]
fn a_registered_plan_is_in_the_trace_and_reports_say_whether_it_was_followed() {
    let bench = Bench::new();
    let at = bench.folder.path();
    let plan = ["plan", "--difference", "0.5", "--register", "plan.json", "--config", "small.toml"];
    run(at, &plan).done();
    let registered: Value = serde_json::from_str(&fs::read_to_string(bench.path("plan.json")).unwrap()).unwrap();
    assert_eq!(registered["prompts"].as_array().unwrap().len(), 2);
    let words = "--agent random --experiment E1 --seeds 1 --runs 2 --no-log --plan plan.json";
    bench.recorded("runs", words);
    let carried = recording(&bench.path("runs/E1-random.parquet"))["registration"].clone();
    assert_eq!(carried["sha256"], registered["sha256"]);
    let followed = run(at, &["report", "runs", "--out", "out"]).ends(0).stderr;
    assert!(
        followed.contains("follows the registered plan") && followed.contains("are those that it names"),
        "{followed}"
    );
    let other = run(at, &["report", "runs", "--out", "out", "--definitions", "extended"]).ends(0).stderr;
    assert!(other.contains("differ from those that it names"), "{other}");
    // Another plan, or no plan, does not continue the recording. A changed plan and another world are refused.
    let refused = |out: &str, words: &str| {
        let answer = bench.record(out, words).output().unwrap();
        assert_eq!(answer.status.code(), Some(2), "{answer:?}");
        String::from_utf8(answer.stderr).unwrap()
    };
    assert!(refused("runs", &words.replace(" --plan plan.json", "")).contains("registration"));
    write_small_world(at, "mirror.width = 1.2\n");
    assert!(refused("other", words).contains("expected the world as registered"));
    let changed = fs::read_to_string(bench.path("plan.json")).unwrap().replacen("0.5", "0.4", 1);
    fs::write(bench.path("plan.json"), changed).unwrap();
    assert!(refused("other", words).contains("changed after it was registered"));
    assert!(!bench.path("other/E1-random.parquet").exists());
}

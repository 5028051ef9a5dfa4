//! Recordings that differ: a name for what a study varies, fingerprints of the rest, and cells that do not mix them.

use std::fs;

use arrow::array::AsArray as _;
use serde_json::Value;

use super::recordings::Bench;
use crate::harness::files::{fixture, write_small_world};
use crate::harness::program::run;
use crate::harness::traces::{column, recording, rows};

/// The different texts of a column of a trace.
fn texts(bench: &Bench, name: &str, of: &str) -> Vec<String> {
    let rows = rows(&bench.path(name));
    let column = column(&rows, of);
    let mut texts: Vec<String> =
        column.as_string::<i32>().iter().map(|text| text.unwrap_or("null").to_owned()).collect();
    texts.sort();
    texts.dedup();
    texts
}

/// Two recordings that share no episode: the mirror 3 m wide, and 1.2 m.
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
    // Files of scores know it, too, and say in which part.
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
    // Where all is the default one, no table has the column; asked for, it is there.
    run(at, &["report", "wide", "--out", "plain"]).done();
    assert!(!fs::read_to_string(bench.path("plain/cells.csv")).unwrap().contains("condition"));
    run(at, &["report", "wide", "--out", "asked", "--by", "experiment,condition"]).done();
    assert!(fs::read_to_string(bench.path("asked/cells.csv")).unwrap().contains("E1,default,TSA,2,"));
    // A trace without the column means the default condition.
    let glimpses = fixture("glimpses.parquet").display().to_string();
    let by = run(at, &["stats", &glimpses, "--by", "experiment,condition", "--json"]).json();
    assert_eq!(by["cells"][0]["key"]["condition"], "default");
}

#[test]
fn one_folder_holds_conditions_apart_and_does_not_mix_two_recordings_of_one() {
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

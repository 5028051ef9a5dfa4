//! The last line of `record`: a working command that scores the episodes as their experiments say.

use std::fs;
use std::process::Command;

use serde_json::Value;

use super::recordings::Bench;
use crate::harness::program::{PROGRAM, run, stderr, succeeds};
use crate::harness::traces::recording;

/// Runs every command that a recording suggests next, and counts them.
fn typed(bench: &Bench, said: &str) -> usize {
    let (_, next) = said.split_once("next: ").unwrap_or_else(|| panic!("{said}"));
    let commands = next.lines().map(str::trim).take_while(|line| line.starts_with("mirrorstats "));
    let quoted = PROGRAM.replace('\'', r"'\''");
    let type_one = |line: &str| {
        let line = line.replacen("mirrorstats", &format!("'{quoted}'"), 1);
        let output = Command::new("sh").args(["-c", &line]).current_dir(bench.folder.path()).output().unwrap();
        assert!(output.status.success(), "{line}: {}", stderr(&output));
    };
    commands.map(type_one).count()
}

/// The number of episodes that a metric of a report counts.
fn cell(bench: &Bench, report: &str, metric: &str) -> String {
    let cells = fs::read_to_string(bench.path(report).join("cells.csv")).unwrap();
    let name = format!(",{metric},");
    let row = cells.lines().find_map(|row| row.split_once(&name)).unwrap_or_else(|| panic!("{cells}"));
    row.1.split(',').next().unwrap().to_owned()
}

#[test]
fn the_printed_next_command_reports_with_the_right_definitions() {
    let bench = Bench::new();
    let said = succeeds(&mut bench.record("marks", "--agent oracle --experiment mark --seeds 1 --runs 2 --no-log"));
    let footer = recording(&bench.path("marks/mark-oracle.parquet"));
    assert_eq!(footer["experiment"]["definitions"], "battery");
    assert_eq!(typed(&bench, &stderr(&said)), 1);
    let manifest: Value =
        serde_json::from_str(&fs::read_to_string(bench.path("reports/latest/manifest.json")).unwrap()).unwrap();
    assert_eq!(manifest["definitions"]["name"], "battery");
    assert_eq!(cell(&bench, "reports/latest", "TSA"), "2");

    let both = "--agent oracle --experiment E1,mark,reach-hand --seeds 1 --runs 1 --no-log";
    let said = succeeds(bench.record("my runs", "").args(both.split(' ')));
    assert_eq!(typed(&bench, &stderr(&said)), 2);
    assert_eq!(cell(&bench, "reports/battery", "TSA"), "1");
    assert_eq!(cell(&bench, "reports/reach", "SUCCESS"), "1");
}

#[test]
fn the_printed_next_command_names_a_custom_definition_file() {
    let bench = Bench::new();
    fs::create_dir(bench.path("files")).unwrap();
    let experiment = "[experiment.mine]\ntitle = 'Mine'\nscenes = 'E1'\nprompt = 'cube-selection'\ndefinitions = 'own.toml'\n\
                      [[experiment.mine.mirror]]\n";
    fs::write(bench.path("files/mine.toml"), experiment).unwrap();
    let refused = run(bench.folder.path(), &["experiments", "check", "files/mine.toml"]).refused();
    assert!(refused.contains("own.toml") && refused.contains("a path relative to this file"), "{refused}");
    fs::write(bench.path("files/own.toml"), "include = ['paper']\n[metric.LONG]\nvalue = 'length()'\n").unwrap();
    let words = "--agent random --experiment files/mine.toml --seeds 1 --runs 1 --no-log";
    let said = stderr(&succeeds(&mut bench.record("runs", words)));
    assert!(said.contains("next: mirrorstats report runs --definitions files/own.toml\n"), "{said}");
    let footer: Value = recording(&bench.path("runs/mine-random.parquet"));
    assert_eq!(footer["experiment"]["definitions_hash"].as_str().map(str::len), Some(64));
    assert_eq!(typed(&bench, &said), 1);
    // Other definitions for the same experiment change no episode, so the recording continues.
    fs::write(bench.path("files/own.toml"), "include = ['paper']\n").unwrap();
    succeeds(&mut bench.record("runs", &words.replace("--runs 1", "--runs 2")));
}

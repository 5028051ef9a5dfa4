//! The rooms of the house: who may import from whom, read off the `use` lines of the sources.

use std::fs;
use std::path::{Path, PathBuf};

/// From the top to the bottom: a room imports from the rooms below it alone.
const ROOMS: [&str; 14] = [
    "cli", "study", "record", "replay", "agent", "sim", "log", "report", "engine", "cells", "score", "metric", "trace",
    "base",
];

/// Every source file of a room.
fn files(room: &str) -> Vec<PathBuf> {
    fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                walk(&path, found);
            } else if path.extension().is_some_and(|ending| ending == "rs") {
                found.push(path);
            }
        }
    }
    let mut found = Vec::new();
    walk(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src").join(room), &mut found);
    assert!(!found.is_empty(), "the room {room} is empty");
    found
}

/// The code of a file, its tests and comments left out.
fn code(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    let code = text.split("#[cfg(test)]").next().unwrap_or_default();
    code.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n")
}

/// Every file of `rooms` whose code has one of `words`.
fn offenders(rooms: &[&str], words: &[&str]) -> Vec<String> {
    let mut found = Vec::new();
    for path in rooms.iter().flat_map(|room| files(room)) {
        let code = code(&path);
        let has = words.iter().filter(|word| code.contains(**word));
        found.extend(has.map(|word| format!("{}: {word}", path.display())));
    }
    found
}

#[test]
fn a_room_imports_from_below_alone() {
    for (at, room) in ROOMS.iter().enumerate() {
        let above: Vec<String> = ROOMS[..at].iter().map(|above| format!("crate::{above}")).collect();
        let above: Vec<&str> = above.iter().map(String::as_str).collect();
        assert_eq!(offenders(&[room], &above), Vec::<String>::new());
    }
}

#[test]
fn definitions_know_no_arrow_and_reports_no_trace() {
    assert_eq!(offenders(&["metric"], &["arrow::", "parquet::"]), Vec::<String>::new());
    assert_eq!(offenders(&["report", "cells"], &["crate::trace", "metric::plan"]), Vec::<String>::new());
}

#[test]
fn only_the_command_line_prints_and_scoring_opens_no_file() {
    let below = &ROOMS[1..];
    assert_eq!(offenders(below, &["println!", "eprintln!", "stdout()", "stderr()"]), Vec::<String>::new());
    assert_eq!(offenders(&["score", "base"], &["thread::", "mpsc::", "in_order("]), Vec::<String>::new());
    assert_eq!(
        offenders(&["score"], &["File::open", "fs::", "tempfile", "Instant", "SystemTime"]),
        Vec::<String>::new()
    );
}

/// Files that may look at a clock: what they learn from it goes to standard error, into a wait, or into the latency of a
/// reply, and nowhere else.
const MAY_LOOK_AT_A_CLOCK: [&str; 9] = [
    "src/agent/exec/mod.rs",
    "src/agent/vlm/failure.rs",
    "src/agent/vlm/provider.rs",
    "src/cli/commands/record.rs",
    "src/cli/recording.rs",
    "src/engine/spark/submit.rs",
    "src/record/play.rs",
    "src/record/run.rs",
    "src/record/log.rs",
];

#[test]
fn no_clock_reaches_an_output() {
    let mut found = offenders(&ROOMS, &["SystemTime", "Instant::now", "chrono::"]);
    found.retain(|offender| !MAY_LOOK_AT_A_CLOCK.iter().any(|file| offender.contains(file)));
    assert_eq!(found, Vec::<String>::new());
}

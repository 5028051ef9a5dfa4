//! Traces written by seven other programs, with their codecs, page versions, dictionaries and row counts around group
//! sizes. All are accepted, with the scores and the output of every verb equal to those of our own file.

use std::collections::BTreeMap;
use std::fs;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use arrow::util::display::array_value_to_string;
use mirrorstats::{Study, StudyError};
use mirrorstats_score::format::Format;
use mirrorstats_study::scores;
use mirrorstats_trace::diagnostic::Severity;
use mirrorstats_trace::footers::checksums::Checksums;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::open::TraceFile;
use mirrorstats_trace::validate::validate;

use crate::harness::files::{fixture, repository};
use crate::harness::need;
use crate::harness::program::{clean, program, run, succeeds};
use crate::harness::traces::{rows, score_values, write_rows};

/// The minimum number of files from each writer.
const WRITERS: [(&str, usize); 7] = [
    ("pyarrow", 80),
    ("duckdb", 70),
    ("polars", 40),
    ("datafusion", 48),
    ("fastparquet", 40),
    ("spark", 40),
    ("java", 80),
];

/// Commands whose output is equal for all files with the same rows.
const SAME: [&[&str]; 9] = [
    &["score", "trace.parquet"],
    &["query", "SELECT * FROM steps ORDER BY episode_id, t", "trace.parquet"],
    &["query", "SELECT * FROM cells ORDER BY experiment, model, metric", "trace.parquet"],
    &["diff", "paper", "extended", "trace.parquet"],
    &["trace", "check", "trace.parquet", "--max-unreadable", "0.05"],
    &["definitions", "sensitivity", "trace.parquet"],
    &["definitions", "sensitivity", "trace.parquet", "--metrics", "MCR", "--json"],
    &["figure", "intervals", "trace.parquet", "-o", "figure.svg"],
    &["report", "trace.parquet", "--no-figures", "--out", "report"],
];

/// Commands about the file itself.
const OF_THE_FILE: [&[&str]; 5] = [
    // The output states the design from the footer.
    &["stats", "trace.parquet"],
    &["trace", "info", "trace.parquet"],
    &["trace", "validate", "trace.parquet"],
    &["table", "rescore", "report", "--definitions", "battery", "--out", "again"],
    &["view", "trace.parquet", "--export", "page"],
];

/// All written files, each with our own trace of the same rows.
fn written(folder: &Path) -> BTreeMap<PathBuf, PathBuf> {
    let packages = std::env::join_paths([need::writers(), need::spark()]).unwrap();
    let mut command = clean(std::process::Command::new(need::python()), folder);
    succeeds(command.env("PYTHONPATH", packages).arg(repository().join("tests/traces/foreign/write.py")).arg(folder));
    let mut files = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let content = entry.unwrap().path();
        if content.is_dir() {
            let own = content.with_extension("parquet");
            let name = |path: &Path| path.file_name().unwrap().to_str().unwrap().to_owned();
            let lines = content.with_extension("jsonl");
            run(folder, &["import", &name(&lines), "-o", &name(&own)]).done();
            let others = fs::read_dir(&content).unwrap().map(|entry| entry.unwrap().path());
            files.extend(others.filter(|path| path.extension().is_some()).map(|path| (path, own.clone())));
        }
    }
    files
}

fn scores(path: &Path) -> Result<Vec<Vec<String>>, Box<StudyError>> {
    scores_by(path, repository().join("tests/traces/foreign/definitions.toml").to_str().unwrap())
}

fn scores_by(path: &Path, definitions: &str) -> Result<Vec<Vec<String>>, Box<StudyError>> {
    let table = Study::open([path])?.definitions(definitions)?.score()?.episodes;
    let mut bytes = Vec::new();
    scores::write(&table, Format::Csv, &mut bytes, NonZeroUsize::MIN).unwrap();
    Ok(score_values(&String::from_utf8(bytes).unwrap()))
}

/// The error for a file, or the difference of its scores.
fn fault(path: &Path, own: &[Vec<String>]) -> Option<String> {
    match scores(path) {
        Err(error) => return Some(error.to_string()),
        Ok(scores) if scores != own => return Some("other scores".to_owned()),
        Ok(_) => {}
    }
    let found = validate(&[Input::new(path)], None, NonZeroUsize::MIN).unwrap().findings;
    found.iter().find(|finding| finding.severity == Severity::Error).map(ToString::to_string)
}

fn of_writer<'a>(files: &'a BTreeMap<PathBuf, PathBuf>, writer: &str) -> Vec<(&'a Path, &'a Path)> {
    let is_of = |path: &&PathBuf| path.file_name().unwrap().to_str().unwrap().split('-').next() == Some(writer);
    files.keys().filter(is_of).map(|path| (path.as_path(), files[path].as_path())).collect()
}

/// When pyarrow rewrites a trace, it copies the footer's keys, including our checksums.
#[test]
fn every_command_notes_a_trace_rewritten_by_another_program() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let own = fixture("recorded/E1-guesser.parquet");
    fs::create_dir(at.join("again")).unwrap();
    let mut command = clean(std::process::Command::new(need::python()), at);
    let script = repository().join("tests/traces/foreign/write.py");
    command.env("PYTHONPATH", need::writers()).arg(script).arg(&own).arg("again");
    succeeds(&mut command);
    let expected = scores_by(&own, "paper").unwrap();
    let files: Vec<PathBuf> = fs::read_dir(at.join("again")).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert_eq!(files.len(), 12);
    for path in &files {
        let file = TraceFile::open(&Input::new(path)).unwrap();
        assert_eq!(file.checksums(), Checksums::Stale, "{}", path.display());
        assert_eq!(scores_by(path, "paper").unwrap(), expected, "{}", path.display());
    }
    fs::copy(&files[0], at.join("trace.parquet")).unwrap();
    for words in SAME.iter().chain(&OF_THE_FILE) {
        let reads = words.contains(&"trace.parquet") || words.contains(&"rescore");
        let answer = program(at).args(*words).output().unwrap();
        let told =
            String::from_utf8(if words[..2] == ["trace", "validate"] { answer.stdout } else { answer.stderr }).unwrap();
        let says_so =
            told.contains("trace.parquet: another program wrote the rows again") || told.contains("stale-checksums");
        // Commands that cannot work on this trace are refused earlier.
        assert_eq!(says_so, reads, "{words:?}: {told}");
    }
    let answer = run(at, &["stats", "trace.parquet", "--json"]).json();
    let warnings = answer["warnings"].as_array().unwrap();
    assert!(warnings.iter().any(|words| words.as_str().unwrap().contains("another program wrote")), "{warnings:?}");
    assert!(run(at, &["trace", "info", "trace.parquet"]).done().contains("stale"));
}

#[test]
fn traces_without_checksums_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let rows = rows(&fixture("recorded/E1-guesser.parquet"));
    for (name, from) in [("one.parquet", 0), ("two.parquet", rows.num_rows() / 2)] {
        let ids = rows.column_by_name("episode_id").unwrap();
        let text = |row: usize| array_value_to_string(ids, row).unwrap();
        // A whole episode: the first or the last one.
        let wanted = text(if from == 0 { 0 } else { rows.num_rows() - 1 });
        let first = (0..rows.num_rows()).find(|row| text(*row) == wanted).unwrap();
        let count = (first..rows.num_rows()).take_while(|row| text(*row) == wanted).count();
        write_rows(&at.join(name), &[rows.slice(first, count)], None);
    }
    let both = ["one.parquet", "two.parquet"];
    let told = run(at, &["trace", "validate", both[0], both[1]]).stdout;
    assert!(told.contains("no checksums in 2 files"), "{told}");
    let checked = run(at, &["trace", "validate", both[0], "--json"]).stdout;
    assert!(checked.contains(r#""checksums": "none""#), "{checked}");
    let answer = run(at, &["report", both[0], both[1], "--no-figures", "--json", "--out", "report"]);
    let words = "one.parquet and one other file: no checksums";
    assert!(answer.stderr.contains(words), "{}", answer.stderr);
    assert!(answer.json()["warnings"].to_string().contains(words));
    // Our own files have checksums.
    let own = fixture("paper").display().to_string();
    assert!(!run(at, &["trace", "validate", &own]).stdout.contains("no checksums"));
}

#[test]
fn files_of_other_writers_score_as_our_own() {
    let folder = tempfile::tempdir().unwrap();
    let files = written(folder.path());
    let mut own: BTreeMap<&Path, Vec<Vec<String>>> = BTreeMap::new();
    let mut faults = Vec::new();
    for (path, trace) in &files {
        let expected = own.entry(trace).or_insert_with(|| scores(trace).unwrap());
        let name = path.strip_prefix(folder.path()).unwrap().display();
        faults.extend(fault(path, expected).map(|fault| format!("{name}: {fault}")));
    }
    assert_eq!(faults, Vec::<String>::new(), "of {} files", files.len());
    for (writer, least) in WRITERS {
        let count = of_writer(&files, writer).len();
        assert!(count >= least, "{writer}: {count} files");
    }
    assert!(files.len() >= 400 && own.len() >= 100, "{} files of {} contents", files.len(), own.len());
    for (writer, _) in WRITERS {
        verbs_say_the_same(folder.path(), writer, &of_writer(&files, writer));
    }
}

/// Runs every verb on a file of this writer and on our own.
fn verbs_say_the_same(folder: &Path, writer: &str, files: &[(&Path, &Path)]) {
    let is_sample = |name: &str| ["503", "504", "505", "1023", "1025"].iter().any(|size| name.starts_with(size));
    let sample = files.iter().find(|(_, own)| is_sample(own.file_name().unwrap().to_str().unwrap()));
    let (theirs, own) = sample.unwrap_or_else(|| panic!("{writer}: no file of some 500 rows"));
    let folders = [folder.join(writer), folder.join(format!("own-{writer}"))];
    for (folder, trace) in folders.iter().zip([theirs, own]) {
        fs::create_dir(folder).unwrap();
        fs::copy(trace, folder.join("trace.parquet")).unwrap();
    }
    let answer = |folder: &Path, words: &[&str]| {
        let output = program(folder).args(words).output().unwrap();
        (output.status.code(), String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap())
    };
    for words in SAME {
        let [theirs, own] = folders.each_ref().map(|folder| answer(folder, words));
        assert!(matches!(own.0, Some(0 | 1)), "{words:?}: {own:?}");
        if words[0] == "score" {
            assert_eq!(score_values(&theirs.1), score_values(&own.1), "{writer}: {words:?}: {}", theirs.2);
            continue;
        }
        assert_eq!((&theirs.0, &theirs.1), (&own.0, &own.1), "{writer}: {words:?}: {}", theirs.2);
    }
    for words in OF_THE_FILE {
        let (code, _, told) = answer(&folders[0], words);
        assert_eq!(code, Some(0), "{writer}: {words:?}: {told}");
    }
    for file in ["figure.svg", "report/cells.csv", "report/tables/main.md", "again/cells.csv"] {
        let [theirs, own] = folders.each_ref().map(|folder| fs::read(folder.join(file)));
        // Only the other file's report is made a second time.
        assert!(theirs.is_ok() && (theirs.ok() == own.ok() || file.starts_with("again")), "{writer}: {file}");
    }
}

/// Changes bytes one at a time in files without checksums. benches/SOAK.md states how many change scores unnoticed.
#[test]
#[ignore = "thousands of changes of files by pyarrow; make soak"]
fn soak_changed_bytes_of_files_without_checksums_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::create_dir(at.join("again")).unwrap();
    let mut command = clean(std::process::Command::new(need::python()), at);
    let script = repository().join("tests/traces/foreign/write.py");
    let own = fixture("recorded/E1-guesser.parquet");
    succeeds(command.env("PYTHONPATH", need::writers()).arg(script).arg(&own).arg("again"));
    let (mut all, mut silent, mut draws) = (0, 0, crate::harness::faults::Draws::new(38));
    for entry in fs::read_dir(at.join("again")).unwrap() {
        let path = entry.unwrap().path();
        let (whole, sound) = (fs::read(&path).unwrap(), scores_by(&path, "paper").unwrap());
        for _ in 0..400 {
            let mut bytes = whole.clone();
            bytes[draws.below(whole.len())] ^= u8::try_from(1 + draws.below(255)).unwrap();
            fs::write(&path, &bytes).unwrap();
            all += 1;
            let is_other = scores_by(&path, "paper").is_ok_and(|scores| scores != sound);
            let found = || validate(&[Input::new(&path)], None, NonZeroUsize::MIN).unwrap().findings;
            silent += usize::from(is_other && found().iter().all(|finding| finding.severity != Severity::Error));
        }
    }
    println!("{silent} of {all} changes are silent");
    assert!(silent * 200 < all, "{silent} of {all}");
}

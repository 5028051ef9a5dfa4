//! Outputs that are inputs, and outputs that are no files.

use std::fs;
use std::os::unix::fs::{FileTypeExt as _, symlink};
use std::path::Path;
use std::process::Stdio;

use crate::{contents, program, run, two_files};

/// Every name under which `file` can be written: itself, around a corner, a symbolic and a hard link.
fn aliases(folder: &Path, file: &str) -> Vec<String> {
    fs::create_dir_all(folder.join("sub")).unwrap();
    let ending = Path::new(file).extension().unwrap().to_str().unwrap();
    let (soft, hard) = (format!("soft.{ending}"), format!("hard.{ending}"));
    symlink(folder.join(file), folder.join(&soft)).unwrap();
    fs::hard_link(folder.join(file), folder.join(&hard)).unwrap();
    vec![file.to_owned(), format!("./{file}"), format!("sub/../{file}"), soft, hard]
}

/// That a command refuses to write to any name of its input `file`, and changes nothing.
fn check(folder: &Path, file: &str, command: &[&str]) {
    let aliases = aliases(folder, file);
    let before = contents(folder);
    for alias in &aliases {
        let error = run(folder, &[command, &[alias]].concat()).refused();
        let words = format!("`{alias}`: expected another file to write, found ");
        assert!(error.contains(&words), "{command:?} {alias}: {error}");
        assert!(error.contains("help: "), "{error}");
        assert!(contents(folder) == before, "{command:?} {alias} has changed a file");
    }
}

#[test]
fn a_trace_is_no_output_of_what_reads_it() {
    for command in [
        &["score", "a.parquet", "b.parquet", "-o"][..],
        &["score", ".", "--engine", "native", "-o"],
        &["figure", "spider", "a.parquet", "--format", "svg", "-o"],
        #[cfg(feature = "polars")]
        &["score", "a.parquet", "--engine", "polars", "-o"],
        #[cfg(feature = "polars")]
        &["query", "SELECT * FROM steps", "a.parquet", "-o"],
        #[cfg(feature = "polars")]
        &["query", "SELECT * FROM steps", "a.parquet", "--format", "table", "-o"],
    ] {
        check(two_files().path(), "a.parquet", command);
    }
}

#[test]
fn scores_definitions_and_steps_are_no_outputs_either() {
    let folder = two_files();
    run(folder.path(), &["score", "a.parquet", "-o", "s.csv"]).done();
    check(folder.path(), "s.csv", &["score", "s.csv", "-o"]);
    let folder = two_files();
    fs::write(folder.path().join("own.csv"), "include = [\"paper\"]\n").unwrap();
    check(folder.path(), "own.csv", &["score", "a.parquet", "--definitions", "own.csv", "-o"]);
    let folder = tempfile::tempdir().unwrap();
    let step = r#"{"episode_id":"a","model":"m","experiment":"E1","seed":1,"run":1,"body_color":"red","t":1,"action":"done","self_color":null,"selected_cube":"none","mirror_visible":false}"#;
    fs::write(folder.path().join("s.jsonl"), step).unwrap();
    check(folder.path(), "s.jsonl", &["import", "s.jsonl", "-o"]);
}

#[test]
fn a_report_does_not_replace_what_it_is_made_of() {
    let folder = two_files();
    run(folder.path(), &["report", "a.parquet", "--no-figures", "--out", "r"]).done();
    let before = contents(folder.path());
    for (input, out) in [("r/episodes.parquet", "r"), ("r/episodes.parquet", "./r/"), ("r/cells.csv", "r")] {
        let error = run(folder.path(), &["report", input, "--no-figures", "--out", out]).refused();
        assert!(error.contains("expected another file to write, found one that is read"), "{error}");
        assert!(contents(folder.path()) == before, "{input}");
    }
    // A trace where the report has a file of its own, and one that is nobody's.
    fs::create_dir(folder.path().join("new")).unwrap();
    for (name, is_refused) in [("episodes.parquet", true), ("mine.parquet", false)] {
        let path = format!("new/{name}");
        fs::copy(folder.path().join("a.parquet"), folder.path().join(&path)).unwrap();
        let answer = run(folder.path(), &["report", &path, "--no-figures", "--out", "new"]);
        assert_eq!(answer.code == 2, is_refused, "{}", answer.stderr);
        let (trace, now) = (fs::read(folder.path().join("a.parquet")).unwrap(), fs::read(folder.path().join(&path)));
        assert!(now.unwrap() == trace, "{path}");
        fs::remove_file(folder.path().join(&path)).unwrap();
    }
}

#[test]
fn a_copy_is_another_file() {
    let folder = two_files();
    fs::copy(folder.path().join("a.parquet"), folder.path().join("copy.parquet")).unwrap();
    run(folder.path(), &["score", "a.parquet", "-o", "copy.parquet"]).done();
    let scores = contents(folder.path());
    assert!(scores["copy.parquet"] != scores["a.parquet"]);
}

/// Draws a figure to `target` with standard output going to `stdout`.
fn figure(folder: &Path, target: &str, stdout: Stdio) -> std::process::Output {
    let words = ["figure", "spider", "a.parquet", "--format", "svg", "-o", target];
    program(folder).args(words).stdout(stdout).output().unwrap()
}

#[test]
fn standard_output_and_devices_are_written_into() {
    let folder = two_files();
    let expected = run(folder.path(), &["figure", "spider", "a.parquet"]).done();
    // The device itself is in danger where this fails: a link to it is not.
    symlink("/dev/null", folder.path().join("null.svg")).unwrap();
    let answer = figure(folder.path(), "null.svg", Stdio::piped());
    assert!(answer.status.success() && answer.stdout.is_empty(), "{}", String::from_utf8_lossy(&answer.stderr));
    assert!(fs::metadata(folder.path().join("null.svg")).unwrap().file_type().is_char_device());
    symlink("/dev/stdout", folder.path().join("out.svg")).unwrap();
    let answer = figure(folder.path(), "out.svg", Stdio::piped());
    assert!(answer.stdout == expected.as_bytes(), "{}", String::from_utf8_lossy(&answer.stderr));
    assert!(fs::symlink_metadata(folder.path().join("out.svg")).unwrap().is_symlink());
}

#[test]
fn standard_output_by_its_name_may_be_a_file() {
    let folder = two_files();
    let expected = run(folder.path(), &["figure", "spider", "a.parquet"]).done();
    for (name, before) in [("/dev/fd/1", ""), ("/proc/self/fd/1", "before")] {
        let path = folder.path().join("redirected");
        fs::write(&path, before).unwrap();
        let file = fs::OpenOptions::new().append(true).open(&path).unwrap();
        let answer = figure(folder.path(), name, file.into());
        assert!(answer.status.success(), "{name}: {}", String::from_utf8_lossy(&answer.stderr));
        assert!(fs::read_to_string(&path).unwrap() == format!("{before}{expected}"), "{name}");
    }
}

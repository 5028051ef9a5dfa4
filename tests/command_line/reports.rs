//! A report written over an older one: the folder holds the whole old or the whole new report, and other files stay.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

use mirrorstats_exact::hash;
use serde_json::{Value, json};

use crate::harness::files::Contents;
use crate::{contents, program, run, two_files};

/// Files that do not belong to the report.
const FOREIGN: [(&str, &str); 4] =
    [("notes.txt", "mine"), ("own/deep/b.txt", "mine"), ("tables/own.tex", "mine"), ("figures/own.svg", "mine")];

fn put_foreign(out: &Path) {
    for (path, text) in FOREIGN {
        fs::create_dir_all(out.join(path).parent().unwrap()).unwrap();
        fs::write(out.join(path), text).unwrap();
    }
    fs::create_dir(out.join("empty")).unwrap();
}

fn with_foreign(mut report: Contents) -> Contents {
    report.extend(FOREIGN.map(|(path, text)| (path.to_owned(), text.as_bytes().to_vec())));
    report
}

/// The contents of a report in a new folder.
fn fresh(folder: &Path, words: &[&str]) -> Contents {
    run(folder, &[&["report"], words, &["--out", "fresh"]].concat()).done();
    let found = contents(&folder.join("fresh"));
    fs::remove_dir_all(folder.join("fresh")).unwrap();
    found
}

const LARGE: [&str; 1] = ["a.parquet"];
const SMALL: [&str; 3] = ["b.parquet", "--no-figures", "--metrics=TSA"];

/// Checks that the manifest lists exactly the report's files, in order, with hash and size.
fn check_outputs(report: &Contents) {
    let manifest: Value = serde_json::from_slice(&report["manifest.json"]).unwrap();
    let files = report.iter().filter(|(path, _)| *path != "manifest.json");
    let expected: Vec<Value> = files
        .map(|(path, bytes)| json!({ "path": path, "sha256": hash::of_bytes(bytes), "bytes": bytes.len() }))
        .collect();
    assert_eq!(manifest["outputs"], json!(expected));
}

#[test]
fn a_manifest_lists_the_written_files() {
    let folder = two_files();
    for words in [&LARGE[..], &SMALL] {
        check_outputs(&fresh(folder.path(), words));
    }
    let answer = run(folder.path(), &["report", "a.parquet", "--json", "--out", "r"]).done();
    let answer: Value = serde_json::from_str(&answer).unwrap();
    let manifest: Value = serde_json::from_slice(&fs::read(folder.path().join("r/manifest.json")).unwrap()).unwrap();
    assert_eq!(answer["manifest"], manifest);
    assert_eq!(answer["files"].as_array().unwrap().len(), manifest["outputs"].as_array().unwrap().len() + 1);
}

#[cfg(feature = "raster")]
#[test]
fn png_on_request_changes_no_other_file() {
    let folder = two_files();
    let ends = |path: &String, ending: &str| Path::new(path).extension().is_some_and(|found| found == ending);
    let is_png = |path: &String| ends(path, "png");
    let plain = fresh(folder.path(), &["a.parquet", "--threads", "1"]);
    let mut with_png = fresh(folder.path(), &["a.parquet", "--threads", "3", "--png"]);
    let figures = plain.keys().filter(|path| ends(path, "pdf")).count();
    assert_eq!((plain.keys().filter(|path| is_png(path)).count(), figures > 0), (0, true));
    assert_eq!(with_png.keys().filter(|path| is_png(path)).count(), figures);
    // The manifest lists the files.
    with_png.retain(|path, _| !is_png(path) && path != "manifest.json");
    assert!(with_png.iter().all(|(path, bytes)| plain.get(path) == Some(bytes)) && with_png.len() == plain.len() - 1);
}

#[test]
fn an_older_report_is_removed_and_other_files_are_kept() {
    let folder = two_files();
    let (large, small) = (fresh(folder.path(), &LARGE), fresh(folder.path(), &SMALL));
    assert!(large.contains_key("report.html") && large.contains_key("figures/spider.svg"));
    for is_link in [false, true] {
        let out = folder.path().join("out");
        fs::create_dir(folder.path().join("there")).unwrap();
        if is_link {
            symlink("there", &out).unwrap();
        } else {
            fs::rename(folder.path().join("there"), &out).unwrap();
        }
        put_foreign(&out);
        for (words, expected) in [(&LARGE[..], &large), (&SMALL, &small), (&LARGE, &large)] {
            run(folder.path(), &[&["report", "--out", "out"], words].concat()).done();
            assert!(contents(&out) == with_foreign(expected.clone()), "{words:?}: {:#?}", contents(&out).keys());
            assert!(out.join("empty").is_dir());
        }
        assert_eq!(fs::symlink_metadata(&out).unwrap().is_symlink(), is_link);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), if is_link { 4 } else { 3 });
        if is_link { fs::remove_file(&out).unwrap() } else { fs::remove_dir_all(&out).unwrap() }
    }
}

#[test]
fn a_folder_of_figures_goes_with_the_last_of_them() {
    let folder = two_files();
    for words in [&LARGE[..], &SMALL] {
        run(folder.path(), &[&["report", "--out", "out"], words].concat()).done();
    }
    assert!(!folder.path().join("out/figures").exists());
}

#[test]
fn a_foreign_manifest_removes_no_files() {
    let folder = two_files();
    let out = folder.path().join("out");
    put_foreign(&out);
    for manifest in [r#"{"outputs": [{"path": "notes.txt"}]}"#, "no JSON"] {
        fs::write(out.join("manifest.json"), manifest).unwrap();
        run(folder.path(), &[&["report", "--out", "out"], &SMALL[..]].concat()).done();
        assert!(contents(&out) == with_foreign(fresh(folder.path(), &SMALL)), "{manifest}");
    }
    let text = fs::read_to_string(out.join("manifest.json")).unwrap();
    let outside = text.replacen("\"cells.csv\"", "\"../a.parquet\"", 1);
    assert_ne!(text, outside);
    fs::write(out.join("manifest.json"), outside).unwrap();
    run(folder.path(), &[&["report", "--out", "out"], &SMALL[..]].concat()).done();
    assert!(folder.path().join("a.parquet").is_file());
}

/// Kills a report after a pause; returns true if it was already done.
fn killed_after(folder: &Path, words: &[&str], pause: Duration) -> bool {
    let mut command = program(folder);
    command.args(["report", "--out", "out"]).args(words);
    let mut child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    std::thread::sleep(pause);
    drop(child.kill());
    child.wait().unwrap().success()
}

/// Pauses spread over the last half of a run, in a fixed order that looks random.
fn pauses(whole: Duration, count: u32) -> impl Iterator<Item = Duration> {
    (0..count).map(move |at| whole / 2 + whole * (at * 37 % count) / (2 * count))
}

/// Kills `kills` reports over an older one at different moments; `is_right` checks the folder each time.
fn kill_often(folder: &Path, kills: u32, is_right: impl Fn(&Contents) -> bool) {
    let begin = Instant::now();
    run(folder, &[&["report", "--out", "out"], &SMALL[..]].concat()).done();
    let whole = begin.elapsed();
    for (at, pause) in pauses(whole, kills).enumerate() {
        let words = if at % 2 == 0 { ["a.parquet", "--no-figures", "--metrics=MCR"] } else { SMALL };
        killed_after(folder, &words, pause);
        let found = contents(&folder.join("out")).into_iter();
        let found = found.filter(|(path, _)| !path.starts_with(".mirrorstats-")).collect();
        assert!(is_right(&found), "killed after {pause:?}: {:#?}", found.keys());
    }
    run(folder, &[&["report", "--out", "out"], &SMALL[..]].concat()).done();
    let names: Vec<_> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    let left = names.iter().filter(|name| name.to_string_lossy().starts_with(".mirrorstats-")).count();
    assert_eq!(left, 0, "{names:?}");
}

fn check_killed_report(kills: u32) {
    let folder = two_files();
    let other = fresh(folder.path(), &["a.parquet", "--no-figures", "--metrics=MCR"]);
    let small = fresh(folder.path(), &SMALL);
    put_foreign(&folder.path().join("out"));
    let reports = [with_foreign(small), with_foreign(other)];
    kill_often(folder.path(), kills, |found| reports.contains(found));
}

fn check_killed_report_in_a_linked_folder(kills: u32) {
    let folder = two_files();
    let other = fresh(folder.path(), &["a.parquet", "--no-figures", "--metrics=MCR"]);
    let small = fresh(folder.path(), &SMALL);
    fs::create_dir(folder.path().join("there")).unwrap();
    symlink("there", folder.path().join("out")).unwrap();
    put_foreign(&folder.path().join("out"));
    let reports = [with_foreign(small), with_foreign(other)];
    kill_often(folder.path(), kills, |found| {
        let foreign = FOREIGN.iter().all(|(path, text)| found.get(*path).is_some_and(|found| found == text.as_bytes()));
        foreign && (!found.contains_key("manifest.json") || reports.contains(found))
    });
    let found = contents(&folder.path().join("out"));
    assert!(found == reports[0], "{:#?}", found.keys());
}

#[test]
fn a_killed_report_leaves_the_old_one_or_the_new_one() {
    check_killed_report(10);
}

#[test]
#[ignore = "soak: 200 kills"]
fn soak_a_killed_report_leaves_the_old_one_or_the_new_one() {
    check_killed_report(200);
}

#[test]
fn a_killed_report_in_a_linked_folder_leaves_one_or_no_manifest() {
    check_killed_report_in_a_linked_folder(10);
}

#[test]
#[ignore = "soak: 200 kills"]
fn soak_a_killed_report_in_a_linked_folder_leaves_one_or_no_manifest() {
    check_killed_report_in_a_linked_folder(200);
}

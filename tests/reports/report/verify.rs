//! `mirrorstats verify`: a report's folder against its manifest.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};
use tempfile::TempDir;

use crate::harness::files::fixture;
use crate::harness::program::run;

/// A folder with a report in `mine`.
fn reported() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let trace = fixture("paper/E1-gpt-5-1.parquet").display().to_string();
    run(folder.path(), &["report", &trace, "--out", "mine"]).done();
    folder
}

fn differences(folder: &Path) -> Vec<(String, String)> {
    let answer = run(folder, &["verify", "mine", "--json"]);
    let found: Value = serde_json::from_str(&answer.stdout).unwrap();
    let found = found["differences"].as_array().unwrap();
    assert_eq!(answer.code, i32::from(!found.is_empty()));
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    found.iter().map(|one| (text(&one["kind"]), text(&one["path"]))).collect()
}

#[test]
fn every_file_that_differs_is_named() {
    let folder = reported();
    let at = folder.path();
    assert_eq!(differences(at), []);
    let told = run(at, &["verify", "mine"]).done();
    assert!(told.ends_with(" files are as the manifest says\n"), "{told}");
    let mut table = fs::read(at.join("mine/tables/main.csv")).unwrap();
    *table.last_mut().unwrap() ^= 1;
    fs::write(at.join("mine/tables/main.csv"), table).unwrap();
    fs::remove_file(at.join("mine/cells.csv")).unwrap();
    fs::create_dir(at.join("mine/more")).unwrap();
    fs::write(at.join("mine/more/notes.txt"), "mine").unwrap();
    let expected = [("missing", "cells.csv"), ("unexpected", "more/notes.txt"), ("changed", "tables/main.csv")];
    assert_eq!(differences(at), expected.map(|(kind, path)| (kind.to_owned(), path.to_owned())));
    let told = run(at, &["verify", "mine"]).ends(1).stdout;
    for words in
        ["cells.csv: missing", "more/notes.txt: unexpected", "tables/main.csv: changed", "1 changed, 1 missing"]
    {
        assert!(told.contains(words), "{told}");
    }
    // Writing the report again restores it.
    fs::remove_dir_all(at.join("mine/more")).unwrap();
    let trace = fixture("paper/E1-gpt-5-1.parquet").display().to_string();
    run(at, &["report", &trace, "--out", "mine"]).done();
    assert_eq!(differences(at), []);
}

#[cfg(unix)]
#[test]
fn no_link_is_followed() {
    let folder = reported();
    let at = folder.path();
    fs::rename(at.join("mine/cells.csv"), at.join("cells.csv")).unwrap();
    std::os::unix::fs::symlink(at.join("cells.csv"), at.join("mine/cells.csv")).unwrap();
    fs::rename(at.join("mine/tables"), at.join("tables")).unwrap();
    std::os::unix::fs::symlink(at.join("tables"), at.join("mine/tables")).unwrap();
    let found = differences(at);
    assert!(found.contains(&("changed".to_owned(), "cells.csv".to_owned())), "{found:?}");
    assert!(found.contains(&("unexpected".to_owned(), "tables".to_owned())), "{found:?}");
    assert!(found.contains(&("missing".to_owned(), "tables/main.csv".to_owned())), "{found:?}");
    let told = run(at, &["verify", "mine"]).ends(1).stdout;
    assert!(told.contains("a symbolic link"), "{told}");
    fs::rename(at.join("mine/manifest.json"), at.join("manifest.json")).unwrap();
    std::os::unix::fs::symlink(at.join("manifest.json"), at.join("mine/manifest.json")).unwrap();
    let told = run(at, &["verify", "mine"]).refused();
    assert!(told.contains("found a symbolic link"), "{told}");
}

#[test]
fn a_manifest_with_impossible_entries_is_refused() {
    let folder = reported();
    let at = folder.path();
    let sound: Value = serde_json::from_slice(&fs::read(at.join("mine/manifest.json")).unwrap()).unwrap();
    let output = |path: &str| json!({"path": path, "sha256": "0".repeat(64), "bytes": 1});
    let outside = "not a path inside its folder";
    let cases = [
        (json!([output("/etc/passwd")]), outside),
        (json!([output("../secret")]), outside),
        (json!([output("tables/../../secret")]), outside),
        (json!([output("tables//main.csv")]), outside),
        (json!([output("./cells.csv")]), outside),
        (json!([output("")]), outside),
        (json!([output("manifest.json")]), "among its outputs"),
        (json!([output("a"), output("a")]), "twice"),
        (json!([{"path": "a", "sha256": "short", "bytes": 1}]), "in place of a SHA-256"),
        (json!([{"path": "a", "sha256": "0".repeat(64), "bytes": -1}]), "invalid value"),
        (json!([]), "lists no outputs"),
        (json!("all"), "invalid type"),
    ];
    for (outputs, expected) in cases {
        let mut manifest = sound.clone();
        manifest["outputs"] = outputs;
        fs::write(at.join("mine/manifest.json"), manifest.to_string()).unwrap();
        let told = run(at, &["verify", "mine"]).refused();
        assert!(told.contains(expected) && told.contains("manifest.json"), "{told}");
    }
    for bytes in [&b"{"[..], b"", b"{\"outputs\": []}", b"\xff\xfe"] {
        fs::write(at.join("mine/manifest.json"), bytes).unwrap();
        let told = run(at, &["verify", "mine"]).refused();
        assert!(told.contains("expected the manifest of a report"), "{told}");
    }
    for folder in [".", "nowhere", "mine/cells.csv"] {
        let told = run(at, &["verify", folder]).refused();
        assert!(told.contains("expected a report's folder with its manifest.json"), "{told}");
    }
}

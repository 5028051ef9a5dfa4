//! `import --palette` declares the colours in the trace, and allows no others.

use std::fs;

use serde_json::json;

use super::{lines, run, step, step_with};
use crate::harness::traces::recording;

/// Two steps; the second one claims this colour, and the body is `red`.
fn claiming(color: &str) -> String {
    lines(&[step("a", 1), step_with("a", 2, json!({ "self_color": color }))])
}

#[test]
fn the_trace_declares_the_palette() {
    let ten = ["blue", "brown", "cyan", "green", "orange", "pink", "purple", "red", "white", "yellow"];
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("colors.txt"), "red\r\n\ndark teal\n").unwrap();
    fs::write(folder.path().join("colors"), "red, dark teal").unwrap();
    for (palette, expected) in [
        ("red,dark teal", &["red", "dark teal"][..]),
        (" red , dark teal,", &["red", "dark teal"]),
        ("colors.txt", &["red", "dark teal"]),
        ("./colors.txt", &["red", "dark teal"]),
        ("colors", &["red", "dark teal"]),
        ("red", &["red"]),
        ("default", &ten),
    ] {
        let words = ["import", "-", "-o", "x.parquet", "--palette", palette];
        let answer = run(folder.path(), &words, claiming("red"));
        assert_eq!(answer.code, 0, "{palette}: {}", answer.stderr);
        let declared = recording(&folder.path().join("x.parquet"));
        assert_eq!((&declared["kind"], &declared["palette"]), (&json!("import"), &json!(expected)), "{palette}");
        assert_eq!(run(folder.path(), &["trace", "validate", "x.parquet"], "").code, 0);
    }
    run(folder.path(), &["import", "-", "-o", "y.parquet"], claiming("red"));
    assert_eq!(recording(&folder.path().join("y.parquet")).get("palette"), None);
}

#[test]
fn another_colour_is_refused_with_its_line_and_the_nearest_name() {
    let folder = tempfile::tempdir().unwrap();
    for (color, help) in [
        ("magneta", "did you mean `magenta`?"),
        ("Magenta", "did you mean `magenta`?"),
        ("teal", "use a name of the palette, or add the colour to the palette"),
        ("none", "`unknown`, or null where the reply gave none"),
    ] {
        fs::write(folder.path().join("s.jsonl"), claiming(color)).unwrap();
        let words = ["import", "s.jsonl", "-o", "x.parquet", "--palette", "red,magenta"];
        let answer = run(folder.path(), &words, "");
        let expected = format!(
            "error: s.jsonl, line 2, key `self_color`\n  expected a colour of the palette (red, magenta), `unknown`, or null\n  \
             found the text `{color}`\n  help: {help}"
        );
        assert!(answer.code == 2 && answer.stderr.starts_with(&expected), "{}", answer.stderr);
        assert!(!folder.path().join("x.parquet").exists());
    }
}

#[test]
fn an_invalid_palette_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (palette, expected) in [
        (
            "Red,blue",
            "--palette Red,blue: expected lower-case names of colours, found `Red`; did you mean `red`?\n  help: ",
        ),
        ("red,none", "found `none`\n  help: "),
        ("red,red", "expected each colour once, found `red` twice"),
        (",", "expected at least one colour, found none"),
        ("colors.txt", "--palette colors.txt: cannot read it: "),
    ] {
        let answer = run(folder.path(), &["import", "-", "-o", "x.parquet", "--palette", palette], claiming("red"));
        assert!(answer.code == 2 && answer.stderr.contains(expected), "{palette}: {}", answer.stderr);
        assert!(!folder.path().join("x.parquet").exists());
    }
}

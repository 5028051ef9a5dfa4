//! The old names of commands, from before they were grouped by noun: each runs the same as its new name.

use std::fs;
use std::path::Path;

use crate::run;

#[test]
fn each_old_name_runs_the_same_command() {
    let renamed: &[(&str, &[&str])] = &[
        ("trace", &["check", "info", "recover", "renormalize", "schema", "validate"]),
        ("table", &["audit", "compare", "rescore", "verify"]),
        ("definitions", &["sensitivity", "sql"]),
        ("setup", &["completions", "config", "man"]),
        #[cfg(feature = "sim")]
        ("world", &["filmstrip", "replay"]),
    ];
    let here = Path::new(".");
    for (noun, verbs) in renamed {
        for verb in *verbs {
            let expected = run(here, &[noun, verb, "--help"]).done();
            assert_eq!(run(here, &[verb, "--help"]).done(), expected, "{verb}");
            assert_eq!(run(here, &["help", verb]).done(), expected, "help {verb}");
            assert!(expected.contains(&format!("Usage: mirrorstats {noun} {verb}")), "{expected}");
        }
    }
    let shown = run(here, &["--help"]).done() + &run(here, &["setup", "completions", "fish"]).done();
    assert!(!shown.contains("\n  renormalize") && !shown.contains("needs_command\" -f -a \"renormalize\""), "{shown}");
}

#[test]
fn settings_may_have_the_old_name_of_a_command() {
    let folder = tempfile::tempdir().unwrap();
    for section in ["schema", "trace.schema"] {
        fs::write(folder.path().join("mirrorstats.toml"), format!("[{section}]\njson = true\n")).unwrap();
        let text = run(folder.path(), &["trace", "schema"]).done();
        assert!(text.starts_with('{'), "{section}: {text}");
    }
}

//! Defaults from a file, and the message for a refused command line.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};
use tempfile::TempDir;

use crate::harness::program::{Answer, answer, program};
use crate::{fixture, run};

/// A folder with a configuration file.
fn configured(text: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("mirrorstats.toml"), text).unwrap();
    folder
}

fn with(folder: &Path, variables: &[(&str, &str)], arguments: &[&str]) -> Answer {
    // `make bless` sets these variables for the tests.
    let mut program = program(folder);
    program.env_remove("MIRRORSTATS_WRITE_SCHEMAS").env_remove("MIRRORSTATS_WRITE_REFERENCE");
    program.args(arguments).envs(variables.iter().copied());
    answer(&mut program)
}

/// The folder that `report` wrote, which shows where its default comes from.
fn written(folder: &Path, variables: &[(&str, &str)], typed: &[&str]) -> String {
    let traces = fixture("recorded/E1-oracle.parquet");
    let arguments = [&["report", traces.to_str().unwrap(), "--no-figures", "--json"], typed].concat();
    with(folder, variables, &arguments).json()["out"].as_str().unwrap().to_owned()
}

#[test]
fn options_override_the_file() {
    let folder = configured("out = \"of-all\"\n[report]\nout = \"of-report\"\n");
    let here = folder.path();
    assert_eq!(written(here, &[], &[]), "of-report");
    assert_eq!(written(here, &[], &["-o", "typed"]), "typed");
    assert_eq!(written(here, &[("MIRRORSTATS_CONFIG_FILE", "")], &[]), "reports/latest");
    let below = here.join("a/b");
    fs::create_dir_all(&below).unwrap();
    assert_eq!(written(&below, &[], &[]), "of-report", "the file of a folder above");
    fs::write(below.join("mirrorstats.toml"), "").unwrap();
    assert_eq!(written(&below, &[], &[]), "reports/latest", "the nearest file alone");
}

#[test]
fn flags_and_lists_may_stand_in_the_file() {
    let folder =
        configured("threads = 1\n[report]\nno-figures = true\nby = [\"model\", \"seed\"]\nstyle = \"paper\"\n");
    let traces = fixture("recorded/E1-oracle.parquet");
    let report = run(folder.path(), &["report", traces.to_str().unwrap(), "--json"]).json();
    assert_eq!(report["manifest"]["by"], json!(["model", "seed"]));
    assert_eq!(report["manifest"]["style"]["name"], "paper");
    assert!(!folder.path().join("reports/latest/figures").exists());
    let help = run(folder.path(), &["report", "--help"]).done();
    assert!(help.contains("[default: paper]"), "{help}");
}

#[test]
fn every_fault_of_the_file_is_underlined_before_anything_runs() {
    let folder =
        configured("threads = 0\nstyl = \"x\"\n[report]\nno-figures = \"perhaps\"\nby = { a = 1 }\n[recrd]\nx = 1\n");
    let refused = run(folder.path(), &["report", "x"]).refused();
    for words in [
        "invalid value '0' for '--threads <threads>'",
        "no option `--styl` of any command",
        "did you mean `style`?",
        "expected true or false",
        "no command `report by`",
        "no command `recrd`",
        "5 faults",
    ] {
        assert!(refused.contains(words), "{words}\n{refused}");
    }
    assert!(!folder.path().join("reports").exists());
    assert!(run(folder.path(), &["report", "--help"]).done().contains("Usage"));
    assert!(run(folder.path(), &["setup", "completions", "bash"]).done().contains("mirrorstats"));
    let gone = with(folder.path(), &[("MIRRORSTATS_CONFIG_FILE", "gone.toml")], &["score", "x"]).refused();
    assert!(gone.contains("cannot read the configuration file `gone.toml`"), "{gone}");
}

#[test]
fn errors_are_one_json_object_if_requested() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("wrong.toml"), "[metric.A]\nkind = \"rate\"\n").unwrap();
    let told = |variables: &[(&str, &str)], arguments: &[&str]| -> Value {
        let stderr = with(folder.path(), variables, arguments).ends(2).stderr;
        assert_eq!(stderr.lines().count(), 1, "{stderr}");
        serde_json::from_str(&stderr).unwrap()
    };
    let faults = told(&[], &["definitions", "check", "wrong.toml", "--errors", "json"]);
    assert_eq!(faults["code"], 2);
    assert_eq!(faults["faults"][0]["file"], "wrong.toml");
    let lines: Vec<&Value> = faults["faults"].as_array().unwrap().iter().map(|fault| &fault["line"]).collect();
    assert_eq!(lines, [1, 2]);
    let missing = told(&[("MIRRORSTATS_ERRORS", "json")], &["score", "gone"]);
    assert!(missing["error"].as_str().unwrap().contains("gone"), "{missing}");
    let usage = told(&[], &["--errors=json", "score"]);
    assert!(usage["error"].as_str().unwrap().contains("<TRACES>"), "{usage}");
    let in_words =
        with(folder.path(), &[("MIRRORSTATS_ERRORS", "json")], &["score", "gone", "--errors", "text"]).refused();
    assert!(serde_json::from_str::<Value>(&in_words).is_err(), "{in_words}");
}

#[test]
fn a_refused_option_or_command_names_the_right_one() {
    let here = Path::new(".");
    let refused = run(here, &["stats", "runs", "--published", "x.csv"]).refused();
    assert!(refused.contains("tip: `--published` is an option of `table compare`"), "{refused}");
    let refused = run(here, &["ls"]).refused();
    assert!(
        refused.contains("tip: `mirrorstats help` lists the commands") && !refused.contains("filmstrip"),
        "{refused}"
    );
    let refused = run(here, &["valdate"]).refused();
    assert!(refused.contains("a similar command exists: `trace validate`"), "{refused}");
}

#[test]
fn shells_and_manuals_know_every_command() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        assert!(run(folder.path(), &["setup", "completions", shell]).done().contains("recover"), "{shell}");
    }
    run(folder.path(), &["setup", "man", "pages/man1"]).ends(0);
    let page = fs::read_to_string(folder.path().join("pages/man1/mirrorstats-score.1")).unwrap();
    assert!(page.contains("\\-\\-explain") && page.contains("Examples:"), "{page}");
    let nested = folder.path().join("pages/man1/mirrorstats-definitions-check.1");
    assert!(nested.is_file());
    let whole = fs::read_to_string(folder.path().join("pages/man1/mirrorstats.1")).unwrap();
    for command in ["report", "setup", "trace"] {
        assert!(whole.contains(command), "{command}");
    }
}

//! Metrics and experiments are data: source code names the paper's only where it lists assets or shows an example.

use std::fs;
use std::path::{Path, PathBuf};

use regex::Regex;
use toml::Table;

/// The files that may name them, and why.
const ALLOWED: [(&str, &str); 10] = [
    (
        "crates/mirrorstats_trace/src/schema/mod.rs",
        "what a trace without `decision` means, by the experiments of the first version",
    ),
    ("crates/mirrorstats_agents/src/prompt.rs", "the prompts of the paper under their names"),
    ("crates/mirrorstats_experiment/src/built_in.rs", "the list of the built-in files"),
    ("crates/mirrorstats_experiment/src/file.rs", "an example"),
    ("crates/mirrorstats_experiment/src/lib.rs", "the list of the built-in files"),
    ("crates/mirrorstats_record/src/plan.rs", "an example"),
    ("src/cli/commands/trace/schema.rs", "two forms of a reply"),
    ("src/cli/commands/world/mod.rs", "which experiments are recorded by default"),
    ("src/cli/commands/record/mod.rs", "which experiments are recorded by default"),
    ("src/cli/help.rs", "examples"),
];

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Collects the program's source files below a folder.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let is_test =
            entry.file_name().is_some_and(|name| ["tests", "tests.rs", "target"].iter().any(|test| name == *test));
        match entry.extension() {
            _ if is_test => {}
            _ if entry.is_dir() => sources(&entry, found),
            Some(ending) if ending == "rs" => found.push(entry),
            _ => {}
        }
    }
}

/// The code of a file, without comments and unit tests, which come last.
fn code(text: &str) -> String {
    let code = text.split("#[cfg(test)]").next().unwrap_or_default();
    let is_code = |line: &&str| !line.trim_start().starts_with("//");
    code.lines().filter(is_code).collect::<Vec<_>>().join("\n")
}

#[test]
fn source_names_no_metric_and_no_experiment_of_the_paper() {
    let paper: Table = fs::read_to_string(root().join("assets/definitions/paper.toml")).unwrap().parse().unwrap();
    let names = ["metric", "experiment"].map(|key| paper[key].as_table().unwrap().keys().cloned().collect::<Vec<_>>());
    let names: Vec<String> = names.concat().iter().map(|name| regex::escape(name)).collect();
    assert_eq!(names.len(), 15);
    let paper_name = Regex::new(&format!(r"\b(?:{})\b", names.join("|"))).unwrap();
    let mut files = Vec::new();
    for folder in ["crates", "src", "python/src"] {
        sources(&root().join(folder), &mut files);
    }
    assert!(files.len() > 300);
    let mut found: Vec<String> = Vec::new();
    for file in files {
        let path = file.strip_prefix(root()).unwrap().to_string_lossy().into_owned();
        let code = code(&fs::read_to_string(&file).unwrap());
        if !ALLOWED.iter().any(|(allowed, _)| *allowed == path) {
            found.extend(paper_name.find_iter(&code).map(|name| format!("{path}: {}", name.as_str())));
        }
    }
    assert!(found.is_empty(), "metrics and experiments belong into assets: {found:#?}");
}

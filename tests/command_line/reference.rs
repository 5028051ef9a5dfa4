//! The pages of `docs/reference`, generated from the program, and their version.
//!
//! `MIRRORSTATS_WRITE_REFERENCE=1 cargo test --all-features --test command_line reference` writes them.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use regex::Regex;
use serde_json::Value;

use crate::harness::files::repository;
use crate::{reference_files, run};

/// The commands that a help text lists, except `help`: below headings, indented by two spaces.
fn commands(help: &str) -> Vec<String> {
    let listed = help.lines().skip_while(|line| !line.starts_with("Usage:")).skip(1);
    let listed = listed.take_while(|line| !line.starts_with("Options") && !line.starts_with("Arguments"));
    let names = listed.filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    names.map(|line| line.split_whitespace().next().unwrap().to_owned()).filter(|name| name != "help").collect()
}

fn collect(command: &[&str], page: &mut String) {
    let help = run(Path::new("."), &[command, &["--help"]].concat()).done();
    let name = [&["mirrorstats"], command].concat().join(" ");
    write!(page, "\n## {name}\n\n```text\n{}\n```\n", help.trim_end()).unwrap();
    for name in commands(&help) {
        collect(&[command, &[name.as_str()]].concat(), page);
    }
}

/// The `--help` of every command.
fn commands_page() -> String {
    let mut page = "# Commands\n\nThe output of `--help` for every command.\n".to_owned();
    collect(&[], &mut page);
    page
}

/// A cell of a Markdown table.
pub fn cell(value: &Value) -> String {
    let text = match value {
        Value::Null => String::new(),
        Value::String(text) => text.clone(),
        Value::Bool(value) => if *value { "yes" } else { "no" }.to_owned(),
        Value::Array(values) => values.iter().map(cell).collect::<Vec<_>>().join(", "),
        other => other.to_string(),
    };
    text.replace('|', "\\|").replace('\n', " ")
}

fn table(rows: &Value, columns: &[(&str, &str)], page: &mut String) {
    let headings: Vec<&str> = columns.iter().map(|(heading, _)| *heading).collect();
    writeln!(page, "| {} |\n|{}", headings.join(" | "), "---|".repeat(columns.len())).unwrap();
    for row in rows.as_array().unwrap() {
        let cells: Vec<String> = columns.iter().map(|(_, key)| cell(&row[key])).collect();
        writeln!(page, "| {} |", cells.join(" | ")).unwrap();
    }
}

/// The columns, footer keys and rules of traces.
fn trace_page() -> String {
    let schema = run(Path::new("."), &["trace", "schema", "--json"]).json();
    let mut page = format!("# Traces\n\n{}\n\n## Columns\n\n", cell(&schema["description"]));
    let columns = [("column", "name"), ("type", "type"), ("required", "required"), ("null", "nullable")];
    let more = [("per episode", "constant"), ("unit", "unit"), ("meaning", "doc"), ("values", "values")];
    table(&schema["columns"], &[columns, more].concat(), &mut page);
    page += "\n## Footer keys\n\n";
    table(&schema["metadata"], &[("key", "key"), ("meaning", "doc")], &mut page);
    page += "\n## Rules\n\n`mirrorstats trace validate` checks them.\n\n";
    table(
        &schema["rules"],
        &[("code", "code"), ("severity", "severity"), ("rule", "rule"), ("help", "help")],
        &mut page,
    );
    page
}

/// `llms.txt`: the title and first sentence of every page.
fn llms() -> String {
    let link = Regex::new(r"\[([^\]]*)\]\([^)]*\)").unwrap();
    let mut text =
        "# mirrorstats\n\n> Records, scores and reports episodes of embodied agents before a mirror.\n".to_owned();
    for folder in ["tutorials", "how-to", "explanation", "reference"] {
        write!(text, "\n## {folder}\n\n").unwrap();
        let entries = fs::read_dir(repository().join("docs").join(folder)).unwrap();
        let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        for name in names {
            let page = fs::read_to_string(repository().join("docs").join(folder).join(&name)).unwrap();
            let title = page.lines().next().unwrap().trim_start_matches("# ");
            let outside: String = page.split("```").step_by(2).collect();
            let is_prose = |line: &&str| line.starts_with(|c: char| c.is_alphabetic() || c == '`');
            let prose: Vec<&str> =
                outside.lines().skip_while(|line| !is_prose(line)).take_while(|line| !line.is_empty()).collect();
            let prose = link.replace_all(&prose.join(" "), "$1").into_owned();
            let first = prose.split_once(". ").map_or(prose.as_str(), |(first, _)| first).trim_end_matches(['.', ':']);
            let first = if first.is_empty() { String::new() } else { format!(": {first}.") };
            writeln!(text, "- [{title}](docs/{folder}/{name}){first}").unwrap();
        }
    }
    text
}

#[test]
fn reference_pages_are_current() {
    for (name, page) in [
        ("docs/reference/commands.md", commands_page()),
        ("docs/reference/traces.md", trace_page()),
        ("docs/reference/files.md", reference_files::page()),
        ("llms.txt", llms()),
    ] {
        let path = repository().join(name);
        if std::env::var_os("MIRRORSTATS_WRITE_REFERENCE").is_some() {
            fs::write(&path, &page).unwrap();
        }
        let is_current = fs::read_to_string(&path).unwrap() == page;
        assert!(is_current, "{}: not what the program says; MIRRORSTATS_WRITE_REFERENCE=1 writes it", path.display());
    }
}

#[test]
fn the_long_version_adds_the_features_to_the_package_version() {
    let version = run(Path::new("."), &["-V"]).done();
    assert_eq!(version, format!("mirrorstats {}\n", env!("CARGO_PKG_VERSION")));
    let long = run(Path::new("."), &["--version"]).done();
    let (first, features) = long.split_once('\n').unwrap();
    assert_eq!(format!("{first}\n"), version);
    assert_eq!(features.contains("sim"), cfg!(feature = "sim"));
    assert_eq!(features.contains("polars"), cfg!(feature = "polars"));
}

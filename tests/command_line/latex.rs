//! Every LaTeX table compiles with pdfTeX and the packages that its first line names, whatever is in its texts.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::json;

use crate::harness::files::{fixture, repository};
use crate::harness::need;
use crate::run;

/// Texts that TeX could take for something else: at the start of a row, in a pair, in a font encoding, at an edge.
const NAMES: [&str; 24] = [
    "say \"hi\"",
    "[new] push",
    " [new]",
    "*a",
    "<a> | b",
    "~ ^ \\ {x} }{",
    "a--b---c -",
    "``x'' `y' ,,z''",
    "?`x !`y <<z>>",
    "a_b & 50% $x$ #1",
    "\\input{/etc/passwd}",
    "\\\\[1em]",
    "&",
    "%",
    " a  b ",
    "é ß Ł ő … “x” €",
    "ą đ ð þ « » ŋ",
    "π0 μ Ω ≤ → −1 ± ½ † –",
    "Модель ωά e\u{301}",
    "日本語 中文 한국어",
    "עברית العربية می\u{200c}خواهم",
    "🤖 👩\u{200d}🔬 1\u{fe0f}\u{20e3}",
    "a\u{a0}b\u{3000}c",
    "zero\u{200b} right\u{202e}",
];

/// A trace with each pair of these models and experiments.
fn trace(at: &Path, name: &str, models: &[&str], experiments: &[&str]) {
    let mut lines = String::new();
    for (m, model) in models.iter().enumerate() {
        for (e, experiment) in experiments.iter().enumerate() {
            for seed in 1..=6 {
                let step = json!({
                    "episode_id": format!("{m}-{e}-{seed}"), "model": model, "experiment": experiment, "seed": seed,
                    "run": 1, "t": 1, "success": m % 2 == 0, "reward": 0.5, "action_change": 0.1, "task": "push",
                });
                writeln!(lines, "{step}").unwrap();
            }
        }
    }
    fs::write(at.join(format!("{name}.jsonl")), lines).unwrap();
    let (from, to) = (format!("{name}.jsonl"), format!("{name}.parquet"));
    run(at, &["import", &from, "-o", &to, "--definitions", "robots.toml"]).done();
}

/// All LaTeX files below a folder, by name.
fn tables(folder: &Path) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    found.retain(|path| path.extension().is_some_and(|ending| ending == "tex"));
    found.sort();
    found
}

/// The packages that the first line of each table names.
fn packages(tables: &[PathBuf]) -> BTreeSet<String> {
    let mut packages = BTreeSet::new();
    for table in tables {
        let text = fs::read_to_string(table).unwrap();
        let needs = text.lines().next().unwrap().strip_prefix("% Needs in the preamble: ");
        let needs = needs.unwrap_or_else(|| panic!("{} names no packages", table.display()));
        packages.extend(needs.split(", ").map(str::to_owned));
    }
    packages
}

fn compile(at: &Path, encoding: &str, tables: &[PathBuf]) {
    let packages: Vec<String> = packages(tables).into_iter().collect();
    let inputs =
        tables.iter().map(|path| format!("\\input{{{}}}\n\\clearpage\n", path.display())).collect::<Vec<_>>().concat();
    let document = format!(
        "\\documentclass{{article}}\n\\usepackage[{encoding}]{{fontenc}}\n{}\n\\begin{{document}}\n{inputs}\\end{{document}}\n",
        packages.join("\n")
    );
    fs::write(at.join(format!("{encoding}.tex")), document).unwrap();
    let mut tex = Command::new(need::pdftex());
    tex.args(["-interaction=nonstopmode", "-halt-on-error", "-draftmode", &format!("{encoding}.tex")]);
    let output = tex.current_dir(at).output().unwrap();
    let log = String::from_utf8_lossy(&output.stdout);
    let fault = log.find("\n!").map_or("", |at| &log[at..]);
    assert!(output.status.success(), "{encoding}: {}", fault.chars().take(1000).collect::<String>());
    let log = String::from_utf8_lossy(&fs::read(at.join(format!("{encoding}.log"))).unwrap()).into_owned();
    assert!(!log.contains("Missing character"), "{encoding}");
}

#[test]
fn every_latex_table_compiles_in_ot1_and_t1_whatever_the_names() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::copy(repository().join("examples/domains/robots.toml"), at.join("robots.toml")).unwrap();
    trace(at, "models", &NAMES, &["[new] push", "*b"]);
    trace(at, "experiments", &["[act]", "*dp"], &NAMES);
    let quoted = |text: &str| json!(text).to_string();
    let style = format!(
        "[table.main]\ntitle = {}\nnote = {}\nlabel = {}\ncolumns = ['SUCCESS']\n[table.x]\ntitle = '*'\n\
         columns = ['JERKS']\n[column.JERKS]\nlatex = '[J]'\n",
        quoted(NAMES[0]),
        quoted(&NAMES[..NAMES.len() - 1].join(" ")),
        quoted("tab:größe 日本 %&\\"),
    );
    fs::write(at.join("mine.toml"), style).unwrap();
    let mut all = Vec::new();
    for (trace, style) in [("models", "default"), ("models", "mine.toml"), ("experiments", "default")] {
        let out = format!("{trace}-{}", style.trim_end_matches(".toml"));
        let options = ["--definitions", "robots.toml", "--style", style, "--no-figures", "--out", &out];
        run(at, &[&["report", &format!("{trace}.parquet")], options.as_slice()].concat()).done();
        all.extend(tables(&at.join(out).join("tables")));
    }
    let published = fixture("recorded").display().to_string();
    run(at, &["report", &published, "--style", "paper", "--no-figures", "--out", "recorded"]).done();
    run(at, &["definitions", "sensitivity", &published, "--thresholds", "1,60", "--out", "sensitivity"]).done();
    all.extend(tables(&at.join("recorded/tables")).into_iter().chain(tables(&at.join("sensitivity"))));
    for name in ["main", "other", "x", "quality", "ranks", "sensitivity"] {
        assert!(all.iter().any(|path| path.file_stem().is_some_and(|stem| stem == name)), "no table {name}");
    }
    for encoding in ["OT1", "T1"] {
        compile(at, encoding, &all);
    }
}

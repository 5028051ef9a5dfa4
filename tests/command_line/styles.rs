//! `style`, and the position of metrics from custom definitions.

use std::fs;

use crate::{fixture, run, two_files};

const OWN: &str =
    "include = ['paper']\n[metric.GLANCES]\ntitle = 'Glances'\nvalue = 'count(mirror_visible)'\nbetter = 'higher'\n";

#[test]
fn an_own_metric_is_in_the_main_table() {
    let folder = two_files();
    let at = folder.path();
    fs::write(at.join("own.toml"), OWN).unwrap();
    for style in ["default", "paper"] {
        let shown =
            run(at, &["report", "a.parquet", "--definitions", "own.toml", "--style", style, "--out", style]).done();
        let header = shown.lines().find(|line| line.starts_with("Model")).unwrap();
        assert!(header.contains("TSA") && header.contains("GLANCES"), "{shown}");
        for name in ["tables/main.csv", "tables/main.md", "tables/main.tex", "report.html"] {
            assert!(fs::read_to_string(at.join(style).join(name)).unwrap().contains("GLANCES"), "{style}/{name}");
        }
        assert!(!at.join(style).join("tables/other.csv").exists());
    }
}

#[test]
fn metrics_that_a_style_does_not_name_follow_its_main_table() {
    let folder = two_files();
    let at = folder.path();
    fs::write(at.join("own.toml"), OWN).unwrap();
    fs::write(at.join("mine.toml"), "include = ['default']\n[table.main]\ncolumns = ['CR']\n").unwrap();
    let shown =
        run(at, &["report", "a.parquet", "--definitions", "own.toml", "--style", "mine.toml", "--out", "r"]).done();
    let (main, other) = shown.split_once("\nFurther metrics: metrics that the style does not list\n").unwrap();
    assert!(main.contains("CR") && !main.contains("GLANCES") && other.contains("GLANCES"), "{shown}");
    assert!(fs::read_to_string(at.join("r/tables/other.tex")).unwrap().contains("GLANCES"));
}

#[test]
fn a_built_in_style_is_printed_as_a_template() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for name in ["default", "paper"] {
        let text = run(at, &["style", "show", name]).done();
        assert_eq!(text, fs::read_to_string(fixture(&format!("../assets/styles/{name}.toml"))).unwrap());
        fs::write(at.join("mine.toml"), text).unwrap();
        let answer = run(at, &["style", "check", "mine.toml"]).done();
        assert!(answer.starts_with("mine.toml: no fault\n  table main: TSA, TTD"), "{answer}");
    }
    assert!(run(at, &["style", "show", "papre"]).refused().contains("did you mean `paper`?"));
}

#[test]
fn faults_of_styles_are_underlined() {
    let folder = two_files();
    let at = folder.path();
    fs::write(at.join("mine.toml"), "include = ['paper']\n[table.main]\ncolumns = ['TSA', 'MTAOT']\n").unwrap();
    for arguments in [["style", "check", "mine.toml"].as_slice(), &["report", "a.parquet", "--style", "mine.toml"]] {
        let said = run(at, arguments).refused();
        assert!(said.contains("mine.toml:3:19") && said.contains("columns = ['TSA', 'MTAOT']"), "{said}");
        assert!(said.contains("^^^^^^^") && said.contains("did you mean `MTATO`?"), "{said}");
    }
    fs::write(at.join("mine.toml"), "include = ['paper']\ncolour = 1\n[print]\nrounding = 'thrice'\n").unwrap();
    let said = run(at, &["--errors", "json", "style", "check", "mine.toml"]);
    assert_eq!((said.code, said.stderr.matches("\"line\"").count()), (2, 2), "{}", said.stderr);
}

#[test]
fn a_style_without_include_keeps_the_meaning_of_the_default_style() {
    let folder = two_files();
    let at = folder.path();
    fs::write(at.join("mine.toml"), "[table.main]\ncolumns = ['TSA', 'TTD']\n").unwrap();
    fs::write(at.join("means.toml"), "[print]\ncell = 'mean_se'\nemphasis = 'exact_mean'\n").unwrap();
    let report = |style: &str| {
        let shown = run(at, &["report", "a.parquet", "--style", style, "--no-figures", "--out", "r"]).done();
        shown.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let mine = report("mine.toml");
    assert!(mine.contains("with Wilson 95 % intervals") && mine.contains("† defined in fewer than 5"), "{mine}");
    let means = report("means.toml");
    assert!(means.contains("Values are mean ± standard error.") && !means.contains("Wilson"), "{means}");
    assert!(!means.contains("no test shows"), "{means}");
}

#[test]
fn a_table_in_latex_names_the_packages_that_it_needs() {
    let folder = two_files();
    run(folder.path(), &["report", "a.parquet", "--out", "r"]).done();
    let text = fs::read_to_string(folder.path().join("r/tables/main.tex")).unwrap();
    let first = text.lines().next().unwrap();
    for (package, used) in [("booktabs", "\\toprule"), ("graphicx", "\\resizebox"), ("[table]{xcolor}", "\\rowcolor")] {
        assert!(first.starts_with('%') && first.contains(package), "{first}");
        assert!(text.contains(used), "{used}");
    }
}

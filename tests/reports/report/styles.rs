//! Style files: what is refused and how that is said.

use std::fs;

use mirrorstats::report::style::Style;

use crate::assert_shown;
use crate::report::published;

const MAIN: &str = "[table.main]\ntitle = 'T'\ncolumns = ['TSA']\n";

/// What is said of a style file with this text, used with the paper's definitions.
fn message(text: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mine.toml");
    fs::write(&path, text).unwrap();
    let checked = Style::load(path.to_str().unwrap()).and_then(|style| style.check_against(&published::catalog()));
    let message = checked.map_or_else(|error| error.to_string(), |()| "accepted".to_owned());
    message.replace(&folder.path().display().to_string(), "")
}

#[test]
fn each_fault_of_a_style_file_is_named() {
    let faults = [
        MAIN.to_owned(),
        String::new(),
        "[table.appendix]\ntitle = 'T'\ncolumns = ['TSA']\n".to_owned(),
        format!("colour = 'red'\n{MAIN}"),
        MAIN.replace("'TSA'", "'TSA', 'MTAOT'"),
        MAIN.replace("'TSA'", "'TSA', 'TSA'"),
        MAIN.replace("'TSA'", ""),
        format!("{MAIN}undefined_as_zero = ['XYZ']\n"),
        format!("{MAIN}[column.AR-SC]\nlatex = 'x'\n"),
        format!("{MAIN}print = {{ rounding = 'thrice' }}\n"),
        format!("{MAIN}print = {{ decimals = {{ rate = 10, quantity = 1 }} }}\n"),
        format!("{MAIN}print = {{ decimals = {{ rate = -1, quantity = 1 }} }}\n"),
        format!("{MAIN}[table.'../x']\ntitle = 'T'\ncolumns = ['TSA']\n"),
        format!("{MAIN}[table.other]\ntitle = 'T'\ncolumns = ['TSA']\n"),
        "table = 3".to_owned(),
        "[table".to_owned(),
    ];
    let told: Vec<String> = faults.iter().map(|text| format!("{text}--> {}\n", message(text))).collect();
    assert_shown!("style files, and what is said of each behind an arrow", told.join("\n"));
}

#[test]
fn a_name_that_is_no_style_gets_the_nearest() {
    let message = |name: &str| Style::load(name).unwrap_err().to_string();
    assert_eq!(
        message("papre"),
        "no style `papre`: expected `default`, `paper` or the path of a style file; did you mean `paper`?"
    );
    assert_eq!(message("zzz"), "no style `zzz`: expected `default`, `paper` or the path of a style file");
    assert!(message(env!("CARGO_MANIFEST_DIR")).contains("cannot read the file"));
}

#[test]
fn a_style_is_called_after_its_file_never_its_path() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mine.toml");
    fs::write(&path, MAIN).unwrap();
    let style = Style::load(path.to_str().unwrap()).unwrap();
    assert_eq!((style.name.as_str(), style.hash.len()), ("mine", 64));
}

#[test]
fn the_built_in_styles_name_metrics_of_the_paper_only() {
    let catalog = published::catalog();
    for name in ["default", "paper"] {
        let sheet = Style::load(name).unwrap().sheet;
        for metric in sheet.table.values().flat_map(|table| &table.columns).chain(sheet.column.keys()) {
            assert!(catalog.metric.contains_key(metric), "{name}: {metric}");
        }
    }
}

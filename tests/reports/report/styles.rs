//! Style files: refusals and their messages.

use std::fs;

use mirrorstats_report::style::Style;

use crate::assert_shown;
use crate::report::published;

const MAIN: &str = "[table.main]\ntitle = 'T'\ncolumns = ['TSA']\n";

/// The message for a style file with this text, checked against the paper's definitions.
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
        "include = []\n".to_owned(),
        "include = []\n[table.appendix]\ntitle = 'T'\ncolumns = ['TSA']\n".to_owned(),
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

/// A folder with these files; the first one is the style.
fn files(files: &[(&str, &str)]) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    let first = folder.path().join(files[0].0);
    (folder, first)
}

fn fault_of(style: &std::path::Path) -> String {
    Style::load(style).unwrap_err().to_string()
}

#[test]
fn an_include_comes_first_and_the_file_overrides_it() {
    let mine = "include = ['paper', 'more/base.toml']\nundefined = 'n/a'\n[table.main]\ncolumns = ['TSA']\n\
                print = { decimals = { rate = 3, quantity = 0 } }\n[column.TSA]\nlatex = 'T'\n";
    let base = "[table.extra]\ntitle = 'Extra'\ncolumns = ['CR']\n[column.TSA]\nbetter = 'lower'\n";
    let (_folder, path) = files(&[("mine.toml", mine), ("more/base.toml", base)]);
    let (style, paper) = (Style::load(&path).unwrap(), Style::load("paper").unwrap());
    let (main, of_paper) = (&style.sheet.table["main"], &paper.sheet.table["main"]);
    assert_eq!((&main.title, &main.label, &main.columns), (&of_paper.title, &of_paper.label, &vec!["TSA".to_owned()]));
    assert_eq!(main.print.rounding, of_paper.print.rounding, "a table of keys is put together key by key");
    assert_eq!(main.print.decimals.unwrap().rate, 3);
    assert_eq!(style.sheet.table["appendix"], paper.sheet.table["appendix"]);
    assert_eq!(style.sheet.table["extra"].title, "Extra");
    assert_eq!((style.sheet.undefined.as_str(), &style.sheet.row_order), ("n/a", &paper.sheet.row_order));
    let column = &style.sheet.column["TSA"];
    assert_eq!((column.latex.as_deref(), column.better.is_some()), (Some("T"), true));
    // A built-in style may name metrics that do not exist, a custom one may not.
    let mut catalog = published::catalog();
    catalog.metric.shift_remove("AR_SC");
    assert!(style.check_against(&catalog).is_ok());
    catalog.metric.shift_remove("CR");
    assert!(style.check_against(&catalog).unwrap_err().to_string().contains("no metric `CR`"));
    // Changing an included file changes the style's hash.
    let (_other, changed) = files(&[("mine.toml", mine), ("more/base.toml", &base.replace("Extra", "Other"))]);
    assert_ne!(Style::load(&changed).unwrap().hash, style.hash);
}

#[test]
fn a_style_starts_from_the_default_style_unless_it_lists_its_includes() {
    let sheet = |list: &[(&str, &str)]| {
        let (_folder, path) = files(list);
        Style::load(path).unwrap()
    };
    let (default, paper) = (Style::load("default").unwrap().sheet, Style::load("paper").unwrap().sheet);
    let implied = sheet(&[("mine.toml", "[table.main]\ncolumns = ['CR']\n")]);
    let stated = sheet(&[("mine.toml", "include = ['default']\n[table.main]\ncolumns = ['CR']\n")]);
    assert_eq!((&implied.sheet.print, &implied.sheet.table), (&default.print, &stated.sheet.table));
    assert_eq!(sheet(&[("empty.toml", "")]).sheet, default);
    // From nothing: no daggers, and the program's own defaults.
    let alone = sheet(&[("mine.toml", &format!("include = []\n{MAIN}"))]).sheet;
    assert_eq!((alone.print.mark_n_below, alone.table.len()), (None, 1));
    // A file means the same alone and included; behind another style it only adds to that one.
    let part = "[table.extra]\ntitle = 'Extra'\ncolumns = ['CR']\n";
    let around = sheet(&[("mine.toml", "include = ['part.toml']\n"), ("part.toml", part)]).sheet;
    assert_eq!((&around.print, around.table.len()), (&default.print, default.table.len() + 1));
    let behind = sheet(&[("mine.toml", "include = ['paper', 'part.toml']\n"), ("part.toml", part)]).sheet;
    assert_eq!((&behind.print, behind.emphasis_note.as_deref()), (&paper.print, Some("")));
}

#[test]
fn cyclic_and_deep_includes_are_refused() {
    let (_folder, path) = files(&[("a.toml", "include = ['b.toml']\n"), ("b.toml", "include = ['./a.toml']\n")]);
    let said = fault_of(&path);
    assert!(said.contains("the include leads back to itself: ") && said.contains("a.toml -> "), "{said}");

    let twice = |name: &str| format!("include = ['{name}', '{name}']\n");
    let names: Vec<String> = (0..8).map(|at| format!("s{at}.toml")).collect();
    let texts: Vec<String> = names.iter().skip(1).map(|name| twice(name)).chain([MAIN.to_owned()]).collect();
    let all: Vec<(&str, &str)> = names.iter().map(String::as_str).zip(texts.iter().map(String::as_str)).collect();
    let (_folder, path) = files(&all);
    assert!(fault_of(&path).contains("at most 32 includes of a style"), "{}", fault_of(&path));
}

#[test]
fn contents_of_an_include_are_not_shown() {
    for secret in ["root:$6$hunter2:19000::\n", "password = 'hunter2'\n", "[table.hunter2]\ncolumns = 3\n"] {
        let (_folder, path) = files(&[("in/mine.toml", "include = ['../secret']\n"), ("secret", secret)]);
        let said = fault_of(&path);
        assert!(said.contains("is no style: it cannot be read from line "), "{said}");
        assert!(!said.contains("hunter2"), "{said}");
    }
    let (_folder, path) = files(&[("mine.toml", "include = ['nosuch.toml']\n")]);
    assert!(fault_of(&path).contains("cannot read the style"), "{}", fault_of(&path));
}

#[test]
fn an_unknown_style_is_refused_with_the_nearest_name() {
    let message = |name: &str| Style::load(name).unwrap_err().to_string();
    assert_eq!(
        message("papre"),
        "no style `papre`: expected `default`, `paper` or the path of a style file; did you mean `paper`?"
    );
    assert_eq!(message("zzz"), "no style `zzz`: expected `default`, `paper` or the path of a style file");
    assert!(message(env!("CARGO_MANIFEST_DIR")).contains("cannot read the file"));
}

#[test]
fn a_style_is_named_after_its_file_without_the_path() {
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

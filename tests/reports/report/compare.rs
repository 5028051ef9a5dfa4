//! A table of ours compared with a published one: differences, and errata that excuse them.

use std::fs;
use std::path::Path;

use mirrorstats_report::comparison::{PublishedComparison, choose, compare};
use mirrorstats_report::errata::Errata;
use mirrorstats_report::published::{Published, read};
use mirrorstats_report::style::Style;

use crate::assert_shown;
use crate::report::published;

fn file(text: &str) -> tempfile::NamedTempFile {
    let file = tempfile::NamedTempFile::new().unwrap();
    fs::write(&file, text).unwrap();
    file
}

fn paper(table: &str) -> Published {
    read(Path::new(&published::path(table, "csv"))).unwrap()
}

fn against(published: &Published, errata: &Errata) -> PublishedComparison {
    let style = Style::load("paper").unwrap();
    let tables = published::tables("paper");
    compare(choose(&tables, published, &style).unwrap(), published, errata)
}

/// The published main table after `change`, compared under the paper's errata.
fn changed(change: impl Fn(&str) -> String) -> PublishedComparison {
    let text = fs::read_to_string(published::path("main", "csv")).unwrap();
    against(&read(file(&change(&text)).path()).unwrap(), &Errata::of_paper())
}

#[test]
fn all_but_two_published_cells_are_as_published() {
    let main = against(&paper("main"), &Errata::of_paper());
    assert!(main.holds());
    assert_shown!("fixtures/paper against fixtures/published/main_table.csv", main.render(None));
    let appendix = against(&paper("appendix"), &Errata::of_paper());
    assert!(appendix.holds());
    assert_eq!(appendix.render(None), "appendix: 280 cells: 280 as published, 0 excused by errata, 0 differ\n");
}

#[test]
fn without_errata_the_two_slips_differ() {
    let main = against(&paper("main"), &Errata::default());
    assert!(!main.holds());
    assert_eq!((main.same, main.excused, main.differing), (238, 0, 2));
}

#[test]
fn each_field_of_a_cell_is_compared() {
    let line = "E1,Gemma4 26B,TSA,0.57,0.11,\n";
    for changed_line in [
        "E1,Gemma4 26B,TSA,0.58,0.11,\n",
        "E1,Gemma4 26B,TSA,0.57,0.12,\n",
        "E1,Gemma4 26B,TSA,0.57,0.11,bold\n",
        "E1,Gemma4 26B,TSA,,,\n",
    ] {
        let found = changed(|text| text.replace(line, changed_line));
        assert_eq!((found.same, found.excused, found.differing), (237, 2, 1), "{changed_line}");
    }
    let found = changed(|text| text.replace(line, "E1,Gemma4 26B,TSA,0.570,.11,\n".replace(",.", ",0.").as_str()));
    assert!(found.holds(), "numbers are compared as values");
}

#[test]
fn an_erratum_excuses_exactly_what_it_states() {
    for (from, to) in [("57.90,10.07", "57.89,10.07"), ("57.90,10.07", "57.90,10.08")] {
        let found = changed(|text| text.replace(from, to));
        assert_eq!((found.excused, found.differing), (1, 1), "{to}");
    }
    let found = changed(|text| text.replace("57.90,10.07", "57.91,10.07"));
    assert!(found.holds());
    assert_eq!(found.unused_errata.len(), 1);
    let text = found.render(None);
    let note = text.lines().find(|line| line.contains("not needed")).unwrap();
    assert_shown!("main_table.csv with 57.91,10.07 for 57.90,10.07, the errata of the paper", note);
}

#[test]
fn cells_of_one_side_are_listed() {
    let found = changed(|text| text.replace("E1,Gemma4 26B,TSA,0.57,0.11,\n", ""));
    assert!(found.holds());
    assert_eq!((found.cells, found.unpublished.len()), (239, 1));
    let line = "E1,Unheard Of,TSA,0.57,0.11,\n";
    let found = changed(|text| format!("{text}{line}"));
    assert!(!found.holds());
    assert_shown!(format!("main_table.csv and {line}"), found.render(None));
}

#[test]
fn a_table_that_cannot_be_chosen_is_an_error() {
    let of = |style: &str, csv: &str| {
        let published = read(file(&format!("experiment,model,metric,mean,se,emphasis\n{csv}\n")).path()).unwrap();
        let tables = published::tables(style);
        choose(&tables, &published, &Style::load(style).unwrap())
            .map(|table| table.name.clone())
            .map_err(|e| e.to_string())
    };
    assert_eq!(of("paper", "E1,a,TSA,1,1,"), Ok("main".to_owned()));
    for (style, csv) in [("paper", "E1,a,TTD,1,1,\nE1,a,SC,1,1,"), ("default", "E1,a,TSA,1,1,")] {
        assert_shown!(format!("{csv} as a table of the style {style}"), of(style, csv).unwrap_err());
    }
}

#[test]
fn errata_files_are_checked() {
    let message = |text: &str| {
        let file = file(text);
        let message = Errata::read(file.path()).unwrap_err().to_string();
        message.replace(&file.path().display().to_string(), "errata.toml")
    };
    let erratum = "[[erratum]]\ntable = 'main'\nexperiment = 'E1'\nmodel = 'a'\nmetric = 'TSA'\nfield = 'mean'\npublished = '1'\ncomputed = '2'\n";
    for text in [
        format!("{erratum}reason = ' '\n"),
        erratum.to_owned(),
        format!("{erratum}reason = 'x'\n").replace("'mean'", "'median'"),
    ] {
        assert_shown!(text.as_str(), message(&text));
    }
}

#[test]
fn the_answer_is_also_json() {
    let json = serde_json::to_value(against(&paper("main"), &Errata::of_paper())).unwrap();
    assert_eq!(json["cells"], 240);
    assert_eq!(json["differences"][0]["experiment"], "E3");
    assert_eq!(json["differences"][0]["field"], "mean");
}

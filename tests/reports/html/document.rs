//! The page as text: the same on every run, small, and self-contained.

use std::collections::BTreeSet;

use mirrorstats_report::bundle::cells_csv;
use mirrorstats_report::html::HtmlError;

use crate::html::scored::{PAPER, PAPER_PAGE, Report};

/// The names of all tags outside script and style, in order.
pub fn tags(html: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut rest = html;
    while let Some(at) = rest.find('<') {
        rest = &rest[at + 1..];
        let name: String = rest.chars().take_while(|c| c.is_ascii_alphanumeric() || "/!-".contains(*c)).collect();
        for raw in ["script", "style"] {
            if name == raw {
                rest = &rest[rest.find(&format!("</{raw}")).unwrap()..];
            }
        }
        found.push(name);
    }
    found
}

/// The value of an attribute in the opening tag at the start of `element`.
fn attribute<'a>(element: &'a str, name: &str) -> &'a str {
    let (_, rest) = element.split_once(&format!(" {name}=\"")).unwrap();
    rest.split_once('"').unwrap().0
}

#[test]
fn the_same_report_is_the_same_page() {
    assert_eq!(Report::paper().render().unwrap(), *PAPER_PAGE);
}

#[test]
fn the_page_is_small_and_asks_for_nothing() {
    let (whole, bare) = (&*PAPER_PAGE, Report::bare().render().unwrap());
    assert!(whole.len() < 1_500_000 && bare.len() < 450_000, "{} and {} bytes", whole.len(), bare.len());
    assert!(bare.find("<figure").is_none() && bare.find("#figures").is_none());
    for reference in ["<link ", " src=", "@import", "url("] {
        for (at, _) in whole.match_indices(reference) {
            let what: String = whole[at..].chars().take(60).collect();
            assert!(what.contains("data:"), "{what}");
        }
    }
    let addresses: BTreeSet<&str> = whole.match_indices("http").map(|(at, _)| &whole[at..at + 26]).collect();
    assert_eq!(
        addresses,
        BTreeSet::from(["http-equiv=\"Content-Securit", "http://www.w3.org/2000/svg"].map(|a| &a[..26]))
    );
}

#[test]
fn every_cell_carries_the_numbers_of_cells_csv() {
    for style in ["default", "paper"] {
        let report = Report::of(PAPER.clone(), &["experiment", "model"], style);
        let html = report.render().unwrap();
        let mut shown = BTreeSet::new();
        for row in html.split("<tr data-group=").skip(1) {
            let row = row.split("</tr>").next().unwrap();
            for cell in row.split("<td ").skip(1) {
                let cell = format!(" {cell}");
                let row = [attribute(row, "data-experiment"), attribute(row, "data-model")];
                let names = ["metric", "n", "sum", "sum-sq", "mean", "se", "ci-low", "ci-high"];
                let values = names.map(|name| attribute(&cell, &format!("data-{name}")));
                shown.insert([&row[..], &values[..]].concat().join(","));
            }
        }
        let expected: BTreeSet<String> = cells_csv(&report.cells).lines().skip(1).map(str::to_owned).collect();
        assert_eq!(shown, expected, "{style}");
    }
}

#[test]
fn tables_and_episodes_of_two_reports_do_not_mix() {
    let mut report = Report::bare();
    let fewer = PAPER.taken(&(0..839).collect::<Vec<_>>());
    let other = Report::of(fewer.clone(), &["experiment", "seed"], "default");
    report.episodes = fewer;
    assert!(matches!(report.render(), Err(HtmlError::OtherEpisodes)));
    report.episodes = PAPER.clone();
    report.tables = other.tables;
    assert!(matches!(report.render(), Err(HtmlError::StrayRow { .. })));
}

#[test]
fn any_grouping_and_no_episode_at_all_make_a_page() {
    for by in [&["experiment", "model", "seed"][..], &["model"], &["seed"], &["body_color", "seed"]] {
        let report = Report::of(PAPER.clone(), by, "default");
        assert_eq!(report.render().unwrap().matches("<tr data-group=").count(), rows(&report), "{by:?}");
    }
    let none = PAPER.taken(&[]);
    assert!(Report::of(none, &["experiment", "model"], "default").render().unwrap().contains("0 episodes of 0 models"));
}

fn rows(report: &Report) -> usize {
    report.tables.len() * report.cells.groups.len()
}

#[test]
fn a_cell_without_a_value_is_dimmed_and_a_printed_zero_is_not() {
    let page = Report::of(PAPER.clone(), &["experiment", "model"], "paper").render().unwrap();
    let tables = &page[page.find("<table class=\"results\"").unwrap()..];
    let undefined: Vec<&str> = tables.split("<td ").skip(1).filter(|cell| cell.contains(" data-mean=\"\"")).collect();
    let zero = |cell: &&&str| cell.contains(">0.00 ± 0.00</");
    assert!(undefined.iter().any(|cell| zero(&cell)) && undefined.iter().any(|cell| !zero(&cell)));
    for cell in &undefined {
        assert_eq!(cell.contains(" class=\"undefined\""), !zero(&cell), "{cell}");
    }
    assert!(page.contains(".results td.undefined { color"));
}

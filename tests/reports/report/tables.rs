//! Tables at the library boundary: the published ones character for character, and hostile names.

use std::fmt::Write as _;
use std::fs;

use mirrorstats_exact::moments::Moments;
use mirrorstats_metric::catalogs::catalog::{Better, Catalog, Kind, StandardError};
use mirrorstats_report::layout::{self, MetricTable, Spread, Value};
use mirrorstats_report::style::Style;
use mirrorstats_score::cells::{Cells, Group, KeyValue};
use mirrorstats_tables::{Emphasis, Marks, Terminal};

use crate::assert_shown;
use crate::report::published::{self, metric_of};

fn table(style: &str, name: &str) -> MetricTable {
    published::tables(style).into_iter().find(|table| table.name == name).unwrap()
}

/// Lines of `text` without comments.
fn lines(text: &str) -> Vec<&str> {
    text.lines().filter(|line| !line.starts_with('%')).collect()
}

/// The published LaTeX with the paper's two slips corrected.
fn corrected(table: &str) -> String {
    let printed = fs::read_to_string(published::path(table, "tex")).unwrap();
    let slip = "$57.90 \\pm 10.07$";
    let quirk = "$93.43 \\pm 4.14$ & $\\mathbf{1.00 \\pm 0.00}$ & $\\mathbf{0.00 \\pm 0.00}$";
    let right = "$93.43 \\pm 4.14$ & $\\mathbf{1.00 \\pm 0.00}$ & $\\underline{0.00 \\pm 0.00}$";
    if table == "main" {
        assert_eq!((printed.matches(slip).count(), printed.matches(quirk).count()), (1, 1));
    }
    printed.replace(slip, "$57.91 \\pm 10.07$").replace(quirk, right)
}

#[test]
fn the_published_tables_come_out_character_for_character() {
    for name in ["main", "appendix"] {
        let (ours, theirs) = (table("paper", name).printed().latex(), corrected(name));
        for (ours, theirs) in lines(&ours).into_iter().zip(lines(&theirs)) {
            assert_eq!(ours, theirs, "{name}");
        }
        assert_eq!(lines(&ours).len(), lines(&theirs).len(), "{name}");
    }
}

#[test]
fn the_published_csv_files_come_out_but_for_the_slips() {
    for (name, slips) in [("main", 2), ("appendix", 0)] {
        let (ours, theirs) =
            (table("paper", name).records().csv(), fs::read_to_string(published::path(name, "csv")).unwrap());
        let differing = ours.lines().zip(theirs.lines()).filter(|(a, b)| a != b).count();
        assert_eq!((ours.lines().count(), differing), (theirs.lines().count(), slips), "{name}");
    }
}

/// A key, the episodes, and for each metric of the catalog its (n, sum, sum of squares).
type RowOf<'a> = (&'a [KeyValue], u64, &'a [(u64, i128, i128)]);

fn cells(by: &[&str], catalog: Catalog, groups: &[RowOf]) -> Cells {
    let moments = |&(n, sum, sum_sq): &(u64, i128, i128)| Moments { n, sum, sum_sq };
    Cells {
        by: by.iter().map(|&key| key.to_owned()).collect(),
        metrics: catalog.metric.keys().cloned().collect(),
        ranges: Vec::new(),
        groups: groups
            .iter()
            .map(|&(key, episodes, of)| Group {
                key: key.to_vec(),
                episodes,
                moments: of.iter().map(moments).collect(),
                repeats: false,
            })
            .collect(),
        catalog,
    }
}

fn text(text: &str) -> KeyValue {
    KeyValue::Text(text.to_owned())
}

/// A rate, a conditional rate, a quantity where lower is better, and a conditional quantity without a direction.
fn small_catalog() -> Catalog {
    let conditional = Some("some condition".to_owned());
    let mut catalog = published::catalog();
    catalog.metric.clear();
    for (name, metric) in [
        ("TSA", metric_of(Kind::Rate, Better::Higher, None, StandardError::Sample)),
        ("MTATO", metric_of(Kind::Rate, Better::Higher, conditional.clone(), StandardError::Sample)),
        ("TTD", metric_of(Kind::Quantity, Better::Lower, None, StandardError::Sample)),
        ("GAZE", metric_of(Kind::Quantity, Better::Neither, conditional, StandardError::Sample)),
    ] {
        catalog.metric.insert(name.to_owned(), metric);
    }
    catalog
}

/// Every table of some cells in every format, under a style.
fn everything(cells: &Cells, style: &str) -> String {
    let mut all = String::new();
    for table in layout::tables(cells, &Style::load(style).unwrap()).unwrap() {
        for (format, text) in [
            ("terminal", table.printed().terminal(Terminal::default())),
            ("narrow terminal", table.printed().terminal(Terminal { width: Some(50), emphasis: Marks::Ansi })),
            ("markdown", table.printed().markdown()),
            ("csv", table.records().csv()),
            ("latex", table.printed().latex()),
        ] {
            writeln!(all, "######## {} as {format}\n{text}", table.name).unwrap();
        }
    }
    all.replace('\x1b', "␛")
}

/// The cells as text: each group's key, then n, sum and sum of squares of each metric.
fn counts(cells: &Cells) -> String {
    let group = |group: &Group| {
        let moments =
            group.moments.iter().zip(&cells.metrics).map(|(m, name)| format!("{name} {} {} {}", m.n, m.sum, m.sum_sq));
        format!("{:?}: {}", group.key, moments.collect::<Vec<_>>().join(", "))
    };
    cells.groups.iter().map(group).collect::<Vec<_>>().join("\n")
}

fn hostile() -> Cells {
    let rows: &[RowOf] = &[
        (&[text("E1"), text("a|b")], 3, &[(3, 3, 3), (3, 1, 1), (3, 30, 302), (3, 6, 12)]),
        (&[text("E1"), text("=HYPERLINK(\"x\")")], 3, &[(3, 2, 2), (2, 2, 2), (3, 30, 300), (1, 4, 16)]),
        (&[text("E1"), text("\\input{x}%$&#_^~")], 3, &[(3, 1, 1), (1, 1, 1), (3, 33, 400), (0, 0, 0)]),
        (&[text("E1"), text("\x1b[31m<b>\n[x](y)`")], 3, &[(3, 0, 0), (0, 0, 0), (3, 36, 500), (2, 4, 10)]),
        (
            &[text("unknown & new"), text("日本語 model, with a name of forty letters")],
            9,
            &[(9, 9, 9), (9, 0, 0), (9, 900, 90000), (9, 9, 21)],
        ),
    ];
    cells(&["experiment", "model"], small_catalog(), rows)
}

#[test]
fn hostile_names_stay_names() {
    assert_shown!("hostile_default", counts(&hostile()), everything(&hostile(), "default"));
    assert_shown!("hostile_paper", counts(&hostile()), everything(&hostile(), "paper"));
}

#[test]
fn marks_agree_with_the_caption() {
    let table = layout::tables(&hostile(), &Style::load("default").unwrap()).unwrap().remove(0);
    let cells: Vec<_> = table.groups.iter().flat_map(|group| &group.rows).flat_map(|row| &row.cells).collect();
    for cell in &cells {
        assert_eq!(cell.is_marked, cell.n > 0 && cell.n < 5, "defined in fewer than 5 episodes: {cell:?}");
        if let Value::Mean { n, spread, .. } = cell.value {
            let is_withheld = spread == Spread::Unknown;
            assert_eq!(
                n.is_some(),
                cell.n != cell.episodes || is_withheld,
                "not all episodes, or no interval: {cell:?}"
            );
        }
    }
    assert!(cells.iter().any(|cell| cell.is_marked) && cells.iter().any(|cell| cell.n > 4 && !cell.is_marked));
    let marked = cells.iter().filter(|cell| cell.is_marked).count();
    let (html, dagger) = (table.printed().html(), "†");
    for (format, text, mark) in [
        ("terminal", table.printed().terminal(Terminal::default()), dagger),
        ("markdown", table.printed().markdown(), dagger),
        ("latex", table.printed().latex(), "$^{\\dagger}$"),
        ("html", html, dagger),
    ] {
        assert_eq!(text.matches(mark).count(), marked + 1, "{format}: each of them, and the caption");
        let text = text.replace('\n', " ");
        assert!(text.contains(&format!("{mark} defined in fewer than 5 episodes.")), "{format}");
        assert!(text.contains("n given where it is not all episodes, or where the interval is withheld."), "{format}");
    }
}

#[test]
fn a_higher_mean_alone_is_not_marked_as_best() {
    let row = |name: &str, successes: i128| (vec![text("E1"), text(name)], successes);
    let two = [row("a", 9), row("b", 1)];
    let rows: Vec<_> =
        two.iter().map(|(key, sum)| (key, [(9, *sum, *sum), (0, 0, 0), (9, sum * 9, 81 * sum), (0, 0, 0)])).collect();
    let rows: Vec<RowOf> = rows.iter().map(|(key, of)| (key.as_slice(), 9, of.as_slice())).collect();
    let all = everything(&cells(&["experiment", "model"], small_catalog(), &rows), "default");
    for sign in [
        "*9/9*",
        "Marked as",
        "In bold",
        "_9/9_",
        "_1/9_",
        "<ins>",
        "\\underline",
        "_second best_",
        ",underline",
        "\u{241b}[4m",
    ] {
        assert!(!all.contains(sign), "{sign}: {all}");
    }
    assert!(all.contains("9/9"), "{all}");
}

#[test]
fn one_model_is_not_the_best() {
    let row: RowOf = (&[text("E1"), text("GPT")], 1, &[(1, 0, 0), (0, 0, 0), (1, 7, 49), (1, 1, 1)]);
    let one = cells(&["experiment", "model"], small_catalog(), &[row]);
    assert_shown!(counts(&one), everything(&one, "default"));
}

#[test]
fn no_episodes_give_a_table_without_rows() {
    for style in ["default", "paper"] {
        let none = cells(&["experiment", "model"], small_catalog(), &[]);
        for table in layout::tables(&none, &Style::load(style).unwrap()).unwrap() {
            assert!(table.groups.is_empty());
            assert!(table.printed().latex().contains("\\bottomrule"));
            assert!(table.printed().markdown().ends_with('\n') && table.records().csv().lines().count() == 1);
            assert!(table.printed().terminal(Terminal::default()).contains("Model"));
        }
    }
}

#[test]
fn every_metric_is_in_some_table() {
    let mut catalog = small_catalog();
    let names = |catalog: Catalog| -> Vec<(String, Vec<String>)> {
        let tables = layout::tables(&cells(&["model"], catalog, &[]), &Style::load("default").unwrap()).unwrap();
        let columns = |table: &MetricTable| table.columns.iter().map(|column| column.metric.clone()).collect();
        tables.iter().map(|table| (table.name.clone(), columns(table))).collect()
    };
    let of =
        |name: &str, columns: &[&str]| (name.to_owned(), columns.iter().map(|&c| c.to_owned()).collect::<Vec<_>>());
    assert_eq!(names(catalog.clone()), [of("main", &["TSA", "TTD", "MTATO", "GAZE"]), of("appendix", &["TSA"])]);
    catalog.metric.retain(|name, _| name == "GAZE");
    assert_eq!(names(catalog), [of("main", &["GAZE"])]);
}

#[test]
fn any_keys_can_group_and_name_rows() {
    let one: &[(u64, i128, i128)] = &[(3, 2, 2), (2, 1, 1), (3, 30, 302), (3, 6, 12)];
    let int = KeyValue::Int;
    let outline = |by: &[&str], keys: &[&[KeyValue]]| {
        let rows: Vec<RowOf> = keys.iter().map(|&key| (key, 3, one)).collect();
        let table =
            layout::tables(&cells(by, small_catalog(), &rows), &Style::load("paper").unwrap()).unwrap().remove(0);
        let mut lines = vec![format!("by {} -> {}", by.join(","), table.row_heading)];
        for group in &table.groups {
            let rows: Vec<&str> = group.rows.iter().map(|row| row.name.as_str()).collect();
            let is_plain = group.rows.iter().flat_map(|row| &row.cells).all(|cell| cell.emphasis == Emphasis::Plain);
            lines.push(format!("  {:?}: {rows:?}{}", group.heading, if is_plain { "" } else { ", emphasised" }));
        }
        lines.join("\n")
    };
    let outlines = [
        outline(&["model"], &[&[text("Claude Sonnet 4.6")], &[text("Another")], &[text("Ministral 3 14B")]]),
        outline(&["seed"], &[&[int(9)], &[int(10)], &[int(100)]]),
        outline(&["experiment"], &[&[text("A0")], &[text("E2")], &[text("E1")]]),
        outline(
            &["experiment", "model", "seed"],
            &[
                &[text("E1"), text("a"), int(2)],
                &[text("E1"), text("a"), int(10)],
                &[text("E1"), text("b"), int(2)],
                &[text("E1"), text("b"), int(10)],
            ],
        ),
        outline(
            &["model", "experiment"],
            &[&[text("a"), text("E2")], &[text("b"), text("E1")], &[text("b"), text("E2")]],
        ),
        outline(
            &["body_color", "seed"],
            &[&[KeyValue::Missing, int(1)], &[text("red"), int(1)], &[text("red"), int(2)]],
        ),
        outline(&["seed", "body_color"], &[&[int(1), KeyValue::Missing], &[int(1), text("red")]]),
    ];
    assert_shown!("tables by these keys, as the groups and the rows that they get", outlines.join("\n"));
}

#[test]
fn a_rate_of_zero_keeps_its_uncertainty() {
    let spelled = |style: &str| everything(&hostile(), style);
    assert!(spelled("default").contains("0/9 [.00, .30]"));
    assert!(spelled("default").contains("(all equal)"));
}

//! Tables at the library boundary: the published ones character for character, and what a hostile name can do.

mod published;

use std::fs;

use mirrorstats::report::table::Table;
use mirrorstats::report::tables::{csv, latex};

fn table(style: &str, name: &str) -> Table {
    published::tables(style).into_iter().find(|table| table.name == name).unwrap()
}

/// Lines of `text` without comments.
fn lines(text: &str) -> Vec<&str> {
    text.lines().filter(|line| !line.starts_with('%')).collect()
}

/// The published LaTeX with the two slips of the paper put right.
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
        let (ours, theirs) = (latex::render(&table("paper", name)), corrected(name));
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
            (csv::render(&table("paper", name)), fs::read_to_string(published::path(name, "csv")).unwrap());
        let differing = ours.lines().zip(theirs.lines()).filter(|(a, b)| a != b).count();
        assert_eq!((ours.lines().count(), differing), (theirs.lines().count(), slips), "{name}");
    }
}

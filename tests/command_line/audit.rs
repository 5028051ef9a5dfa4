//! `audit` at the process boundary: the paper's tables, forgeries of them, refusals.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::harness::files::fixture;
use crate::harness::program::Answer;
use crate::{assert_shown, run};

const MAIN: &str = "published/main_table.csv";
const APPENDIX: &str = "published/appendix_table.csv";

fn audited(folder: &Path, tables: &[&str], options: &[&str]) -> Answer {
    run(folder, &[&["table", "audit"], tables, &["--n", "21"], options].concat())
}

#[test]
fn a_mean_of_the_papers_main_table_is_infeasible_rounded_twice() {
    let (main, appendix) = (fixture(MAIN), fixture(APPENDIX));
    let tables = [main.to_str().unwrap(), appendix.to_str().unwrap()];
    let text = audited(Path::new("."), &tables[..1], &["--rounding", "twice"]).ends(1).stdout;
    assert_shown!("table audit main_table.csv --n 21 --rounding twice", text);
    // Rounded once, 1216/21 prints the same.
    let text = audited(Path::new("."), &tables, &[]).done();
    assert_eq!(text, "520 of 520 cells are feasible with n = 21\n");
}

/// Raises one number of the main table by 0.01, in every eleventh cell in turn, and counts the cells that are named.
#[test]
fn most_forged_cells_of_the_papers_table_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let table = fs::read_to_string(fixture(MAIN)).unwrap();
    let lines: Vec<&str> = table.lines().collect();
    let (mut forged, mut named) = (0, 0);
    for at in (1..lines.len()).step_by(11) {
        let mut fields: Vec<String> = lines[at].split(',').map(str::to_owned).collect();
        let [experiment, model, metric] = [0, 1, 2].map(|field| fields[field].clone());
        let units: u32 = fields[3].replace('.', "").parse().unwrap();
        fields[3] = format!("{}.{:02}", (units + 1) / 100, (units + 1) % 100);
        let mut lines = lines.clone();
        let line = fields.join(",");
        lines[at] = &line;
        fs::write(folder.path().join("forged.csv"), lines.join("\n")).unwrap();
        let answer = audited(folder.path(), &["forged.csv"], &["--rounding", "twice", "--json"]).ends(1).stdout;
        let json: Value = serde_json::from_str(&answer).unwrap();
        let is_it =
            |cell: &&Value| [&cell["experiment"], &cell["model"], &cell["metric"]] == [&experiment, &model, &metric];
        forged += 1;
        named += usize::from(json["infeasible"].as_array().unwrap().iter().any(|cell| is_it(&cell)));
    }
    assert_eq!((named, forged), (22, 22));
}

#[test]
fn each_cell_is_audited_by_itself() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let audit = |cells: &str| {
        fs::write(at.join("t.csv"), format!("experiment,model,metric,mean,se,emphasis\n{cells}")).unwrap();
        audited(at, &["t.csv"], &[])
    };
    for (cell, field, nearest) in [
        ("E1,a,TSA,0.50,0.11,", "mean", "0.48, 0.52"),
        ("E1,a,TSA,0.57,0.15,", "se", ""),
        ("E1,a,TTD,57.91,0.00,", "se", ""),
    ] {
        let told = audit(&format!("{cell}\nE1,b,TSA,0.57,0.11,\nE1,b,TTD,,,\n")).ends(1).stdout;
        assert!(told.contains("2 of 3 cells") && told.contains(field) && told.contains(nearest), "{told}");
    }
    // A metric with a condition counts any number of the episodes.
    audit("E1,a,TSA-C,0.50,0.11,\n").done();
    assert!(audit("E1,a,TSB,0.5,,\n").refused().contains("the definitions `paper` have no metric `TSB`"));
    assert!(audit("E1,a,TSA,0.5714285714,,\n").refused().contains("at most 9 digits, found `0.5714285714`"));
}

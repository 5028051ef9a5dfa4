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
    run(folder, &[&["audit"], tables, &["--n", "21"], options].concat())
}

/// The JSON answer of an audit that found something.
fn found(answer: Answer) -> Value {
    serde_json::from_str(&answer.ends(1).stdout).unwrap()
}

#[test]
fn two_cells_of_the_papers_520_are_infeasible() {
    let (main, appendix) = (fixture(MAIN), fixture(APPENDIX));
    let tables = [main.to_str().unwrap(), appendix.to_str().unwrap()];
    let text = audited(Path::new("."), &tables, &[]).ends(1).stdout;
    assert_shown!("audit main_table.csv appendix_table.csv --n 21", text);
    let json = found(audited(Path::new("."), &tables, &["--json"]));
    assert_eq!([&json["cells"], &json["feasible"]], [520, 518]);
    let named = json["infeasible"].as_array().unwrap().iter().map(|cell| {
        ["experiment", "model", "metric", "field"].map(|key| cell[key].as_str().unwrap().to_owned()).join(" ")
    });
    assert_eq!(named.collect::<Vec<_>>(), ["E3 Gemma4 26B TTD mean", "E5 Ministral 3 14B MTATO emphasis"]);
    // The appendix alone has no infeasible cell.
    let appendix = audited(Path::new("."), &tables[1..], &[]).done();
    assert!(appendix.ends_with("280 of 280 cells are feasible\n"), "{appendix}");
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
        let json = found(audited(folder.path(), &["forged.csv"], &["--rounding", "twice", "--json"]));
        let is_it =
            |cell: &&Value| [&cell["experiment"], &cell["model"], &cell["metric"]] == [&experiment, &model, &metric];
        forged += 1;
        named += usize::from(json["infeasible"].as_array().unwrap().iter().any(|cell| is_it(&cell)));
    }
    assert_eq!((named, forged), (22, 22));
}

#[test]
fn rows_may_have_their_own_number_of_episodes() {
    let folder = tempfile::tempdir().unwrap();
    let table = "experiment,model,metric,mean,se,emphasis\nE1,a,TSA,0.57,0.11,\nE2,a,TSA,0.50,0.11,\n";
    fs::write(folder.path().join("t.csv"), table).unwrap();
    let audit = |n: &str| run(folder.path(), &["table", "audit", "t.csv", "--n", n]);
    assert!(audit("21").ends(1).stdout.contains("no count over 21 episodes has a mean that prints 0.50"));
    audit("E1=21,E2=22").done();
    audit("21,E2/a=22").done();
    assert!(audit("E1=21").refused().contains("E2, a: expected a number of episodes, found none; add `E2=N` to --n"));
    assert!(audit("21,E9=20").refused().contains("`E9` names no row of the tables"));
    let stranger = table.replace("TSA", "TSB");
    fs::write(folder.path().join("t.csv"), stranger).unwrap();
    assert!(audit("21").refused().contains("the definitions `paper` have no metric `TSB`"));
    let long = table.replace("0.57", "0.5714285714");
    fs::write(folder.path().join("t.csv"), long).unwrap();
    assert!(audit("21").refused().contains("expected a number of at most 9 digits, found `0.5714285714`"));
}

#[test]
fn large_numbers_are_decided_in_time() {
    let folder = tempfile::tempdir().unwrap();
    let header = "experiment,model,metric,mean,se,emphasis\n";
    let table = "E1,a,TSA,0.57,0.01,\nE1,a,TSA-C,0.80,0.01,\nE1,a,MCR,0.71,0.01,\nE1,a,MTATO,0.58,0.01,\nE1,a,TTD,47.67,0.81,\n";
    fs::write(folder.path().join("t.csv"), header.to_owned() + table).unwrap();
    run(folder.path(), &["table", "audit", "t.csv", "--n", "2000", "--rounding", "half-even"]).done();
}

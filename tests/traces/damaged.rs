//! Every file of `fixtures/damaged/` is refused with the code that the README names, without a panic.

use std::collections::BTreeMap;
use std::fs;
use std::num::NonZeroUsize;
use std::path::PathBuf;

use mirrorstats_trace::diagnostic::{Code, Severity};
use mirrorstats_trace::error::TraceError;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::scan::Projection;
use mirrorstats_trace::schema;

use crate::harness::files::fixture;
use crate::harness::program::{answer, program, run};

#[path = "../../examples/damage.rs"]
#[expect(dead_code, reason = "an example's main is of no use here")]
mod damage;

fn folder() -> PathBuf {
    fixture("damaged")
}

/// The codes in the README's table with their files; a pair of files has one code.
fn cases() -> BTreeMap<String, Vec<(String, String)>> {
    let readme = fs::read_to_string(folder().join("README.md")).unwrap();
    let mut cases: BTreeMap<String, Vec<_>> = BTreeMap::new();
    for line in readme.lines().filter(|line| line.starts_with("| `")) {
        let cells: Vec<_> = line.split('|').map(|cell| cell.trim().trim_matches('`')).collect();
        let stem = cells[1].trim_end_matches(".parquet").trim_end_matches("-1").trim_end_matches("-2");
        cases.entry(stem.to_owned()).or_default().push((cells[1].to_owned(), cells[2].to_owned()));
    }
    cases
}

#[test]
fn the_files_equal_the_generated_ones() {
    let files = damage::damaged_files().unwrap();
    for file in &files {
        let kept = fs::read(folder().join(file.name)).unwrap();
        assert!(kept == file.bytes, "{}: run `cargo run --example damage`", file.name);
    }
    assert_eq!(fs::read_to_string(folder().join("README.md")).unwrap(), damage::readme(&files));
    assert_eq!(fs::read_dir(folder()).unwrap().count(), files.len() + 1, "a file that nobody makes");
}

#[test]
fn every_code_of_damage_has_its_file() {
    let kept: Vec<_> = cases().into_values().flatten().map(|(_, code)| code).collect();
    for code in Code::ALL {
        // An unreadable file has no content to store, and notes are not damage. Values that definitions declare need
        // definitions: tests/command_line/domains.rs.
        let elsewhere = [Code::Unreadable, Code::UnknownValue].contains(&code) || code.severity() == Severity::Note;
        assert!(elsewhere || kept.iter().any(|kept| kept == code.name()), "{code} has no file");
    }
}

#[test]
fn validate_names_the_damage() {
    for (case, files) in cases() {
        let mut command = program(&folder());
        let answer = answer(command.args(["trace", "validate", "--json"]).args(files.iter().map(|(name, _)| name)));
        let report: serde_json::Value = serde_json::from_str(&answer.stdout).unwrap();
        let code = &files[0].1;
        assert_eq!((answer.code, answer.stderr.as_str()), (1, ""), "{case}");
        let found: Vec<_> = report["findings"].as_array().unwrap().iter().map(|finding| &finding["code"]).collect();
        assert!(!found.is_empty() && found.iter().all(|found| *found == code), "{case}: {found:?}");
    }
}

fn scan(names: &[&str]) -> TraceError {
    let inputs: Vec<_> = names.iter().map(|name| Input::new(folder().join(name))).collect();
    let set = match TraceSet::open(&inputs) {
        Ok(set) => set,
        Err(error) => return error,
    };
    let projection = Projection {
        steps: set.column_names().into_iter().map(str::to_owned).collect(),
        experiments: Some(["E1", "E2", "E3", "E4", "E5"].map(str::to_owned).to_vec()),
        ..Projection::default()
    };
    set.scan(&projection, NonZeroUsize::MIN, |_| Ok::<_, TraceError>(()), |()| Ok(())).unwrap_err()
}

#[test]
fn a_scan_refuses_all_of_them() {
    for (case, files) in cases() {
        let names: Vec<_> = files.iter().map(|(name, _)| name.as_str()).collect();
        match scan(&names) {
            TraceError::Finding { first, .. } => {
                assert_eq!(first.code.name(), files[0].1, "{case}");
                assert!(names.iter().any(|name| first.file.ends_with(name)), "{case}: {first}");
                let known = first.column.as_deref().is_none_or(|column| schema::column(column).is_some());
                assert!(known && !first.expected.is_empty() && !first.help.is_empty(), "{case}: {first}");
            }
            other => panic!("{case}: {other}"),
        }
    }
}

#[test]
fn one_damaged_file_does_not_hide_the_others() {
    let files = ["truncated.parquet", "t-gap.parquet", "empty.parquet"];
    let answer = run(&folder(), &[&["trace", "validate", "--json"][..], &files].concat());
    let report: serde_json::Value = serde_json::from_str(&answer.stdout).unwrap();
    let findings = report["findings"].as_array().unwrap();
    let pairs: Vec<_> = findings.iter().map(|f| (f["file"].as_str().unwrap(), f["code"].as_str().unwrap())).collect();
    let expected = [("empty.parquet", "empty-file"), ("t-gap.parquet", "t-gap"), ("truncated.parquet", "truncated")];
    assert_eq!(pairs, expected);
    assert_eq!(report["files"][1]["episodes"], 2);
}

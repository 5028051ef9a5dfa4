//! Queries with related answers that must be consistent, in the manner of `SQLancer`, on every engine.
//!
//! TLP: the result over some steps equals the combined results over those where a condition is true, false and null.
//! `NoREC`: `where` keeps exactly the episodes for which the condition, computed as a metric, is 1. Neither needs a
//! second engine; other engines must also match the native one. Source: Rigger and Su, "Finding Bugs in Database
//! Systems via Query Partitioning" (2020), "Detecting Optimization Bugs in Database Engines via Non-Optimizing
//! Reference Engine Construction" (2020).

pub mod engines;
mod on_cluster;
mod words;

use std::collections::BTreeMap;

use proptest::prelude::*;
use proptest::strategy::ValueTree as _;
use proptest::test_runner::{Config, RngSeed, TestRunner};

use crate::author::{PARTS, definitions, partitions};
use crate::differential::trace::{Sheet, sheets};
use crate::language::{Definition, toml};
use engines::{Case, Engine, Rows};
use words::{EVERYWHERE, TAME};

/// The filters of a case, after the query without a filter.
const FILTERS: [&str; 3] = ["e", "not e", "e is null"];

/// `count` random cases; a fixed seed gives the same ones.
fn cases<S>(strategy: impl Strategy<Value = S>, count: usize, rng_seed: RngSeed) -> Vec<S> {
    let mut runner = TestRunner::new(Config { rng_seed, failure_persistence: None, ..Config::default() });
    (0..count).map(|_| strategy.new_tree(&mut runner).unwrap().current()).collect()
}

/// Makes files that any engine can combine: integers of one width.
fn plain(mut sheets: Vec<Sheet>) -> Vec<Sheet> {
    let wide = sheets[0].wide;
    for sheet in &mut sheets {
        sheet.wide = wide;
    }
    sheets
}

fn case((definitions, sheets): (Vec<Definition>, Vec<Sheet>), filters: &[&'static str]) -> Case {
    Case { text: toml(&definitions), sheets: plain(sheets), filters: filters.to_vec() }
}

/// Checks that an engine's parts and filters are consistent, and that its answers are those of the native engine.
fn check_parts(engine: Engine, count: usize, seed: RngSeed) {
    let all = cases((partitions(&TAME), sheets()), count, seed);
    let all: Vec<Case> = all.into_iter().map(|found| case(found, &FILTERS)).collect();
    let (native, answers) = (engines::answers(Engine::Native, &all), engines::answers(engine, &all));
    let mut whole = 0;
    for ((case, native), answers) in all.iter().zip(native).zip(answers) {
        let Some(expected) = engines::rows(&native) else { continue };
        let found = engines::rows(&answers).unwrap_or_else(|| panic!("{engine:?} refuses: {answers:?}\n{case}"));
        assert_eq!(found, expected, "{engine:?}, native\n{case}");
        let faults = faults(&found);
        assert!(faults.is_empty(), "{engine:?}: {faults:#?}\n{case}");
        whole += 1;
    }
    assert!(whole * 4 > count * 3, "of {count} cases {whole} have an answer");
}

/// The contradictions in an engine's answers.
fn faults(answers: &[Rows]) -> Vec<String> {
    let [all, filtered @ ..] = answers else { return vec!["no answer".into()] };
    let mut faults = Vec::new();
    for (key, row) in &all.values {
        let value = |part: &str, name: &str| row[all.place(&format!("{part}_{name}"))];
        let parts = |name: &str| PARTS.iter().filter_map(|part| value(part, name)).collect::<Vec<i64>>();
        for name in ["count", "any", "first", "last", "min", "max", "sum"] {
            let parts = parts(name);
            let whole = match name {
                "count" | "sum" => (!parts.is_empty()).then(|| parts.iter().sum()),
                "first" | "min" => parts.iter().min().copied(),
                _ => parts.iter().max().copied(),
            };
            if whole != value("all", name) {
                faults.push(format!("{key:?}: {name} is {:?}, of its parts {whole:?}", value("all", name)));
            }
        }
        if row[all.place("norec_p")] != row[all.place("count_p")] {
            faults.push(format!("{key:?}: {row:?}, the steps of p are not its sum"));
        }
    }
    let holds = all.place("holds");
    for (filtered, expected) in filtered.iter().zip([Some(1), Some(0), None]) {
        let left: BTreeMap<_, _> = all.values.iter().filter(|(_, row)| row[holds] == expected).collect();
        if left != filtered.values.iter().collect() {
            faults.push(format!("where `e` is {expected:?}: {:?}, not {left:?}", filtered.values));
        }
    }
    faults
}

/// Checks that an engine gives the native engine's answers for random definitions.
fn check_definitions(engine: Engine, count: usize, seed: RngSeed) {
    let all = cases((definitions(&EVERYWHERE), sheets()), count, seed);
    let all: Vec<Case> = all.into_iter().map(|found| case(found, &[])).collect();
    let (native, found) = (engines::answers(Engine::Native, &all), engines::answers(engine, &all));
    let mut whole = 0;
    for ((case, native), found) in all.iter().zip(native).zip(found) {
        let Some(expected) = engines::rows(&native) else { continue };
        let found = engines::rows(&found).unwrap_or_else(|| panic!("{engine:?} refuses: {found:?}\n{case}"));
        assert_eq!(found, expected, "{engine:?}, native\n{case}");
        whole += 1;
    }
    assert!(whole * 2 > count, "of {count} cases {whole} have an answer");
}

/// A campaign: `PROPTEST_CASES` new cases each time; without the variable, the same `count` cases.
fn soak(count: usize, check: impl Fn(usize, RngSeed)) {
    match std::env::var("PROPTEST_CASES") {
        Ok(count) => check(count.parse().unwrap(), RngSeed::Random),
        Err(_) => check(count, RngSeed::Fixed(21)),
    }
}

#[test]
fn parts_and_filters_fit_together_on_the_native_engine() {
    check_parts(Engine::Native, 24, RngSeed::Fixed(20));
}

#[test]
fn parts_and_filters_fit_together_on_duckdb() {
    check_parts(Engine::Duckdb, 15, RngSeed::Fixed(20));
}

#[test]
fn random_definitions_are_the_same_on_duckdb() {
    check_definitions(Engine::Duckdb, 60, RngSeed::Fixed(20));
}

#[test]
fn contradictory_answers_are_faults() {
    let names = ["all", "t", "f", "n"]
        .map(|part| ["count", "any", "first", "last", "min", "max", "sum"].map(|name| format!("{part}_{name}")));
    let mut names = names.concat();
    names.extend(["norec_p", "count_p", "holds"].map(str::to_owned));
    let row = |count: i64| {
        let mut row = vec![Some(1); 7];
        row[0] = Some(count);
        row.extend([Some(1); 7]);
        row.extend([None; 14]);
        row[14] = Some(0);
        row[21] = Some(0);
        row.extend([Some(1), Some(1), Some(1)]);
        row
    };
    let rows = |count| Rows { names: names.clone(), values: [("e".to_owned(), row(count))].into() };
    let none = || Rows { names: names.clone(), values: BTreeMap::new() };
    assert_eq!(faults(&[rows(1), rows(1), none(), none()]), Vec::<String>::new());
    assert_eq!(faults(&[rows(2), rows(2), none(), none()]).len(), 1);
    assert_eq!(faults(&[rows(1), none(), rows(1), none()]).len(), 2);
}

#[test]
#[ignore = "soak: 2000 cases"]
fn soak_parts_and_filters_fit_together_on_the_native_engine() {
    soak(2000, |count, seed| check_parts(Engine::Native, count, seed));
}

#[test]
#[ignore = "soak: 500 cases of parts and 1000 of definitions"]
fn soak_parts_and_definitions_on_duckdb() {
    soak(1000, |count, seed| {
        check_parts(Engine::Duckdb, count / 2, seed);
        check_definitions(Engine::Duckdb, count, seed);
    });
}

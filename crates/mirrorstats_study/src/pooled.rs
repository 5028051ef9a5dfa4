//! The check for cells that mix recordings: different worlds, prompts or agents.
//!
//! Rule: within a cell, the episodes of one experiment and model have one fingerprint. A mean over two fingerprints is
//! refused, and the error says what differs. Cells without fingerprints cannot be checked and are accepted.

use std::collections::BTreeMap;

use crate::StudyError;
use mirrorstats_analysis::comparable::{FINGERPRINT, Recorded, Varied, difference};
use mirrorstats_exact::escape::visible;
use mirrorstats_score::cells::group::{CONDITION, membership};
use mirrorstats_score::tables::table::EpisodeTable;

fn mixed(table: &EpisodeTable, groups: &[usize]) -> Vec<[usize; 2]> {
    let Some(fingerprints) = table.label(FINGERPRINT) else { return Vec::new() };
    let mut cells: BTreeMap<_, (usize, Option<usize>)> = BTreeMap::new();
    for (row, group) in groups.iter().enumerate() {
        let cell = (*group, table.keys.experiments().code(row), table.keys.models().code(row));
        let (first, other) = cells.entry(cell).or_insert((row, None));
        if fingerprints.get(*first) != fingerprints.get(row) {
            other.get_or_insert(row);
        }
    }
    let mut found: Vec<[usize; 2]> = cells.into_values().filter_map(|(first, other)| Some([first, other?])).collect();
    found.sort_unstable();
    found
}

/// Refuses cells, grouped by these columns, that mix fingerprints, or in which only some episodes have one.
pub(crate) fn check(table: &EpisodeTable, by: &[String]) -> Result<(), StudyError> {
    let groups = membership(table, by)?;
    match mixed(table, &groups).first() {
        Some(rows) => Err(pooled(table, by, &groups, *rows)),
        None => Ok(()),
    }
}

/// The mixtures in pooled cells, one sentence each; empty without any.
pub(crate) fn mixtures(table: &EpisodeTable, by: &[String]) -> Result<Vec<String>, StudyError> {
    let groups = membership(table, by)?;
    let words = |rows: &[usize; 2]| {
        let key = table.keys.get(rows[0]);
        let (experiment, model) = (visible(key.experiment), visible(key.model));
        format!("{experiment}, {model}: pooled with --pool: {}.", differences(table, *rows))
    };
    Ok(mixed(table, &groups).iter().map(words).collect())
}

fn differences(table: &EpisodeTable, rows: [usize; 2]) -> String {
    let [one, other] = rows.map(|row| Recorded::of(table, [row].into_iter()));
    if !one.is_declared() || !other.is_declared() {
        return "some have no fingerprint".to_owned();
    }
    match difference(&table.declared, [&one, &other], Varied::Nothing) {
        Some(setting) => format!("they differ in {setting}"),
        None => "the traces do not say in what they differ".to_owned(),
    }
}

fn pooled(table: &EpisodeTable, by: &[String], groups: &[usize], rows: [usize; 2]) -> StudyError {
    let [one, other] = rows.map(|row| table.keys.get(row));
    let fingerprint = |row: usize| table.label(FINGERPRINT).and_then(|column| column.get(row)).unwrap_or_default();
    let is_in_cell = |row: usize| {
        let key = table.keys.get(row);
        groups[row] == groups[rows[0]] && key.experiment == one.experiment && key.model == one.model
    };
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    (0..table.len()).filter(|row| is_in_cell(*row)).for_each(|row| *counts.entry(fingerprint(row)).or_default() += 1);
    let counts: Vec<String> = counts.iter().map(|(name, count)| format!("{count} of {}", name_of(name))).collect();
    let help = if by.iter().any(|name| name == CONDITION) {
        "record them under other conditions".to_owned()
    } else {
        "record them with --condition NAME, or group by condition where they have one".to_owned()
    };
    let kept = rows.map(fingerprint).into_iter().find(|name| !name.is_empty()).unwrap_or_default();
    StudyError::Pooled {
        cell: format!("{}, {}", visible(one.experiment), visible(one.model)),
        episodes: format!("`{}` and `{}`", visible(one.episode_id), visible(other.episode_id)),
        counts: counts.join(", "),
        differences: differences(table, rows),
        help: format!("{help}; --where \"fingerprint = '{kept}'\" keeps some of them, --pool takes all"),
    }
}

fn name_of(fingerprint: &str) -> String {
    if fingerprint.is_empty() { "none declared".to_owned() } else { format!("`{}`", visible(fingerprint)) }
}

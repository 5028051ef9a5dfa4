//! The check for cells that mix recordings: different worlds, prompts or agents.
//!
//! Rule: within a cell, the episodes of one experiment and model have one fingerprint. A mean over two fingerprints is
//! refused, and the error says what differs. Cells without fingerprints cannot be checked and are accepted.

use std::collections::BTreeMap;

use crate::{ErrorKind, StudyError};
use mirrorstats_analysis::comparable::{FINGERPRINT, ORIGIN, Recorded, Varied, difference};
use mirrorstats_exact::escape::visible;
use mirrorstats_score::cells::group::{GroupError, membership};
use mirrorstats_score::tables::table::{CONDITION, EpisodeTable, TextColumn};

fn mixed(table: &EpisodeTable, groups: &[usize]) -> Vec<[usize; 2]> {
    let settings: Vec<&TextColumn> = [FINGERPRINT, ORIGIN].into_iter().filter_map(|name| table.label(name)).collect();
    let mut cells: BTreeMap<_, (usize, Option<usize>)> = BTreeMap::new();
    for (row, group) in groups.iter().enumerate() {
        let cell = (*group, table.keys.experiment.code(row), table.keys.model.code(row));
        let (first, other) = cells.entry(cell).or_insert((row, None));
        if settings.iter().any(|setting| setting.get(*first) != setting.get(row)) {
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
        Some(rows) => Err(StudyError::new(ErrorKind::Input, pooled(table, by, &groups, *rows))),
        None => Ok(()),
    }
}

/// The mixtures in pooled cells, one sentence each; empty without any.
pub(crate) fn mixtures(table: &EpisodeTable, by: &[String]) -> Result<Vec<String>, GroupError> {
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
    match difference(&table.declared, [&one, &other], Varied::Nothing) {
        _ if one.is_declared() != other.is_declared() => "some have no fingerprint".to_owned(),
        Some(setting) => format!("they differ in {setting}"),
        None => "the traces do not say in what they differ".to_owned(),
    }
}

/// The refusal of a cell by two of its rows.
fn pooled(table: &EpisodeTable, by: &[String], groups: &[usize], rows: [usize; 2]) -> String {
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
    let help = if rows.iter().any(|row| fingerprint(*row).contains('/')) {
        "the files give one name to different recordings: leave some of the files out".to_owned()
    } else {
        help
    };
    let kept = rows.map(fingerprint).into_iter().find(|name| !name.is_empty()).unwrap_or_default();
    let (experiment, model) = (visible(one.experiment), visible(one.model));
    let (counts, differences) = (counts.join(", "), differences(table, rows));
    let (first, second) = (visible(one.episode_id), visible(other.episode_id));
    format!(
        "{experiment}, {model}: expected episodes that were recorded alike, found {counts}: {differences}; for example \
         `{first}` and `{second}`\n  help: {help}; --where \"fingerprint = '{kept}'\" keeps some of them, --pool takes all"
    )
}

fn name_of(fingerprint: &str) -> String {
    if fingerprint.is_empty() { "none declared".to_owned() } else { format!("`{}`", visible(fingerprint)) }
}

//! Whether a cell mixes episodes that were recorded differently: in another world, with other prompts, by another agent.
//!
//! Rule: within a cell, the episodes of one experiment and model have one fingerprint. A mean over two is refused, with
//! what differs. What traces do not declare cannot be compared, and is not refused.

use std::collections::BTreeMap;

use serde_json::Value;

use super::error::StudyError;
use exact::escape::visible;
use report::cells::group::{CONDITION, membership};
use score::table::EpisodeTable;
use trace::declared::Declared;
use trace::open::TraceSet;
use trace::schema::RECORDING_KEY;

/// The label of what an episode was recorded with.
const FINGERPRINT: &str = "fingerprint";
/// Digits of a hash in a message.
const SHOWN: usize = 8;

/// Refuses cells, grouped by these columns, that mix fingerprints. `traces` are those of the episodes, where they are at hand.
///
/// # Errors
/// [`StudyError::Pooled`] for the first such cell; columns that the episodes do not have.
pub(super) fn check(table: &EpisodeTable, by: &[String], traces: Option<&TraceSet>) -> Result<(), StudyError> {
    let Some(fingerprints) = table.label(FINGERPRINT) else { return Ok(()) };
    let groups = membership(table, by)?;
    let mut first: BTreeMap<(usize, Option<usize>, Option<usize>), usize> = BTreeMap::new();
    for (row, group) in groups.iter().enumerate().filter(|(row, _)| fingerprints.code(*row).is_some()) {
        let cell = (*group, table.keys.experiments().code(row), table.keys.models().code(row));
        let other = *first.entry(cell).or_insert(row);
        if fingerprints.get(other) != fingerprints.get(row) {
            return Err(pooled(table, by, &groups, [other, row], traces));
        }
    }
    Ok(())
}

/// What is the matter with the cell of two rows.
fn pooled(
    table: &EpisodeTable,
    by: &[String],
    groups: &[usize],
    rows: [usize; 2],
    traces: Option<&TraceSet>,
) -> StudyError {
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
    StudyError::Pooled {
        cell: format!("{}, {}", visible(one.experiment), visible(one.model)),
        episodes: format!("`{}` and `{}`", visible(one.episode_id), visible(other.episode_id)),
        counts: counts.join(", "),
        differences: differences(&table.declared, rows.map(fingerprint)) + &settings(traces, rows.map(fingerprint)),
        help: format!(
            "{help}; --where \"fingerprint = '{}'\" keeps some of them, --pool takes all",
            fingerprint(rows[0])
        ),
    }
}

fn name_of(fingerprint: &str) -> String {
    if fingerprint.is_empty() { "none declared".to_owned() } else { format!("`{}`", visible(fingerprint)) }
}

/// The parts in which two fingerprints differ, with what each has.
fn differences(declared: &Declared, names: [&str; 2]) -> String {
    let [Some(one), Some(other)] = names.map(|name| declared.fingerprints.get(name).and_then(Value::as_object)) else {
        return "the traces do not say in what".to_owned();
    };
    let keys = one.keys().chain(other.keys().filter(|key| !one.contains_key(*key)));
    let parts = keys.filter(|key| one.get(*key) != other.get(*key)).map(|key| {
        let [one, other] = [one, other].map(|parts| shown(parts.get(key)));
        format!("{} ({one}, {other})", visible(key))
    });
    let parts: Vec<String> = parts.collect();
    if parts.is_empty() {
        "the traces do not say in what".to_owned()
    } else {
        format!("they differ in {}", parts.join(", "))
    }
}

/// The first setting of the world, and of the agent, in which the recordings of two fingerprints differ, as their footers
/// have it.
fn settings(traces: Option<&TraceSet>, names: [&str; 2]) -> String {
    let recording = |name: &str| {
        let recordings = traces?.files().iter().filter_map(|file| file.metadata_value(RECORDING_KEY));
        let mut recordings = recordings.filter_map(|text| serde_json::from_str::<Value>(text).ok());
        recordings.find(|recording| !recording["fingerprints"][name].is_null())
    };
    let [Some(one), Some(other)] = names.map(recording) else { return String::new() };
    let found = ["world", "agent"].into_iter().filter_map(|key| first_difference(key, &one[key], &other[key]));
    found.fold(String::new(), |words, found| words + "; " + &found)
}

/// The innermost key in which two values differ, and what each has.
fn first_difference(name: &str, one: &Value, other: &Value) -> Option<String> {
    if one == other {
        return None;
    }
    if let (Value::Object(a), Value::Object(b)) = (one, other) {
        let keys = a.keys().chain(b.keys().filter(|key| !a.contains_key(*key)));
        let mut inner = keys.map(|key| (key, &one[key], &other[key])).filter(|(_, one, other)| one != other);
        if let Some((key, one, other)) = inner.next() {
            return first_difference(&format!("{name}.{}", visible(key)), one, other);
        }
    }
    let [one, other] = [one, other].map(|value| shown(Some(value)));
    Some(format!("{name} is {one} and {other}"))
}

/// The beginning of a hash, or a name.
fn shown(value: Option<&Value>) -> String {
    match value {
        None | Some(Value::Null) => "nothing".to_owned(),
        Some(Value::String(text)) if text.len() == 64 && text.bytes().all(|byte| byte.is_ascii_hexdigit()) => {
            text[..SHOWN].to_owned()
        }
        Some(Value::String(text)) => visible(text),
        Some(other) => visible(&other.to_string()),
    }
}

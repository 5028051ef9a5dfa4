//! Two episodes beside each other, and the first step where they part.

use serde_json::{Value, json};

use super::episode::{LONGEST, about};
use super::error::ViewError;
use super::filter::{Query, required};
use super::snapshot::Snapshot;
use crate::trace::episode::Episode;
use crate::trace::schema::{COLUMNS, Column};

/// Columns that differ between any two recordings, and say nothing of what was done.
const BY_CHANCE: [&str; 12] = [
    "frame_time",
    "latency_ms",
    "prompt_tokens",
    "completion_tokens",
    "cost_usd",
    "reply",
    "view_description",
    "reasoning",
    "summary",
    "identification",
    "reply_status",
    "reply_repair",
];

/// Both episodes, and where they differ first.
pub(super) fn answer(snapshot: &Snapshot, query: &Query) -> Result<Value, ViewError> {
    let (a, b) = (snapshot.episode(required(query, "a")?)?, snapshot.episode(required(query, "b")?)?);
    let parted = |is_wanted: fn(&Column) -> bool| -> Vec<(&'static str, Vec<usize>)> {
        let columns = COLUMNS.iter().filter(|column| is_wanted(column));
        columns.map(|column| (column.name, differing(column, &a.episode, &b.episode))).collect()
    };
    let constants = parted(|column| column.constant && column.name != "episode_hash");
    let of_steps = parted(|column| !column.constant && !BY_CHANCE.contains(&column.name));
    let steps = a.episode.steps.len().min(b.episode.steps.len());
    let differences: Vec<Value> = (1..=steps)
        .filter_map(|t| {
            let names: Vec<&str> =
                of_steps.iter().filter(|(_, at)| at.binary_search(&t).is_ok()).map(|(name, _)| *name).collect();
            (!names.is_empty()).then(|| json!({"t": t, "columns": names}))
        })
        .collect();
    let is_longer = a.episode.steps.len() != b.episode.steps.len();
    let behind = is_longer.then(|| json!({"t": steps + 1, "columns": ["length"]}));
    Ok(json!({
        "first": differences.first().cloned().or(behind),
        "differences": differences,
        "constants": constants.iter().filter(|(_, at)| !at.is_empty()).map(|(name, _)| *name).collect::<Vec<_>>(),
        "a": about(snapshot, &a, LONGEST)?,
        "b": about(snapshot, &b, LONGEST)?,
    }))
}

/// The steps at which a column differs, ascending, as far as both episodes go.
fn differing(column: &Column, a: &Episode, b: &Episode) -> Vec<usize> {
    let pairs = column.of_steps(a).zip(column.of_steps(b)).enumerate();
    pairs.filter(|(_, (a, b))| a != b).map(|(at, _)| at + 1).collect()
}

//! Two episodes beside each other, and the steps where they part.

use serde_json::{Value, json};

use super::episode::{LONGEST, about};
use super::error::ViewError;
use super::filter::{Query, number, required};
use super::snapshot::Snapshot;
use trace::schema::domain::is_identity;
use trace::schema::{COLUMNS, Column, Value as Cell};

/// Columns that differ between any two recordings, and say nothing of what was done.
const BY_CHANCE: [&str; 12] = [
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
    "reply_fault",
];

/// The column of a frame's position in a log, which is not part of the step.
const ADDRESS: &str = "frame_time";

/// Both episodes, and where they differ: at steps of both in `columns` of what was seen and done, and `also` in others.
pub(super) fn answer(snapshot: &Snapshot, query: &Query) -> Result<Value, ViewError> {
    let (a, b) = (snapshot.episode(required(query, "a")?)?, snapshot.episode(required(query, "b")?)?);
    let is_known = |column: &Column| a.own.is_none() && b.own.is_none() || is_identity(column.name);
    let parted = |is_wanted: fn(&Column) -> bool| -> Vec<(&str, Vec<usize>)> {
        let columns = COLUMNS.iter().filter(|column| is_wanted(column) && is_known(column));
        columns
            .map(|column| (column.name, differing(column.of_steps(&a.episode), column.of_steps(&b.episode))))
            .collect()
    };
    let constants = parted(|column| column.constant && column.name != "episode_hash");
    let mut of_steps = parted(|column| !column.constant && column.name != ADDRESS);
    for column in a.own.iter().flatten() {
        if let Some(other) = b.own.iter().flatten().find(|other| other.name == column.name) {
            of_steps.push((column.name.as_str(), differing(column.values(), other.values())));
        }
    }
    let (of_a, of_b) = (a.episode.steps.len(), b.episode.steps.len());
    let (side, both, last) = if of_a < of_b { ("a", of_a, of_b) } else { ("b", of_b, of_a) };
    let mut acts = Vec::new();
    let mut differences = Vec::new();
    for t in 1..=both {
        let here = of_steps.iter().filter(|(_, at)| at.binary_search(&t).is_ok()).map(|(name, _)| *name);
        let (also, columns): (Vec<&str>, Vec<&str>) = here.partition(|name| BY_CHANCE.contains(name));
        if !columns.is_empty() {
            acts.push(json!({"t": t, "columns": columns}));
        }
        if !columns.is_empty() || !also.is_empty() {
            differences.push(json!({"t": t, "columns": columns, "also": also}));
        }
    }
    let behind = (both < last).then(|| json!({"t": both + 1, "columns": ["length"]}));
    Ok(json!({
        "first": acts.first().cloned().or(behind),
        "differences": differences,
        "differing": acts.len() + last - both,
        "ended": (both < last).then(|| json!({"side": side, "t": both})),
        "constants": constants.iter().filter(|(_, at)| !at.is_empty()).map(|(name, _)| *name).collect::<Vec<_>>(),
        "a": about(snapshot, &a, LONGEST)?,
        "b": about(snapshot, &b, LONGEST)?,
    }))
}

/// Returns true if both have the same frame at a step; null where one has none.
pub(super) fn same_frame(snapshot: &Snapshot, query: &Query) -> Result<Value, ViewError> {
    let t = number(query, "t")?.unwrap_or(1);
    let frame = |side| snapshot.frame(&snapshot.episode(required(query, side)?)?, t);
    let (a, b) = (frame("a")?, frame("b")?);
    Ok(json!({"is_same": a.zip(b).map(|(a, b)| a == b)}))
}

fn differing<'e>(a: impl Iterator<Item = Option<Cell<'e>>>, b: impl Iterator<Item = Option<Cell<'e>>>) -> Vec<usize> {
    let pairs = a.zip(b).enumerate();
    pairs.filter(|(_, (a, b))| a != b).map(|(at, _)| at + 1).collect()
}

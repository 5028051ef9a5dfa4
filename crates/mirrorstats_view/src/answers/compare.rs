//! Two episodes side by side, and the steps where they differ.

use serde_json::{Value, json};

use super::episode::{LONGEST, about};
use super::{list, verdict};
use crate::filter::{Query, number, required, value};
use crate::{Snapshot, ViewError};
use mirrorstats_exact::escape::visible;
use mirrorstats_trace::episodes::episode::Episode;
use mirrorstats_trace::episodes::moments::{Moment, moments};
use mirrorstats_trace::schema::domain::is_identity;
use mirrorstats_trace::schema::{COLUMNS, Column, Value as Cell};

const MOST_OF_A_SCENE: usize = 60;

/// Columns that differ between any two recordings and do not describe behaviour.
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

/// The columns that locate a step and its frame; they are not compared.
const ADDRESSES: [&str; 2] = ["t", "frame_time"];

/// The moments by which two episodes can be aligned, as named in requests and on the page.
const MOMENTS: [(&str, Moment); 2] = [("sight", Moment::FirstSight), ("decision", Moment::Decision)];

/// The number of steps by which each episode is shifted to align a moment; `None` if either has no such moment.
fn leads(query: &Query, a: &Episode, b: &Episode) -> Option<(usize, usize)> {
    let wanted = value(query, "align")?;
    let (_, wanted) = MOMENTS.iter().find(|(name, _)| *name == wanted)?;
    let at = |episode| {
        let (t, _) = moments(episode).into_iter().find(|(_, moment)| moment == wanted)?;
        usize::try_from(t).ok()
    };
    let (of_a, of_b) = (at(a)?, at(b)?);
    Some((of_b.saturating_sub(of_a), of_a.saturating_sub(of_b)))
}

/// Both episodes and their differences: `columns` for what was seen and done, `also` for the rest. Each `t` is a shared
/// position: an episode's timestep plus its lead.
pub(crate) fn answer(snapshot: &Snapshot, query: &Query) -> Result<Value, ViewError> {
    let (a, b) = (snapshot.episode(required(query, "a")?)?, snapshot.episode(required(query, "b")?)?);
    let found = leads(query, &a.episode, &b.episode);
    let (lead_a, lead_b) = found.unwrap_or_default();
    let is_known = |column: &Column| a.own.is_none() && b.own.is_none() || is_identity(column.name);
    let parted = |is_wanted: fn(&Column) -> bool, of_a: usize, of_b: usize| -> Vec<(&str, Vec<usize>)> {
        let columns = COLUMNS.iter().filter(|column| is_wanted(column) && is_known(column));
        let of_both = |column: &Column| {
            let (a, b) = (column.of_steps(&a.episode).skip(of_a), column.of_steps(&b.episode).skip(of_b));
            differing(a.map(comparable), b.map(comparable))
        };
        columns.map(|column| (column.name, of_both(column))).collect()
    };
    let constants = parted(|column| column.constant && column.name != "episode_hash", 0, 0);
    // Starts where both episodes have begun.
    let mut of_steps = parted(|column| !column.constant && !ADDRESSES.contains(&column.name), lead_b, lead_a);
    for column in a.own.iter().flatten() {
        if let Some(other) = b.own.iter().flatten().find(|other| other.name == column.name) {
            let at = differing(column.values().skip(lead_b), other.values().skip(lead_a));
            of_steps.push((column.name.as_str(), at));
        }
    }
    let (of_a, of_b) = (a.episode.steps.len() + lead_a, b.episode.steps.len() + lead_b);
    let (side, both, last) = if of_a < of_b { ("a", of_a, of_b) } else { ("b", of_b, of_a) };
    let begin = lead_a.max(lead_b);
    let mut acts = Vec::new();
    let mut differences = Vec::new();
    for t in begin + 1..=both {
        let here = of_steps.iter().filter(|(_, at)| at.binary_search(&(t - begin)).is_ok()).map(|(name, _)| *name);
        let (also, columns): (Vec<&str>, Vec<&str>) = here.partition(|name| BY_CHANCE.contains(name));
        if !columns.is_empty() {
            acts.push(json!({"t": t, "columns": columns}));
        }
        if !columns.is_empty() || !also.is_empty() {
            differences.push(json!({"t": t, "columns": columns, "also": also}));
        }
    }
    let behind = (both < last).then(|| json!({"t": both.max(begin) + 1, "columns": ["length"]}));
    // If one episode ends before the other begins, every step belongs to a single episode.
    let alone = begin.min(last) + last - both.max(begin).min(last);
    Ok(json!({
        "aligned": found.and(value(query, "align")),
        "leads": {"a": lead_a, "b": lead_b},
        "first": acts.first().cloned().or(behind),
        "differences": differences,
        "differing": acts.len() + alone,
        "ended": (both < last).then(|| json!({"side": side, "t": both})),
        "constants": constants.iter().filter(|(_, at)| !at.is_empty()).map(|(name, _)| *name).collect::<Vec<_>>(),
        "a": about(snapshot, &a, LONGEST)?,
        "b": about(snapshot, &b, LONGEST)?,
    }))
}

/// The episodes of one scene, each with its outcome and its moments.
pub(crate) fn scene(snapshot: &Snapshot, query: &Query) -> Result<Value, ViewError> {
    let id = required(query, "id")?;
    let others = list::siblings(snapshot, id);
    let ids = std::iter::once(id).chain(others.iter().filter_map(|other| other["id"].as_str()));
    let mut episodes = Vec::new();
    for id in ids.take(MOST_OF_A_SCENE) {
        let opened = snapshot.episode(id)?;
        let episode = &opened.episode;
        let marks = moments(episode).into_iter().map(|(t, moment)| json!({"t": t, "title": moment.title()}));
        episodes.push(json!({
            "id": id,
            "name": visible(id),
            "model": visible(&episode.model),
            "condition": episode.condition.as_deref().map(visible),
            "length": episode.steps.len(),
            "verdict": verdict::answer(&opened),
            "marks": marks.collect::<Vec<_>>(),
            "frames": snapshot.logs.moment(&opened, 1)?.is_some_and(|moment| moment.frame.is_some()) || snapshot.renders(&opened),
        }));
    }
    episodes.sort_by_key(|episode| episode["name"].to_string());
    let has_scene = snapshot.episode(id)?.episode.scene.is_some();
    Ok(
        json!({"episodes": episodes, "has_scene": has_scene, "others": (others.len() + 1).saturating_sub(MOST_OF_A_SCENE)}),
    )
}

/// Returns true if both have the same frame at a step; null if either has no frame.
pub(crate) fn same_frame(snapshot: &Snapshot, query: &Query) -> Result<Value, ViewError> {
    let t = number(query, "t")?.unwrap_or(1);
    let of_b = number(query, "t_b")?.unwrap_or(t);
    let frame = |side, t| snapshot.frame(&snapshot.episode(required(query, side)?)?, t);
    let (a, b) = (frame("a", t)?, frame("b", of_b)?);
    Ok(json!({"is_same": a.zip(b).map(|(a, b)| a == b)}))
}

/// A value that equals itself: floats by their bits, as NaN differs from NaN.
fn comparable(value: Option<Cell<'_>>) -> Option<Result<u64, Cell<'_>>> {
    Some(match value? {
        Cell::Float(float) => Ok(float.to_bits()),
        other => Err(other),
    })
}

fn differing<T: PartialEq>(a: impl Iterator<Item = T>, b: impl Iterator<Item = T>) -> Vec<usize> {
    let pairs = a.zip(b).enumerate();
    pairs.filter(|(_, (a, b))| a != b).map(|(at, _)| at + 1).collect()
}

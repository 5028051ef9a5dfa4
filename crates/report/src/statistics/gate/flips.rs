//! The scenes in which the later value differs, with the episodes of both sides.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::matching::Scenes;
use super::super::study::{Block, Study};
use super::sides;
use score::table::MetricColumn;

/// Two episodes of one scene with different values.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct FlippedPair {
    /// The earlier episode.
    pub base: Played,
    /// The later one.
    pub new: Played,
}

/// An episode of one side.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Played {
    /// Its id.
    pub episode_id: String,
    /// Its value.
    pub value: i64,
    /// The timesteps that decided it, ascending; null where the side is scores.
    pub timesteps: Option<Vec<i64>>,
    /// The link to its frames in a page that `view --export` wrote next to the trace; null without one.
    pub frames: Option<String>,
}

/// The pairs of episodes whose values differ, matched by scene in order, or by id if no scenes are declared. Empty for
/// reconstructions.
pub(super) fn of(study: &Study, column: &MetricColumn, [base, new]: [&Block; 2]) -> Vec<FlippedPair> {
    let id = |row: usize| sides::id(study.table.keys.get(row).episode_id);
    let by_scene = |block: &Block| Scenes::of(study, block).rows;
    let (old, later) = (by_scene(base), by_scene(new));
    let pairs: Vec<(usize, usize)> = if !study.design.has_pairs() {
        Vec::new()
    } else if old.is_empty() || later.is_empty() {
        let old: BTreeMap<&str, usize> = base.rows().map(|row| (id(row), row)).collect();
        new.rows().filter_map(|row| Some((*old.get(id(row))?, row))).collect()
    } else {
        let both = later.iter().filter_map(|(scene, rows)| Some((old.get(scene)?, rows)));
        both.flat_map(|(old, new)| old.iter().copied().zip(new.iter().copied())).collect()
    };
    let played = |row: usize| {
        let value = column.get(row)?;
        Some(Played { episode_id: id(row).to_owned(), value, timesteps: None, frames: None })
    };
    let flipped = pairs.into_iter().filter_map(|(old, later)| {
        let (base, new) = (played(old)?, played(later)?);
        (base.value != new.value).then_some(FlippedPair { base, new })
    });
    let mut flips: Vec<FlippedPair> = flipped.collect();
    flips.sort_by(|a, b| a.new.episode_id.cmp(&b.new.episode_id));
    flips
}

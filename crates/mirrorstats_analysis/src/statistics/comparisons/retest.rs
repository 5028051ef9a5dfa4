//! The same scene played repeatedly by the same model: how often verdicts differ.
//!
//! Rule: the variation between repetitions of one scene is noise, and a difference has to exceed it. Every two
//! repetitions of a scene count once, and scenes have equal weight. One scene played by two people is no repetition.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::statistics::comparisons::matching::Scenes;
use crate::study::{Block, RowKey, Study};
use mirrorstats_exact::moments::Moments;
use mirrorstats_score::tables::table::MetricColumn;
use mirrorstats_statistics::intervals::clustered::variance_components;

/// The verdicts of one model on scenes that it played more than once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RetestRow {
    #[serde(flatten)]
    pub key: RowKey,
    /// The metric, a rate.
    pub metric: String,
    /// Scenes that were played at least twice with a defined value.
    pub scenes: u64,
    /// The episodes of these scenes.
    pub episodes: u64,
    /// The scenes whose verdicts are not all the same.
    pub unstable: u64,
    /// The chance that two times of a scene, both taken at random, give different verdicts: the mean over scenes of
    /// 2 k (m - k) / (m (m - 1)) for k successes in m times (Fleiss 1971, one minus the agreement of a subject).
    pub flipped: f64,
    /// The variance of the rate between scenes, by analysis of variance; `None` if it cannot be estimated.
    #[serde(default)]
    pub between_scenes: Option<f64>,
    /// The variance of the rate between repeats of a scene.
    #[serde(default)]
    pub within_scenes: Option<f64>,
}

impl RetestRow {
    pub(crate) fn all(study: &Study) -> Vec<Self> {
        if !study.design.has_pairs() {
            return Vec::new();
        }
        let of_block = |block| {
            let times = times(study, block);
            study.rates().filter_map(|column| Self::of(block, &times, column)).collect::<Vec<_>>()
        };
        study.blocks().flat_map(of_block).collect()
    }

    fn of(block: &Block, times: &Times, column: &MetricColumn) -> Option<Self> {
        let mut scenes = sums(times, |row| column.get(row).map(|value| i64::from(value == 1)));
        scenes.retain(|scene| scene.n > 1);
        let components = variance_components(&scenes);
        let (count, counts) = (scenes.len() as u64, || scenes.iter().filter_map(|scene| scene.counts()));
        let flipped: f64 = counts().map(|(k, m)| (2 * k * (m - k)) as f64 / (m * (m - 1)) as f64).sum();
        (count > 0).then(|| Self {
            key: block.key(),
            metric: column.name.clone(),
            scenes: count,
            episodes: scenes.iter().map(|scene| scene.n).sum(),
            unstable: counts().filter(|(k, m)| 0 < *k && k < m).count() as u64,
            flipped: flipped / count as f64,
            between_scenes: components.map(|(between, _)| between),
            within_scenes: components.map(|(_, within)| within),
        })
    }
}

/// The rows of each scene, separately for each person.
type Times = BTreeMap<(usize, Option<usize>), Vec<usize>>;

fn times(study: &Study, block: &Block) -> Times {
    let mut times = Times::new();
    for (scene, rows) in Scenes::of(study, block).rows {
        for row in rows {
            times.entry((scene, study.participant(row))).or_default().push(row);
        }
    }
    times
}

fn sums(times: &Times, value: impl Fn(usize) -> Option<i64>) -> Vec<Moments> {
    let add = |sum: Moments, value| sum.with(value).expect("a part of a block that was summed whole");
    let moments = |rows: &Vec<usize>| rows.iter().filter_map(|row| value(*row)).fold(Moments::default(), add);
    times.values().map(moments).collect()
}

pub(crate) fn repeat_variance(study: &Study, block: &Block, column: &MetricColumn) -> Option<f64> {
    if !block.repeats {
        return None;
    }
    let parts = sums(&times(study, block), |row| column.get(row));
    let n: u64 = parts.iter().map(|part| part.n).sum();
    Some(variance_components(&parts)?.1 / n as f64)
}

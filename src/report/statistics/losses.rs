//! Episodes that the infrastructure ended, and what they could have changed.

use std::collections::BTreeSet;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::study::{Block, Study};
use crate::stats::losses::{Fate, Lossy, bounds};

/// Losses, or that nothing is known of them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Losses {
    /// Whether the traces say how each reply came: without that, losses cannot be told from failures.
    pub recorded: bool,
    /// The rates of every experiment and model that lost an episode.
    pub rows: Vec<LossRow>,
}

/// One rate with lost episodes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LossRow {
    /// The experiment.
    pub experiment: String,
    /// The model.
    pub model: String,
    /// The condition, where there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub condition: Option<String>,
    /// The metric.
    pub metric: String,
    /// The rate without the lost episodes, and its bounds with them.
    #[serde(flatten)]
    pub lossy: Lossy,
}

impl Losses {
    /// The losses among the episodes, given the identifiers of the lost ones where that is known.
    pub(super) fn of(study: &Study, lost: Option<&BTreeSet<String>>, confidence: f64) -> Self {
        let Some(lost) = lost else { return Self::default() };
        let rows = study.blocks().flat_map(|block| of_block(study, block, lost, confidence)).collect();
        Self { recorded: true, rows }
    }
}

fn of_block(study: &Study, block: &Block, lost: &BTreeSet<String>, confidence: f64) -> Vec<LossRow> {
    let fate = |row: usize| if lost.contains(study.table.keys.get(row).episode_id) { Fate::Lost } else { Fate::Kept };
    let row = |metric: &str, lossy| LossRow {
        experiment: block.experiment.to_owned(),
        model: block.model.to_owned(),
        condition: block.condition(),
        metric: metric.to_owned(),
        lossy,
    };
    study
        .rates()
        .filter_map(|column| {
            let episodes = block.rows().map(|at| (column.get(at), fate(at)));
            bounds(episodes, confidence).map(|lossy| row(&column.name, lossy))
        })
        .filter(|row| row.lossy.lost > 0)
        .collect()
}

//! Episodes that the infrastructure ended, and what they could have changed.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::study::{Block, Study};
use score::lost_counts::LostCounts;
use statistics::losses::{Fate, Lossy, bounds};

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
    /// The losses beside the episodes, where they are known; the episodes given are those that were not lost.
    pub(super) fn of(study: &Study, lost: Option<&LostCounts>, confidence: f64) -> Self {
        let Some(lost) = lost else { return Self::default() };
        let rows = study.blocks().flat_map(|block| of_block(study, block, lost, confidence)).collect();
        Self { recorded: true, rows }
    }
}

fn of_block(study: &Study, block: &Block, lost: &LostCounts, confidence: f64) -> Vec<LossRow> {
    let lost = usize::try_from(lost.of(block.experiment, block.model, block.condition)).unwrap_or(usize::MAX);
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
            let kept = block.rows().map(|at| (column.get(at), Fate::Kept));
            bounds(kept.chain(std::iter::repeat_n((None, Fate::Lost), lost)), confidence)
                .map(|lossy| row(&column.name, lossy))
        })
        .filter(|row| row.lossy.lost > 0)
        .collect()
}

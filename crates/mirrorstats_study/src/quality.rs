//! Reply quality, and limits on it: which of them the traces exceed, and which cannot be checked.

use schemars::JsonSchema;
use serde::Serialize;

use crate::results::Results;
use crate::scan::{UNCHECKED, score_with_losses};
use crate::{Study, StudyError};
use mirrorstats_analysis::statistics::DesignAudit;
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_score::quality::{CellKey, Quality, QualityByCell, QualityReader};
use mirrorstats_score::score_traces::Outputs;
use mirrorstats_score::tables::table::CONDITION;
use mirrorstats_score::vocabulary;
use mirrorstats_trace::beside::lost;

/// The largest allowed values; absent ones are not checked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QualityLimits {
    /// The share of a cell's replies that have no decision.
    pub max_unreadable: Option<f64>,
    /// Lost episodes, over all cells.
    pub max_lost: Option<u64>,
}

/// The result of the check.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct QualityCheckAnswer {
    /// True if every limit could be checked, none is exceeded, and the audit found nothing.
    pub holds: bool,
    /// The limits that are exceeded.
    pub violations: Vec<Violation>,
    /// The limits that could not be checked.
    pub not_recorded: Vec<NotRecorded>,
    /// Every cell.
    pub cells: Vec<CellAnswer>,
    /// The design audit; absent unless asked for. A finding fails the check.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub design: Option<DesignAudit>,
}

/// A limit that is exceeded.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Violation {
    /// The cell; null for a limit over all cells.
    pub cell: Option<CellKey>,
    /// The option, without its dashes.
    pub limit: &'static str,
    /// The largest that was allowed.
    pub expected: f64,
    /// The value in the traces.
    pub found: f64,
}

/// A limit on a quantity that the traces do not record for every step of a cell.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NotRecorded {
    /// The cell.
    pub cell: CellKey,
    /// The option, without its dashes.
    pub limit: &'static str,
    /// The steps of the cell without it.
    pub missing: u64,
    /// All steps of the cell.
    pub steps: u64,
}

/// The replies of one cell.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct CellAnswer {
    /// Whose they are.
    #[serde(flatten)]
    pub key: CellKey,
    /// Their reply quality.
    #[serde(flatten)]
    pub quality: Quality,
    /// Milliseconds within which half of the replies came.
    pub latency_median_ms: Option<i64>,
    /// Milliseconds within which 95 % of the replies came.
    pub latency_95_ms: Option<i64>,
}

impl CellAnswer {
    pub fn of_all(cells: &QualityByCell) -> Vec<Self> {
        let answer = |(key, quality): (&CellKey, &Quality)| Self {
            key: key.clone(),
            quality: quality.clone(),
            latency_median_ms: quality.latency(0.5),
            latency_95_ms: quality.latency(0.95),
        };
        cells.0.iter().map(answer).collect()
    }
}

impl QualityCheckAnswer {
    pub fn of(cells: &QualityByCell, limits: QualityLimits, design: Option<DesignAudit>) -> Self {
        let (violations, not_recorded) = (limits.violations(cells), limits.not_recorded(cells));
        let is_sound = design.as_ref().is_none_or(|design| design.findings.is_empty());
        let holds = violations.is_empty() && not_recorded.is_empty() && is_sound;
        Self { holds, violations, not_recorded, cells: CellAnswer::of_all(cells), design }
    }
}

/// Returns true if the traces record replies, or episodes were lost. Errors: scores, which have no replies; a list
/// of lost episodes that cannot be read.
pub fn has_quality(study: &Study) -> Result<bool, StudyError> {
    let reader = QualityReader::of(study.traces()?);
    Ok(!reader.columns().is_empty() || !lost::beside(&study.inputs)?.is_empty())
}

/// The reply quality of all episodes, lost ones included. Errors: scores, which have no replies; faults of the
/// traces or of the list of lost episodes.
pub fn quality(study: &Study) -> Result<QualityByCell, StudyError> {
    let traces = study.traces()?;
    let reader = QualityReader::of(traces);
    let all = Definitions::without_metrics(&vocabulary::trace_columns(traces))?;
    let labels: Vec<String> = traces.declares(CONDITION).then(|| CONDITION.to_owned()).into_iter().collect();
    let (quality, unchecked) = (Some(&reader), &UNCHECKED[..]);
    let wanted = Outputs { labels: &labels, quality, unchecked, ..Outputs::default() };
    let (scored, lost) = score_with_losses(traces, &[&all], wanted, study.threads)?;
    let [episodes] = <[_; 1]>::try_from(scored.tables).expect("a table per definitions");
    let mut results = Results { lost, quality: scored.quality, ..Results::of(episodes) };
    study.declare(&mut results)?;
    study.check_unchanged()?;
    Ok(results.quality.unwrap_or_default())
}

impl QualityLimits {
    fn violations(self, cells: &QualityByCell) -> Vec<Violation> {
        let unreadable = cells.0.iter().filter_map(|(key, quality)| {
            let share = (quality.replies() > 0).then(|| real(quality.unusable()) / real(quality.replies()));
            exceeded(Some(key), "max-unreadable", self.max_unreadable?, share?)
        });
        let lost = cells.whole().lost.zip(self.max_lost);
        let lost = lost.and_then(|(lost, most)| exceeded(None, "max-lost", real(most), real(lost)));
        unreadable.chain(lost).collect()
    }

    fn not_recorded(self, cells: &QualityByCell) -> Vec<NotRecorded> {
        let of_cell = |(cell, quality): (&CellKey, &Quality)| {
            let steps = quality.steps;
            let replies = steps.saturating_sub(quality.replies());
            let lost = if quality.lost.is_none() { steps } else { replies };
            [self.max_unreadable.map(|_| ("max-unreadable", replies)), self.max_lost.map(|_| ("max-lost", lost))]
                .into_iter()
                .flatten()
                .filter(|(_, missing)| *missing > 0)
                .map(|(limit, missing)| NotRecorded { cell: cell.clone(), limit, missing, steps })
                .collect::<Vec<_>>()
        };
        cells.0.iter().flat_map(of_cell).collect()
    }
}

#[expect(clippy::cast_precision_loss, reason = "counts of replies are far below 2^53")]
fn real(count: u64) -> f64 {
    count as f64
}

fn exceeded(cell: Option<&CellKey>, limit: &'static str, expected: f64, found: f64) -> Option<Violation> {
    (found > expected).then(|| Violation { cell: cell.cloned(), limit, expected, found })
}

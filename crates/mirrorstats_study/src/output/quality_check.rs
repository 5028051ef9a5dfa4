//! Limits on reply quality: which of them the traces exceed, and which cannot be checked.

use schemars::JsonSchema;
use serde::Serialize;

use crate::{Study, StudyError};
use mirrorstats_score::quality::{CellKey, Quality, QualityByCell};
use mirrorstats_statistics::losses::INFRASTRUCTURE;

/// The largest allowed values; absent ones are not checked. Shares are of the replies of one cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct QualityLimits {
    /// Replies without a decision.
    pub max_unreadable: Option<f64>,
    pub max_refused: Option<f64>,
    pub max_truncated: Option<f64>,
    pub max_repaired: Option<f64>,
    /// Lost episodes, over all cells.
    pub max_lost: Option<u64>,
    /// Milliseconds within which 95 % of a cell's replies arrived.
    pub max_latency: Option<i64>,
}

/// The result of the check.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct QualityCheckAnswer {
    /// True if every limit could be checked and none is exceeded.
    pub holds: bool,
    /// The limits that are exceeded.
    pub violations: Vec<Violation>,
    /// The limits that could not be checked.
    pub not_recorded: Vec<NotRecorded>,
    /// Every cell.
    pub cells: Vec<CellAnswer>,
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

/// An option, the largest value that it allows, and the value in the traces.
type Compared = (&'static str, Option<f64>, Option<f64>);

impl Study {
    /// Checks the replies of the traces against limits; also returns the reply quality.
    pub fn check_quality(&self, limits: &QualityLimits) -> Result<(QualityCheckAnswer, QualityByCell), StudyError> {
        let cells = self.quality()?;
        let (violations, not_recorded) = (limits.violations(&cells), limits.not_recorded(&cells));
        let holds = violations.is_empty() && not_recorded.is_empty();
        Ok((QualityCheckAnswer { holds, violations, not_recorded, cells: CellAnswer::of_all(&cells) }, cells))
    }
}

impl QualityLimits {
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    fn violations(&self, cells: &QualityByCell) -> Vec<Violation> {
        let of_cell = |(key, quality)| self.compared(quality).map(|compared| exceeded(Some(key), compared));
        let lost = ("max-lost", self.max_lost.map(real), cells.whole().lost.map(real));
        cells.0.iter().flat_map(of_cell).chain([exceeded(None, lost)]).flatten().collect()
    }

    fn compared(&self, quality: &Quality) -> [Compared; 5] {
        let share = |count: u64| (quality.replies() > 0).then(|| real(count) / real(quality.replies()));
        #[expect(clippy::cast_precision_loss, reason = "milliseconds are far below 2^53")]
        let ms = |ms: i64| ms as f64;
        [
            ("max-unreadable", self.max_unreadable, share(quality.unusable())),
            ("max-refused", self.max_refused, share(quality.of_status("refusal"))),
            ("max-truncated", self.max_truncated, share(quality.of_status("truncated"))),
            ("max-repaired", self.max_repaired, share(quality.of_status("repaired"))),
            ("max-latency", self.max_latency.map(ms), quality.latency(0.95).map(ms)),
        ]
    }

    fn not_recorded(&self, cells: &QualityByCell) -> Vec<NotRecorded> {
        let of_cell = |(cell, quality): (&CellKey, &Quality)| {
            let missing = self.missing(quality).into_iter().filter(|(_, is_asked, missing)| *is_asked && *missing > 0);
            let (cell, steps) = (cell.clone(), quality.steps);
            missing.map(move |(limit, _, missing)| NotRecorded { cell: cell.clone(), limit, missing, steps })
        };
        cells.0.iter().flat_map(of_cell).collect::<Vec<_>>()
    }

    fn missing(&self, quality: &Quality) -> [(&'static str, bool, u64); 6] {
        let replies = quality.steps.saturating_sub(quality.replies());
        // Replies lost to the infrastructure never arrived, so they have no latency.
        let ended: u64 = INFRASTRUCTURE.iter().map(|status| quality.of_status(status)).sum();
        let timed = quality.latencies.values().sum::<u64>() + ended;
        [
            ("max-unreadable", self.max_unreadable.is_some(), replies),
            ("max-refused", self.max_refused.is_some(), replies),
            ("max-truncated", self.max_truncated.is_some(), replies),
            ("max-repaired", self.max_repaired.is_some(), replies),
            ("max-latency", self.max_latency.is_some(), quality.steps.saturating_sub(timed)),
            ("max-lost", self.max_lost.is_some(), if quality.lost.is_none() { quality.steps } else { replies }),
        ]
    }
}

#[expect(clippy::cast_precision_loss, reason = "counts of replies are far below 2^53")]
fn real(count: u64) -> f64 {
    count as f64
}

fn exceeded(cell: Option<&CellKey>, (limit, expected, found): Compared) -> Option<Violation> {
    let (expected, found) = expected.zip(found)?;
    (found > expected).then(|| Violation { cell: cell.cloned(), limit, expected, found })
}

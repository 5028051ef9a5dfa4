//! Episodes that the infrastructure ended, and their possible effect.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::statistics::comparisons::matching::Units;
use crate::study::{Block, RowKey, Study};
use mirrorstats_exact::moments::Moments;
use mirrorstats_score::tables::table::MetricColumn;
use mirrorstats_statistics::comparisons::holm::{holm, is_significant};
use mirrorstats_statistics::comparisons::paired::Pairs;
use mirrorstats_statistics::losses::{Lossy, bounds};

pub(crate) const LOST: &str = "lost episodes";

/// Losses, or that nothing is known of them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Losses {
    /// True if the traces record how each reply ended; otherwise losses look like failures.
    pub recorded: bool,
    /// The rates of every experiment and model that lost an episode.
    pub rows: Vec<LossRow>,
}

/// One rate with lost episodes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LossRow {
    #[serde(flatten)]
    pub key: RowKey,
    /// The metric.
    pub metric: String,
    /// The rate without the lost episodes, and its bounds with them.
    #[serde(flatten)]
    pub lossy: Lossy,
}

impl Losses {
    pub(crate) fn of(study: &Study, recorded: bool) -> Self {
        let of_rate = |block: &Block, column: &MetricColumn| {
            let lossy = bounds(block.rows().filter_map(|row| column.get(row)), block.lost, study.confidence)?;
            Some(LossRow { key: block.key(), metric: column.name.clone(), lossy })
        };
        let lossy = study.blocks().filter(|block| block.lost > 0);
        let rows = lossy.flat_map(|block| study.rates().filter_map(move |column| of_rate(block, column)));
        Self { recorded, rows: rows.collect() }
    }
}

/// A test with its lost episodes taken both ways; the verdict stands if it is the same in both, after Holm's adjustment.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LossCases {
    /// The episodes lost, of both sides.
    pub lost: u64,
    /// Every lost episode lowers the difference as far as it can: all of the first fail, all of the second succeed.
    pub lowest: LossCase,
    /// Every lost episode raises it as far as it can.
    pub highest: LossCase,
    /// True if the verdict is the same in both cases and without the lost episodes; otherwise the data give no verdict.
    pub agree: bool,
}

/// A difference and its p value, not adjusted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LossCase {
    /// The first minus the second; of a rate against a level, the rate minus the level.
    pub difference: Option<f64>,
    /// The p value.
    pub p: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Toward {
    Lowest,
    Highest,
}

impl Toward {
    /// The moments of a rate including the lost episodes of its side, the first or the second of a difference.
    pub fn moments(self, known: Moments, lost: u64, is_first: bool) -> Moments {
        let lost = usize::try_from(lost).unwrap_or(usize::MAX);
        let (zeros, ones) = if (self == Self::Highest) == is_first { (0, lost) } else { (lost, 0) };
        known.with_truths(zeros, ones).unwrap_or(known)
    }

    /// The moments of one side's rate without its lost episodes, or with them.
    pub fn assumed(lost: Option<Self>, block: &Block, column: &MetricColumn, is_first: bool) -> Moments {
        let known = block.moments(column);
        lost.map_or(known, |toward| toward.moments(known, block.lost, is_first))
    }

    pub fn pairs(self, known: Pairs, lost: u64) -> Pairs {
        match self {
            Self::Lowest => Pairs { second_only: known.second_only + lost, ..known },
            Self::Highest => Pairs { first_only: known.first_only + lost, ..known },
        }
    }

    /// The smallest and the largest possible time, as those of the first and of the second side.
    pub fn ends<T>(self, [fast, slow]: [T; 2]) -> [T; 2] {
        if self == Self::Highest { [slow, fast] } else { [fast, slow] }
    }

    /// Each lost episode of either side as a shared unit, against the outcome that gives it its largest effect.
    pub fn units(self, lost: u64) -> Vec<(Moments, Moments)> {
        let one = |is_first| self.moments(Moments::default(), 1, is_first);
        (0..lost).map(|_| (one(true), one(false))).collect()
    }
}

impl LossCases {
    pub(crate) fn of(lost: u64, case: impl Fn(Toward) -> LossCase) -> Option<Self> {
        let both = || Self { lost, lowest: case(Toward::Lowest), highest: case(Toward::Highest), agree: true };
        (lost > 0).then(both)
    }

    pub(crate) fn turned(self) -> Self {
        let turned = |case: LossCase| LossCase { difference: case.difference.map(|it| -it), ..case };
        Self { lowest: turned(self.highest), highest: turned(self.lowest), ..self }
    }

    pub(crate) fn unsettled(cases: Option<&Self>) -> Option<Units> {
        let units = |cases: &Self| Units { n: cases.lost, name: LOST.to_owned(), too_few: true };
        cases.filter(|cases| !cases.agree).map(units)
    }
}

/// The p value of each test of a family, adjusted by Holm's method, and whether it shows a difference, with the lost
/// episodes too.
pub(crate) fn settle<'c>(
    family: impl Iterator<Item = (LossCase, &'c mut Option<LossCases>)>,
    confidence: f64,
) -> Vec<(f64, bool)> {
    let tests: Vec<_> = family.collect();
    let verdicts = |case: fn(LossCase, LossCases) -> LossCase| -> Vec<(f64, Option<bool>)> {
        let of = |(seen, cases): &(LossCase, &mut Option<LossCases>)| cases.map_or(*seen, |cases| case(*seen, cases));
        let cases: Vec<LossCase> = tests.iter().map(of).collect();
        let adjusted = holm(&cases.iter().map(|case| case.p.unwrap_or(1.0)).collect::<Vec<_>>());
        let sign = |case: &LossCase| case.difference.is_some_and(|it| it > 0.0);
        cases.iter().zip(adjusted).map(|(case, p)| (p, is_significant(p, confidence).then(|| sign(case)))).collect()
    };
    let (without, lowest) = (verdicts(|seen, _| seen), verdicts(|_, cases| cases.lowest));
    let highest = verdicts(|_, cases| cases.highest);
    let settled = |(at, (_, cases)): (usize, (LossCase, &mut Option<LossCases>))| {
        let (p, sign) = without[at];
        if let Some(cases) = cases {
            cases.agree = lowest[at].1 == sign && highest[at].1 == sign;
        }
        (p, sign.is_some() && cases.is_none_or(|cases| cases.agree))
    };
    tests.into_iter().enumerate().map(settled).collect()
}

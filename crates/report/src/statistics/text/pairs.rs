//! Every test of two models as text, for a page that shows two models of the reader's choice.
//!
//! Rule: texts that depend on the order of the two models are stored for both orders, so that nothing is recomputed.

use super::super::{Comparison, OverallRow, PairTest, Statistics};
use super::tables::{held, method, overall_method};
use exact::format::{UNDEFINED, fixed, p_value};
use statistics::coverage::Withheld;
use statistics::interval::Interval;

/// Decimals of a difference of rates.
const RATE_PLACES: usize = 3;

/// The result of a test, in the order of a page's columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The first is better, after adjustment.
    FirstIsBetter,
    /// The test does not separate the two.
    NotToldApart,
    /// There is no test.
    NoTest,
}

/// One model against another, as texts; an array has the text from the first and from the second model's view.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct PairText<'a> {
    /// The model with the better mean.
    pub first: &'a str,
    pub second: &'a str,
    /// The name of the test.
    pub test: &'static str,
    /// The counts of each side: `11/21`, or `n = 21` for a duration.
    pub counts: [String; 2],
    /// The discordant pairs, `2 : 6 of 21`: in favour of this side, in favour of the other, of all pairs.
    pub differing: [String; 2],
    /// One side minus the other.
    pub difference: [String; 2],
    /// Its interval, or why it has none.
    pub interval: [String; 2],
    pub p: String,
    /// The p value, adjusted by Holm's method.
    pub p_adjusted: String,
    pub verdict: Verdict,
}

/// All tests under one metric in one experiment; over all experiments if `experiment` is `None`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct FamilyText<'a> {
    pub experiment: Option<&'a str>,
    pub metric: &'a str,
    /// All pairs of models.
    pub tests: Vec<PairText<'a>>,
}

/// All families: by experiment, then those over all experiments.
pub(crate) fn families(statistics: &Statistics) -> Vec<FamilyText<'_>> {
    let single = statistics.models.iter().map(|family| FamilyText {
        experiment: Some(&family.experiment),
        metric: &family.metric,
        tests: family.tests.iter().map(PairText::of).collect(),
    });
    let mut families: Vec<FamilyText<'_>> = single.collect();
    for rows in statistics.overall.chunk_by(|a, b| a.metric == b.metric) {
        let tests = rows.iter().map(PairText::overall).collect();
        families.push(FamilyText { experiment: None, metric: &rows[0].metric, tests });
    }
    families
}

impl<'a> PairText<'a> {
    fn of(PairTest { first, second, comparison, .. }: &'a PairTest) -> Self {
        let (test, places) = method(comparison.method);
        Self {
            test,
            counts: counts(comparison),
            differing: differing(comparison),
            difference: difference(comparison.difference, places),
            interval: interval(comparison.interval, comparison.withheld, places),
            p: p_value(comparison.p),
            p_adjusted: p_value(comparison.p_adjusted),
            verdict: Verdict::of(comparison.separated, comparison.p),
            first,
            second,
        }
    }

    fn overall(row: &'a OverallRow) -> Self {
        let OverallRow { first, second, .. } = row;
        Self {
            test: overall_method(row.method),
            counts: [UNDEFINED, UNDEFINED].map(str::to_owned),
            differing: [UNDEFINED, UNDEFINED].map(str::to_owned),
            difference: difference(row.difference, RATE_PLACES),
            interval: interval(row.interval, None, RATE_PLACES),
            p: p_value(row.p),
            p_adjusted: p_value(row.p_adjusted),
            verdict: Verdict::of(row.separated, row.p),
            first,
            second,
        }
    }
}

impl Verdict {
    fn of(separated: bool, p: Option<f64>) -> Self {
        match p {
            None => Self::NoTest,
            Some(_) if separated => Self::FirstIsBetter,
            Some(_) => Self::NotToldApart,
        }
    }
}

fn counts(found: &Comparison) -> [String; 2] {
    let [m, n] = found.n;
    match found.successes {
        Some([k, l]) => [format!("{k}/{m}"), format!("{l}/{n}")],
        None => [format!("n = {m}"), format!("n = {n}")],
    }
}

fn differing(found: &Comparison) -> [String; 2] {
    let Some(pairs) = found.pairs else { return [UNDEFINED, UNDEFINED].map(str::to_owned) };
    let (first, second, all) = (pairs.first_only, pairs.second_only, pairs.n());
    [format!("{first} : {second} of {all}"), format!("{second} : {first} of {all}")]
}

fn difference(difference: Option<f64>, places: usize) -> [String; 2] {
    [difference, difference.map(|difference| -difference)].map(|difference| fixed(difference, places))
}

fn interval(interval: Option<Interval>, withheld: Option<Withheld>, places: usize) -> [String; 2] {
    [interval, interval.map(Interval::negated)].map(|interval| held(interval, withheld, places))
}

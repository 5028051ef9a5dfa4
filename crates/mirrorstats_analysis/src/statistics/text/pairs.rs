//! Every test of two models as text, for a page that shows two models of the reader's choice.
//!
//! Rule: texts that depend on the order of the two models are stored for both orders, so that nothing is recomputed.

use super::super::{Comparison, Statistics};
use super::tables::{RATE_PLACES, beside, held, method, overall_method};
use mirrorstats_exact::format::{UNDEFINED, fixed, p_value};
use mirrorstats_statistics::intervals::interval::Interval;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PairText<'a> {
    /// The model with the better mean.
    pub first: &'a str,
    pub second: &'a str,
    pub test: &'static str,
    /// Each text from the first and from the second model's view: the counts of a side, `11/21`, or `n = 21` for a
    /// duration; the discordant pairs in favour of this side, of the other, and all, `2 : 6 of 21`; one side minus the
    /// other; its interval, or why it has none.
    pub sides: [[String; 2]; 4],
    /// The p value, and the same adjusted by Holm's method.
    pub p: [String; 2],
    /// 0 if the first is better after adjustment, 1 if the test does not separate the two, 2 without a test.
    pub verdict: u8,
}

/// All tests under one metric in one experiment; over all experiments if `experiment` is `None`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FamilyText<'a> {
    pub experiment: Option<&'a str>,
    pub metric: &'a str,
    pub tests: Vec<PairText<'a>>,
}

/// All families: by experiment, then those over all experiments.
pub fn families(statistics: &Statistics) -> Vec<FamilyText<'_>> {
    let single = statistics.models.iter().map(|family| {
        let tests = family.tests.iter().map(|it| {
            let counts = counts(&it.comparison);
            PairText::of([&it.first, &it.second], method(it.comparison.method), counts, &it.comparison)
        });
        FamilyText { experiment: Some(&family.experiment), metric: &family.metric, tests: tests.collect() }
    });
    let overall = statistics.overall.chunk_by(|a, b| a.metric == b.metric).map(|rows| {
        let tests = rows.iter().map(|row| {
            let (difference, interval, separated) = (row.difference, row.interval, row.separated);
            let (p, p_adjusted) = (row.p, row.p_adjusted);
            let found = Comparison { difference, interval, p, p_adjusted, separated, ..Comparison::default() };
            PairText::of([&row.first, &row.second], (overall_method(row.method), RATE_PLACES), undefined(), &found)
        });
        FamilyText { experiment: None, metric: &rows[0].metric, tests: tests.collect() }
    });
    single.chain(overall).collect()
}

impl<'a> PairText<'a> {
    fn of(
        [first, second]: [&'a str; 2],
        (test, places): (&'static str, usize),
        counts: [String; 2],
        found: &Comparison,
    ) -> Self {
        let difference = [found.difference, found.difference.map(|it| -it)].map(|it| fixed(it, places));
        let interval = [found.interval, found.interval.map(Interval::negated)];
        let interval = interval.map(|it| held(it, found.withheld, places));
        let verdict = match found.p {
            None => 2,
            Some(_) => u8::from(!found.separated),
        };
        let p = [found.p, found.p_adjusted].map(p_value);
        Self { first, second, test, sides: [counts, differing(found), difference, interval], p, verdict }
    }
}

fn undefined() -> [String; 2] {
    [UNDEFINED, UNDEFINED].map(str::to_owned)
}

fn counts(found: &Comparison) -> [String; 2] {
    let [m, n] = found.n;
    let [first, second] = match found.successes {
        Some([k, l]) => [format!("{k}/{m}"), format!("{l}/{n}")],
        None => [format!("n = {m}"), format!("n = {n}")],
    };
    let [a, b] = found.unit_means.map_or([None; 2], |means| means.map(Some));
    let places = method(found.method).1;
    [beside(&first, a, places), beside(&second, b, places)]
}

fn differing(found: &Comparison) -> [String; 2] {
    let Some(pairs) = found.pairs else { return undefined() };
    let (first, second, all) = (pairs.first_only, pairs.second_only, pairs.n());
    [format!("{first} : {second} of {all}"), format!("{second} : {first} of {all}")]
}

use std::collections::BTreeMap;

use super::{Print, Sample, Search};
use exact::moments::Moments;
use exact::moments::StandardError::{self, Population, Sample as OfSample};
use exact::rounding::Rounding;

const STEPS: (i64, i64) = (1, 100);
const RATE: (i64, i64) = (0, 1);

fn print(mean: &str, se: &str, rounding: Rounding) -> Print {
    Print { mean: mean.parse().unwrap(), se: (!se.is_empty()).then(|| se.parse().unwrap()), rounding }
}

impl Sample {
    /// Moments of values that print as all of these; `None` if no values do.
    fn witness(&self, prints: &[Print], search: &mut Search) -> Option<Moments> {
        let (low, high) = self.sums(prints);
        (low..=high).find_map(|sum| self.with_sum(sum, prints, search))
    }
}

fn witness(n: u64, range: (i64, i64), form: StandardError, print: Print) -> Option<Moments> {
    Sample { n, range, form }.witness(&[print], &mut Search::default())
}

/// The print of moments, as `mean ± se` with two digits.
fn printed(moments: &Moments, form: StandardError, rounding: Rounding) -> Option<(String, String)> {
    let mean = rounding.ratio(moments.sum, moments.n.into(), 2)?;
    let (above, below) = moments.se_squared(form)?;
    Some((mean.to_string(), rounding.root(above, below, 2)?.to_string()))
}

// Findings about the published tables: 19/21 with ddof = 1, 5/21 with ddof = 0, 1216/21 rounded twice.
#[test]
fn the_rules_of_the_paper_are_told_apart() {
    let rate = |mean, se, form, rounding| witness(21, RATE, form, print(mean, se, rounding)).map(|found| found.sum);
    assert_eq!(rate("0.91", "0.07", OfSample, Rounding::Twice), Some(19));
    assert_eq!(rate("0.91", "0.07", OfSample, Rounding::Binary), None);
    assert_eq!(rate("0.90", "0.07", OfSample, Rounding::Binary), Some(19));
    assert_eq!(rate("0.24", "0.09", Population, Rounding::Binary), Some(5));
    assert_eq!(rate("0.24", "0.09", OfSample, Rounding::Binary), None);
    let duration = |mean, rounding| witness(21, STEPS, OfSample, print(mean, "", rounding)).map(|found| found.sum);
    assert_eq!(duration("57.90", Rounding::HalfEven), Some(1216));
    assert_eq!(duration("57.90", Rounding::Twice), None);
    assert_eq!(duration("57.91", Rounding::Twice), Some(1216));
}

#[test]
fn one_value_prints_no_standard_error_or_zero() {
    for (se, is_feasible) in [("", true), ("0.00", true), ("0.01", false)] {
        let found = witness(1, STEPS, OfSample, print("7.00", se, Rounding::HalfEven));
        assert_eq!(found.is_some(), is_feasible, "{se}");
    }
    assert_eq!(witness(1, STEPS, OfSample, print("7.50", "", Rounding::HalfEven)), None);
}

#[test]
fn means_out_of_range_have_no_sum() {
    let sample = Sample { n: 21, range: STEPS, form: OfSample };
    let beyond = print("100.05", "0.00", Rounding::HalfUp);
    assert_eq!(sample.witness(&[beyond], &mut Search::default()), None);
    assert_eq!(sample.sums_beside(&beyond), [Some(2100), None]);
    assert_eq!(sample.sums_beside(&print("0.50", "", Rounding::HalfUp)), [None, Some(21)]);
    assert_eq!(sample.sums_beside(&print("57.93", "", Rounding::HalfUp)), [Some(1216), Some(1217)]);
}

/// Every multiset of 4 integers from 0 to 6, printed by every rule: a witness exists exactly for these prints.
#[test]
fn small_samples_agree_with_enumeration() {
    let moments = |values: [i64; 4]| values.into_iter().fold(Moments::default(), |m, v| m.with(v).unwrap());
    let multisets =
        (0..7).flat_map(|a| (a..7).flat_map(move |b| (b..7).flat_map(move |c| (c..7).map(move |d| [a, b, c, d]))));
    let all: Vec<Moments> = multisets.map(moments).collect();
    for (rounding, form) in Rounding::ALL.into_iter().flat_map(|rule| [(rule, OfSample), (rule, Population)]) {
        let mut known: BTreeMap<(i64, i64), bool> = BTreeMap::new();
        for found in &all {
            let (mean, se) = printed(found, form, rounding).unwrap();
            let units = |text: &str| text.replace('.', "").parse::<i64>().unwrap();
            known.insert((units(&mean), units(&se)), true);
        }
        let mut search = Search::default();
        let sample = Sample { n: 4, range: (0, 6), form };
        for (mean, se) in (0..=605).step_by(5).flat_map(|mean| (0..180).map(move |se| (mean, se))) {
            let text = |units: i64| format!("{}.{:02}", units / 100, units % 100);
            let found = sample.witness(&[print(&text(mean), &text(se), rounding)], &mut search);
            assert_eq!(found.is_some(), known.contains_key(&(mean, se)), "{rounding:?} {form:?} {mean} {se}");
        }
    }
}

/// Digits of a generator with constants from Knuth's MMIX.
fn draws(seed: u64) -> impl FnMut(u64) -> u64 {
    let mut state = seed;
    move |below| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % below
    }
}

/// Infeasible cells are reported, feasible ones never are.
#[test]
fn data_is_feasible_and_most_forgeries_are_not() {
    let mut draw = draws(20);
    let mut search = Search::default();
    let (mut caught, mut forged) = (0, 0);
    for _ in 0..400 {
        let n = 5 + draw(30);
        let values = (0..n).map(|_| 1 + i64::try_from(draw(100)).unwrap());
        let moments = values.fold(Moments::default(), |m, v| m.with(v).unwrap());
        for rounding in Rounding::ALL {
            let (mean, se) = printed(&moments, OfSample, rounding).unwrap();
            let sample = Sample { n, range: STEPS, form: OfSample };
            let honest = print(&mean, &se, rounding);
            assert!(sample.witness(&[honest], &mut search).is_some(), "{n} {mean} {se} {rounding:?}");
            let moved = honest.mean.units() + if draw(2) == 0 { 1 } else { -1 };
            let forgery = Print { mean: exact::number::Decimal::of_units(moved, 2), ..honest };
            forged += 1;
            caught += usize::from(sample.witness(&[forgery], &mut search).is_none());
        }
    }
    // A mean of n values has n of 100 possible pairs of digits: for n from 5 to 34, four in five forgeries are caught.
    assert!(caught * 100 > forged * 75, "{caught} of {forged}");
}

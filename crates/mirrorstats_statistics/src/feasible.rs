//! The means and standard errors that n integers can have: GRIM (Brown and Heathers 2017) and GRIMMER (Anaya 2016).
//!
//! Rule: no data can give what is called infeasible. A mean is a sum over n. A sum of squares is an integer of the
//! sum's parity, at least that of the most equal integers; of zeros and ones it is the sum. Every rounding is monotone,
//! so the sums that print as a text form an interval.

use std::cmp::Ordering;

use mirrorstats_exact::budget::{Budget, Exceeded};
use mirrorstats_exact::moments::{Moments, StandardError};
use mirrorstats_exact::number::Decimal;
use mirrorstats_exact::rounding::Rounding;

/// The known facts about a cell's values, besides its printed numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    /// The number of values; at least one.
    pub n: u64,
    pub is_rate: bool,
    pub form: StandardError,
}

/// The numbers of a cell, and their assumed rounding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Print {
    pub mean: Decimal,
    /// The standard error; `None` if none is printed, which constrains nothing.
    pub se: Option<Decimal>,
    pub rounding: Rounding,
}

/// Integers from the first to the second; none if the first is larger.
type Span = (i128, i128);

/// The largest absolute sum, and the largest excess of a sum of squares over its least, for numbers of nine digits and
/// 2,000 values; [`Moments::se_squared`] then keeps within 128 bits.
const LARGEST_SUM: i128 = 1 << 42;
const LARGEST_EXCESS: i128 = 1 << 84;

impl Sample {
    /// The sums that print as the mean.
    pub fn sums(&self, print: &Print) -> Span {
        let all = if self.is_rate { (0, self.n.into()) } else { (-LARGEST_SUM, LARGEST_SUM) };
        printing_as(all, print.mean, |sum| self.mean(sum, print))
    }

    /// Returns true if some integers with one of these sums print as the standard error. Each tried sum is counted.
    pub fn has_spread(&self, sums: Span, print: &Print, tried: &Budget) -> Result<bool, Exceeded> {
        for sum in sums.0..=sums.1 {
            tried.spend(1)?;
            if self.prints(sum, print) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The means that print nearest below and above, if there are any.
    pub fn means_beside(&self, print: &Print) -> [Option<Decimal>; 2] {
        let (low, high) = self.sums(print);
        let mean =
            |sum: i128| if self.is_rate && !(0..=self.n.into()).contains(&sum) { None } else { self.mean(sum, print) };
        [mean(low - 1), mean(high + 1)]
    }

    fn mean(&self, sum: i128, print: &Print) -> Option<Decimal> {
        print.rounding.ratio(sum, self.n.into(), print.mean.places())
    }

    fn prints(&self, sum: i128, print: &Print) -> bool {
        let Some(se) = print.se else { return true };
        if self.n == 1 {
            return se.units() == 0;
        }
        let n = i128::from(self.n);
        let (each, more) = (sum.div_euclid(n), sum.rem_euclid(n));
        // `more` of the integers are larger by one.
        let least = n * each * each + more * (2 * each + 1);
        let most = if self.is_rate { sum } else { least + LARGEST_EXCESS };
        let squares = printing_as((least, most), se, |squares| self.se(sum, squares, print));
        squares.0 + (squares.0 - sum).rem_euclid(2) <= squares.1
    }

    fn se(&self, sum: i128, squares: i128, print: &Print) -> Option<Decimal> {
        let (above, below) = Moments { n: self.n, sum, sum_sq: squares }.se_squared(self.form)?;
        print.rounding.root(above, below, print.se?.places())
    }
}

/// The part of a span that prints as `target`; `shown` ascends.
fn printing_as(span: Span, target: Decimal, shown: impl Fn(i128) -> Option<Decimal>) -> Span {
    let compare = |value| shown(value).map_or(Ordering::Greater, |printed| printed.cmp_value(target));
    let from = first_not(span, |value| compare(value) == Ordering::Less);
    let beyond = first_not((from, span.1), |value| compare(value) != Ordering::Greater);
    (from, beyond - 1)
}

/// The first integer of a span for which `holds` is false; one past the end if it always holds.
pub(crate) fn first_not((mut low, high): Span, holds: impl Fn(i128) -> bool) -> i128 {
    let mut beyond = (high + 1).max(low);
    while low < beyond {
        let middle = low + (beyond - low) / 2;
        if holds(middle) { low = middle + 1 } else { beyond = middle }
    }
    low
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::{Print, Sample};
    use mirrorstats_exact::budget::{Budget, Limit};
    use mirrorstats_exact::moments::{Moments, StandardError};
    use mirrorstats_exact::rounding::Rounding;

    fn is_feasible(sample: Sample, mean: &str, se: Option<&str>, rounding: Rounding) -> bool {
        let print = Print { mean: mean.parse().unwrap(), se: se.map(|se| se.parse().unwrap()), rounding };
        let tried = Budget::new(Limit::new("sums", 1_000_000));
        sample.has_spread(sample.sums(&print), &print, &tried).unwrap()
    }

    // Findings about the published tables: 19/21 with ddof = 1, 5/21 with ddof = 0, 1216/21 rounded twice.
    #[test]
    fn the_rules_of_the_paper_are_told_apart() {
        let rate = |form| Sample { n: 21, is_rate: true, form };
        let (sample, population) = (rate(StandardError::Sample), rate(StandardError::Population));
        assert!(is_feasible(sample, "0.91", Some("0.07"), Rounding::Twice));
        assert!(!is_feasible(sample, "0.91", Some("0.07"), Rounding::Binary));
        assert!(is_feasible(population, "0.24", Some("0.09"), Rounding::Binary));
        assert!(!is_feasible(sample, "0.24", Some("0.09"), Rounding::Binary));
        let duration = Sample { is_rate: false, ..sample };
        assert!(is_feasible(duration, "57.90", None, Rounding::HalfEven));
        assert!(!is_feasible(duration, "57.90", None, Rounding::Twice));
        assert!(!is_feasible(duration, "57.57", Some("0.00"), Rounding::HalfEven), "unequal integers differ");
        assert!(is_feasible(Sample { n: 1, ..duration }, "7.00", Some("0.00"), Rounding::HalfEven));
    }

    proptest! {
        #[test]
        fn the_print_of_any_integers_is_feasible(values in vec(-50_i64..200, 1..40), rate: bool, form: bool) {
            let form = if form { StandardError::Sample } else { StandardError::Population };
            let values = values.into_iter().map(|value| if rate { value.rem_euclid(2) } else { value });
            let moments = values.fold(Moments::default(), |moments, value| moments.with(value).unwrap());
            let sample = Sample { n: moments.n, is_rate: rate, form };
            for rounding in Rounding::ALL {
                let mean = rounding.ratio(moments.sum, moments.n.into(), 2).unwrap().to_string();
                let se = moments.se_squared(form).and_then(|(above, below)| rounding.root(above, below, 2));
                let se = se.map(|se| se.to_string());
                prop_assert!(is_feasible(sample, &mean, se.as_deref(), rounding), "{mean} {se:?} {rounding:?}");
            }
        }
    }
}

//! Decides whether any integers have a printed mean and standard error.
//!
//! Rule: exact. A mean of n integers is a sum over n (GRIM: Brown and Heathers 2017). With the sum, the standard error
//! fixes the sum of squares up to its rounding (SPRITE: Heathers et al. 2018). Both prints are monotone, so each leaves
//! an interval, and [`attain`] decides whether an integer in it is the sum of squares of any data. There is no
//! sampling: no data can give what is called infeasible.

pub mod attain;

use std::cmp::Ordering;

use self::attain::{Search, ends};
use exact::moments::{Moments, StandardError};
use exact::number::Decimal;
use exact::rounding::Rounding;

/// The known facts about a cell's values, besides its printed numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    /// The number of values; at least one.
    pub n: u64,
    /// The smallest and the largest possible value.
    pub range: (i64, i64),
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

impl Sample {
    /// The sums that print as all of these means.
    pub fn sums(&self, prints: &[Print]) -> Span {
        let mean = |sum, print: &Print| self.mean(sum, print);
        prints.iter().fold(self.all_sums(), |span, print| printing_as(span, print.mean, |sum| mean(sum, print)))
    }

    /// The possible sums of this number of values in the range.
    pub fn all_sums(&self) -> Span {
        let n = i128::from(self.n);
        (n * i128::from(self.range.0), n * i128::from(self.range.1))
    }

    /// Returns true if the printed means are between those of the ends of a span: two divisions, where [`Sample::sums`]
    /// bisects.
    pub fn reaches(&self, (least, most): Span, prints: &[Print]) -> bool {
        prints.iter().all(|print| {
            compare(self.mean(least, print), print.mean) != Ordering::Greater
                && compare(self.mean(most, print), print.mean) != Ordering::Less
        })
    }

    fn mean(&self, sum: i128, print: &Print) -> Option<Decimal> {
        print.rounding.ratio(sum, self.n.into(), print.mean.places())
    }

    /// Moments of values with this sum that print as all these standard errors; `None` if no values do.
    pub fn with_sum(&self, sum: i128, prints: &[Print], search: &mut Search) -> Option<Moments> {
        if self.n == 1 {
            let prints_alike = prints.iter().filter_map(|print| print.se).all(|se| se.units() == 0);
            return prints_alike.then_some(Moments { n: 1, sum, sum_sq: sum * sum });
        }
        let (low, high) = self.squares(sum, prints)?;
        // Sums of squares have the parity of the sum.
        let mut squares = low + (low - sum).rem_euclid(2);
        while squares <= high {
            if search.is_attained(self.n.into(), self.bounds(), sum, squares) {
                return Some(Moments { n: self.n, sum, sum_sq: squares });
            }
            squares += 2;
        }
        None
    }

    /// The sums whose means print nearest below and above a mean, if the range has any.
    pub fn sums_beside(&self, print: &Print) -> [Option<i128>; 2] {
        let (least, most) = self.all_sums();
        let is_below = |sum| compare(self.mean(sum, print), print.mean) == Ordering::Less;
        let above = first_not((least, most), is_below);
        [(above > least).then(|| above - 1), (above <= most).then_some(above)]
    }

    /// The moments with this sum whose standard errors print nearest below and above the printed one.
    pub fn spreads_beside(&self, sum: i128, print: &Print, search: &mut Search) -> [Option<Moments>; 2] {
        let (Some(se), Some((least, most))) = (print.se, ends(self.n.into(), self.bounds(), sum)) else {
            return [None; 2];
        };
        let above = first_not((least, most), |squares| compare(self.se(sum, squares, print), se) == Ordering::Less);
        let moments = |squares| Moments { n: self.n, sum, sum_sq: squares };
        let mut attained = |squares: &i128| search.is_attained(self.n.into(), self.bounds(), sum, *squares);
        let below = (least..above).rev().find(&mut attained);
        [below.map(moments), (above..=most).find(&mut attained).map(moments)]
    }

    fn squares(&self, sum: i128, prints: &[Print]) -> Option<Span> {
        let whole = ends(self.n.into(), self.bounds(), sum)?;
        Some(prints.iter().fold(whole, |span, print| match print.se {
            None => span,
            Some(se) => printing_as(span, se, |squares| self.se(sum, squares, print)),
        }))
    }

    fn se(&self, sum: i128, squares: i128, print: &Print) -> Option<Decimal> {
        let (above, below) = Moments { n: self.n, sum, sum_sq: squares }.se_squared(self.form)?;
        print.rounding.root(above, below, print.se?.places())
    }

    fn bounds(&self) -> Span {
        (self.range.0.into(), self.range.1.into())
    }
}

/// The part of a span that prints as `target`; `shown` ascends.
fn printing_as(span: Span, target: Decimal, shown: impl Fn(i128) -> Option<Decimal>) -> Span {
    let from = first_not(span, |value| compare(shown(value), target) == Ordering::Less);
    let beyond = first_not((from, span.1), |value| compare(shown(value), target) != Ordering::Greater);
    (from, beyond - 1)
}

fn compare(printed: Option<Decimal>, target: Decimal) -> Ordering {
    printed.map_or(Ordering::Greater, |printed| printed.cmp_value(target))
}

/// The first integer of a span for which `holds` is false; one past its end if there is none.
pub(crate) fn first_not((mut low, high): Span, holds: impl Fn(i128) -> bool) -> i128 {
    let mut beyond = (high + 1).max(low);
    while low < beyond {
        let middle = low + (beyond - low) / 2;
        if holds(middle) { low = middle + 1 } else { beyond = middle }
    }
    low
}

#[cfg(test)]
mod tests;

//! Exact moments of integers, and the mean and standard errors that follow from them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Count, sum and sum of squares of some integers: enough for the mean and its standard error.
///
/// Addition is exact in any order; 128 bits hold 2^64 values of 32 bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Moments {
    pub n: u64,
    pub sum: i128,
    pub sum_sq: i128,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the sum of squares exceeds 128 bits; use a smaller unit in the metric's definition")]
pub struct MomentOverflow;

impl Moments {
    /// Adds one value. Errors: a sum beyond 128 bits, which no metric of steps can reach.
    pub fn with(self, value: i64) -> Result<Self, MomentOverflow> {
        let value = i128::from(value);
        Ok(Self {
            n: self.n + 1,
            sum: self.sum.checked_add(value).ok_or(MomentOverflow)?,
            sum_sq: self.sum_sq.checked_add(value * value).ok_or(MomentOverflow)?,
        })
    }

    pub fn with_truths(self, zeros: usize, ones: usize) -> Result<Self, MomentOverflow> {
        let (n, sum) = ((zeros + ones) as u64, ones as i128);
        Ok(Self {
            n: self.n + n,
            sum: self.sum.checked_add(sum).ok_or(MomentOverflow)?,
            sum_sq: self.sum_sq.checked_add(sum).ok_or(MomentOverflow)?,
        })
    }

    /// The successes and the episodes of a rate; `None` unless the values fit zeros and ones.
    pub fn counts(self) -> Option<(u64, u64)> {
        let successes = u64::try_from(self.sum).ok()?;
        (successes <= self.n && self.sum == self.sum_sq).then_some((successes, self.n))
    }

    /// Returns true if two values differ.
    pub fn has_spread(self) -> bool {
        self.se(StandardError::Population).is_some_and(|se| se > 0.0)
    }

    /// The arithmetic mean; `None` without values.
    #[expect(clippy::cast_precision_loss, reason = "the one conversion from integers, done once")]
    pub fn mean(self) -> Option<f64> {
        (self.n > 0).then(|| self.sum as f64 / self.n as f64)
    }

    /// The exact square of the standard error as a fraction `(above, below)`, both non-negative.
    ///
    /// Sample form: (n·Σx² − (Σx)²) / (n²·(n−1)); population form: (n·Σx² − (Σx)²) / n³.
    /// `None` without values, for the sample form of one value, or if 128 bits do not suffice.
    pub fn se_squared(self, form: StandardError) -> Option<(i128, i128)> {
        let n = i128::from(self.n);
        let spread = n.checked_mul(self.sum_sq)?.checked_sub(self.sum.checked_mul(self.sum)?)?;
        let freedom = match form {
            StandardError::Sample => n - 1,
            StandardError::Population => n,
        };
        let below = n.checked_mul(n)?.checked_mul(freedom)?;
        (below > 0).then_some((spread, below))
    }

    /// The standard error of the mean (paper, Aggregation); `None` if it is undefined.
    #[expect(clippy::cast_precision_loss, reason = "the one conversion from integers, done once")]
    pub fn se(self, form: StandardError) -> Option<f64> {
        let (above, below) = self.se_squared(form)?;
        Some((above as f64 / below as f64).sqrt())
    }
}

crate::names! {
    /// The standard deviation behind the standard error of the mean.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
    #[serde(rename_all = "lowercase")]
    pub enum StandardError {
        /// The sample standard deviation (ddof = 1); undefined for n = 1.
        #[default]
        Sample = "sample",
        /// The population standard deviation (ddof = 0).
        Population = "population",
    }
}

#[cfg(test)]
mod tests {
    use super::Moments;
    use super::StandardError::{Population, Sample};

    fn of(values: &[i64]) -> Moments {
        values.iter().fold(Moments::default(), |m, &v| m.with(v).unwrap())
    }

    #[test]
    fn a_rate_has_the_textbook_standard_errors() {
        let m = of(&[1, 1, 0, 0, 1]);
        assert_eq!((m.n, m.sum, m.sum_sq), (5, 3, 3));
        assert!((m.se(Sample).unwrap() - (0.6f64 * 0.4 / 4.0).sqrt()).abs() < 1e-15);
        assert!((m.se(Population).unwrap() - (0.6f64 * 0.4 / 5.0).sqrt()).abs() < 1e-15);
    }

    #[test]
    fn zero_or_one_values_have_no_standard_error() {
        assert_eq!((of(&[]).mean(), of(&[]).se(Sample), of(&[]).se(Population)), (None, None, None));
        assert_eq!((of(&[7]).mean(), of(&[7]).se(Sample), of(&[7]).se(Population)), (Some(7.0), None, Some(0.0)));
    }
}

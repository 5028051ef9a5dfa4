//! The possible roundings of a printed number.
//!
//! Rule: every rounding is monotone, so the numbers that print as a given text form an interval. The exact ones work in
//! integers. Those of binary floats divide and take the root once, like the programs that print them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::number::{Decimal, power_of_ten};

crate::names! {
    /// The rounding of an exact number for print.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
    #[serde(rename_all = "kebab-case")]
    pub enum Rounding {
        /// The exact value once, ties to even.
        HalfEven = "half-even",
        /// The exact value once, ties away from zero.
        HalfUp = "half-up",
        /// The nearest binary float once, as `printf` and Python print it.
        Binary = "binary",
        /// The nearest binary float to one digit more, then that text with ties away from zero.
        Twice = "twice",
        /// Digits cut off.
        Truncate = "truncate",
    }
}

impl Rounding {
    /// `above / below` as printed. `None` if `below` is not positive, or if 128 bits do not suffice.
    #[expect(clippy::cast_precision_loss, reason = "the rounding of the float is the rule")]
    pub fn ratio(self, above: i128, below: i128, places: u32) -> Option<Decimal> {
        if below <= 0 {
            return None;
        }
        match self {
            Self::HalfEven => Decimal::of_ratio(above, below, places),
            Self::HalfUp => {
                let doubled = above.abs().checked_mul(2 * power_of_ten(places)?)?.checked_add(below)?;
                Some(signed(above, doubled / below.checked_mul(2)?, places))
            }
            Self::Truncate => Some(signed(above, above.abs().checked_mul(power_of_ten(places)?)? / below, places)),
            Self::Binary => Decimal::of_float(above as f64 / below as f64, places),
            Self::Twice => Decimal::of_float_twice(above as f64 / below as f64, places),
        }
    }

    /// The square root of `above / below` as printed. `None` if `below` is not positive, `above` is negative, or 128
    /// bits do not suffice.
    #[expect(clippy::cast_precision_loss, reason = "the rounding of the float is the rule")]
    pub fn root(self, above: i128, below: i128, places: u32) -> Option<Decimal> {
        if below <= 0 || above < 0 {
            return None;
        }
        let square = power_of_ten(places)?.checked_mul(power_of_ten(places)?)?;
        let float = || (above as f64 / below as f64).sqrt();
        match self {
            Self::HalfEven => Decimal::of_root(above, below, places),
            // The floor of x + 1/2 is half of the floor of 2x, plus one.
            Self::HalfUp => {
                let doubled = (above.checked_mul(square.checked_mul(4)?)? / below).isqrt();
                Some(Decimal::of_units((doubled + 1) / 2, places))
            }
            Self::Truncate => Some(Decimal::of_units((above.checked_mul(square)? / below).isqrt(), places)),
            Self::Binary => Decimal::of_float(float(), places),
            Self::Twice => Decimal::of_float_twice(float(), places),
        }
    }
}

fn signed(sign_of: i128, size: i128, places: u32) -> Decimal {
    Decimal::of_units(size * sign_of.signum(), places)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::Rounding;

    fn check(above: i128, below: i128, expected: [&str; 5]) {
        let found = Rounding::ALL.map(|rule| rule.ratio(above, below, 2).unwrap().to_string());
        assert_eq!(found, expected, "{above}/{below}");
    }

    // Python 3.11: decimal.Decimal(above) / below with quantize and ROUND_HALF_EVEN, ROUND_HALF_UP, ROUND_DOWN; "%.2f".
    #[test]
    fn each_rounding_matches_worked_examples() {
        check(1, 8, ["0.12", "0.13", "0.12", "0.13", "0.12"]);
        check(3, 8, ["0.38", "0.38", "0.38", "0.38", "0.37"]);
        check(19, 21, ["0.90", "0.90", "0.90", "0.91", "0.90"]);
        check(2, 3, ["0.67", "0.67", "0.67", "0.67", "0.66"]);
        check(-1, 8, ["-0.12", "-0.13", "-0.12", "-0.13", "-0.12"]);
        // 1.005 is a little less as a binary float.
        check(201, 200, ["1.00", "1.01", "1.00", "1.01", "1.00"]);
        check(1216, 21, ["57.90", "57.90", "57.90", "57.91", "57.90"]);
    }

    #[test]
    fn roots_round_like_ratios() {
        let found = Rounding::ALL.map(|rule| rule.root(1, 64, 2).unwrap().to_string());
        assert_eq!(found, ["0.12", "0.13", "0.12", "0.13", "0.12"]);
        assert_eq!(Rounding::HalfUp.root(2, 1, 4).unwrap().to_string(), "1.4142");
        assert_eq!(Rounding::Truncate.root(3, 1, 2).unwrap().to_string(), "1.73");
        for rule in Rounding::ALL {
            assert_eq!([rule.root(-1, 2, 2), rule.root(1, 0, 2), rule.ratio(1, 0, 2)], [None; 3]);
        }
    }

    proptest! {
        #[test]
        fn every_rounding_is_monotone_and_within_one_unit(above in -5_000_i128..5_000, below in 1_i128..400) {
            for rule in Rounding::ALL {
                let here = rule.ratio(above, below, 2).unwrap().units();
                prop_assert!(here <= rule.ratio(above + 1, below, 2).unwrap().units());
                prop_assert!((here * below - 100 * above).abs() < below);
                let root = |above: i128| rule.root(above, below, 2).unwrap().units();
                prop_assert!(root(above.abs()) <= root(above.abs() + 1));
            }
        }
    }
}

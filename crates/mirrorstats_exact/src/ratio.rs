//! Exact fractions such as the chance level `1/3`.

use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::number::{Decimal, gcd};

/// A fraction of two integers in lowest terms; written `1/3` in files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "String", into = "String")]
#[schemars(with = "String")]
pub struct Ratio {
    numerator: i64,
    denominator: i64,
}

impl Ratio {
    /// `numerator / denominator` in lowest terms; `None` unless the denominator is positive.
    pub fn new(numerator: i64, denominator: i64) -> Option<Self> {
        if denominator <= 0 {
            return None;
        }
        let divisor = gcd(i128::from(numerator).abs(), denominator.into());
        let divisor = i64::try_from(divisor).ok()?;
        Some(Self { numerator: numerator / divisor, denominator: denominator / divisor })
    }

    pub fn numerator(self) -> i64 {
        self.numerator
    }

    pub fn denominator(self) -> i64 {
        self.denominator
    }

    #[expect(clippy::cast_precision_loss, reason = "levels of chance are small fractions")]
    pub fn value(self) -> f64 {
        self.numerator as f64 / self.denominator as f64
    }
}

impl fmt::Display for Ratio {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.denominator {
            1 => write!(f, "{}", self.numerator),
            denominator => write!(f, "{}/{denominator}", self.numerator),
        }
    }
}

impl FromStr for Ratio {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let fault = || format!("expected a fraction such as `1/3`, found `{text}`");
        if text.contains('.') {
            return decimal(text.trim()).ok_or_else(fault);
        }
        let (above, below) = text.split_once('/').unwrap_or((text, "1"));
        let above = above.trim().parse().map_err(|_| fault())?;
        let below = below.trim().parse().map_err(|_| fault())?;
        Self::new(above, below).ok_or_else(fault)
    }
}

/// `0.25` as an exact fraction.
fn decimal(text: &str) -> Option<Ratio> {
    let unsigned = Some(text).filter(|text| text.starts_with(|c: char| c.is_ascii_digit()));
    let number: Decimal = unsigned?.parse().ok()?;
    Ratio::new(i64::try_from(number.units()).ok()?, 10i64.checked_pow(number.places())?)
}

impl TryFrom<String> for Ratio {
    type Error = String;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        text.parse()
    }
}

impl From<Ratio> for String {
    fn from(ratio: Ratio) -> Self {
        ratio.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::Ratio;

    #[test]
    fn text_round_trips_in_lowest_terms() {
        for (text, expected) in
            [("1/3", "1/3"), ("2/6", "1/3"), ("0/7", "0"), ("4/2", "2"), (" 1 / 10 ", "1/10"), ("0.25", "1/4")]
        {
            assert_eq!(text.parse::<Ratio>().unwrap().to_string(), expected);
        }
    }

    #[test]
    fn invalid_fractions_are_refused() {
        for text in ["", "a", "1/0", "1/-3", ".5", "1.", "-0.5", "1e-1", "1/2/3"] {
            assert!(text.parse::<Ratio>().is_err(), "{text}");
        }
    }
}

//! Converts exact numbers to text: the only place that rounds.
//!
//! A [`Decimal`] is a printed number: an integer and its number of digits after the point. It comes from an exact
//! fraction, the root of one, or the exact value of a float. All conversions round once and correctly, except
//! [`Decimal::of_float_twice`], which rounds twice because the paper did.

use std::cmp::Ordering;
use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// The most digits after the point that are worth printing.
pub(crate) const MOST_PLACES: u32 = 9;

/// A number as printed: `units / 10^places`. Zero has no sign, so `-0.00` cannot be printed. In JSON it is a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, JsonSchema)]
#[schemars(with = "f64")]
pub struct Decimal {
    units: i128,
    places: u32,
}

impl Decimal {
    pub fn zero(places: u32) -> Self {
        Self { units: 0, places }
    }

    pub fn of_units(units: i128, places: u32) -> Self {
        Self { units, places }
    }

    /// The number in units of its last digit: 57 for `0.57`.
    pub fn units(self) -> i128 {
        self.units
    }

    pub fn places(self) -> u32 {
        self.places
    }

    /// The same number with this many digits; `None` if that would drop digits other than zeros.
    pub fn with_places(self, places: u32) -> Option<Self> {
        let units = if let Some(more) = places.checked_sub(self.places) {
            self.units.checked_mul(power_of_ten(more)?)?
        } else {
            let divisor = power_of_ten(self.places - places)?;
            (self.units % divisor == 0).then_some(self.units / divisor)?
        };
        Some(Self { units, places })
    }

    /// The same number without zeros at its end, so that equal numbers are equal values.
    #[must_use]
    pub fn shortest(self) -> Self {
        let shorter = self.places.checked_sub(1).and_then(|places| self.with_places(places));
        shorter.map_or(self, Self::shortest)
    }

    /// `above / below` rounded once, ties to even. `None` if `below` is not positive, or if 128 bits do not suffice.
    pub fn of_ratio(above: i128, below: i128, places: u32) -> Option<Self> {
        if below <= 0 {
            return None;
        }
        let scale = power_of_ten(places)?;
        let rest = above.rem_euclid(below).checked_mul(scale)?;
        let floor = above.div_euclid(below).checked_mul(scale)?.checked_add(rest / below)?;
        let rest = rest % below;
        Some(Self { units: nearest(floor, rest.cmp(&(below - rest))), places })
    }

    /// The square root of `above / below` rounded once, ties to even, in integers throughout. `None` if `below` is not
    /// positive, `above` is negative, or 128 bits do not suffice.
    pub fn of_root(above: i128, below: i128, places: u32) -> Option<Self> {
        if below <= 0 || above < 0 {
            return None;
        }
        let divisor = gcd(above, below);
        let (above, below) = (above / divisor, below / divisor);
        let scale = power_of_ten(places)?;
        let scaled = above.checked_mul(scale.checked_mul(scale)?)?;
        let floor = (scaled / below).isqrt();
        // The root is above the midpoint of floor and floor + 1 if its square is above the midpoint's square.
        let middle = floor.checked_mul(2)?.checked_add(1)?;
        let order = scaled.checked_mul(4)?.cmp(&middle.checked_mul(middle)?.checked_mul(below)?);
        Some(Self { units: nearest(floor, order), places })
    }

    /// The float's exact binary value rounded once, ties to even: what `printf` and Python print. `None` for non-finite
    /// values, or if 128 bits do not suffice.
    pub fn of_float(value: f64, places: u32) -> Option<Self> {
        // With a smaller exponent the number is below 2^-44, which is zero at nine places or fewer.
        const SMALLEST_EXPONENT: i32 = -97;
        let (mantissa, exponent) = binary_parts(value)?;
        match exponent {
            0.. => Self::of_ratio(mantissa.checked_mul(power_of_two(exponent)?)?, 1, places),
            SMALLEST_EXPONENT.. => Self::of_ratio(mantissa, power_of_two(-exponent)?, places),
            _ => (places <= MOST_PLACES).then_some(Self::zero(places)),
        }
    }

    /// Rounds the float as [`Decimal::of_float`] does to one more digit, then rounds that text, halves away from zero.
    /// The paper's main table was made this way.
    pub fn of_float_twice(value: f64, places: u32) -> Option<Self> {
        let once = Self::of_float(value, places + 1)?.units;
        let size = (once.abs() + 5) / 10;
        Some(Self { units: size * once.signum(), places })
    }

    /// Compares two numbers by value: `0.1` equals `0.10`.
    pub fn cmp_value(self, other: Self) -> Ordering {
        let places = self.places.max(other.places);
        self.parts(places).cmp(&other.parts(places))
    }

    /// The text without the zero before the point, for narrow columns: `.50`.
    pub fn compact(self) -> String {
        let text = self.to_string();
        match text.strip_prefix("0.") {
            Some(digits) => format!(".{digits}"),
            None => text,
        }
    }

    /// The whole part and the rest in units of `places` digits; `places` is at least this number's own.
    fn parts(self, places: u32) -> (i128, i128) {
        let scale = |places| power_of_ten(places).unwrap_or(i128::MAX);
        let own = scale(self.places);
        (self.units.div_euclid(own), self.units.rem_euclid(own).saturating_mul(scale(places - self.places)))
    }
}

impl fmt::Display for Decimal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sign = if self.units < 0 { "-" } else { "" };
        let width = self.places as usize;
        let digits = format!("{:0>1$}", self.units.unsigned_abs(), width + 1);
        let (whole, part) = digits.split_at(digits.len() - width);
        match part {
            "" => write!(f, "{sign}{whole}"),
            part => write!(f, "{sign}{whole}.{part}"),
        }
    }
}

impl Serialize for Decimal {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match (self.places, self.to_string().parse()) {
            (0, _) => serializer.serialize_i128(self.units),
            (_, Ok(nearest)) => serializer.serialize_f64(nearest),
            (_, Err(error)) => Err(serde::ser::Error::custom(format!("{self}: {error}"))),
        }
    }
}

impl<'de> Deserialize<'de> for Decimal {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Number {
            Int(i64),
            Float(f64),
        }
        match Number::deserialize(deserializer)? {
            Number::Int(units) => Ok(Self::of_units(units.into(), 0)),
            Number::Float(value) => value.to_string().parse().map_err(serde::de::Error::custom),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected a plain decimal number such as `0.57`")]
pub struct NotADecimal;

impl FromStr for Decimal {
    type Err = NotADecimal;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let unsigned = text.strip_prefix(['-', '+']).unwrap_or(text);
        let (whole, part) = unsigned.split_once('.').unwrap_or((unsigned, ""));
        let is_digits = |digits: &str| digits.bytes().all(|b| b.is_ascii_digit());
        let is_whole = !whole.is_empty() && is_digits(whole) && is_digits(part) && !unsigned.ends_with('.');
        if !is_whole {
            return Err(NotADecimal);
        }
        let size: i128 = format!("{whole}{part}").parse().map_err(|_| NotADecimal)?;
        let places = u32::try_from(part.len()).map_err(|_| NotADecimal)?;
        Ok(Self { units: if text.starts_with('-') { -size } else { size }, places })
    }
}

/// All digits that distinguish this float from its neighbours, for files that programs read.
pub fn full_precision(value: f64) -> String {
    // Adding zero removes the sign of a negative zero.
    (value + 0.0).to_string()
}

/// `floor` or the next integer, depending on how the remainder compares with a half.
fn nearest(floor: i128, remainder: Ordering) -> i128 {
    match remainder {
        Ordering::Less => floor,
        Ordering::Equal => floor + floor.rem_euclid(2),
        Ordering::Greater => floor + 1,
    }
}

/// `value = mantissa * 2^exponent`, exactly; `None` for non-finite values.
fn binary_parts(value: f64) -> Option<(i128, i32)> {
    const MANTISSA_BITS: u32 = 52;
    const EXPONENT_BIAS: i32 = 1075;
    if !value.is_finite() {
        return None;
    }
    let bits = value.to_bits();
    let fraction = i128::from(bits & ((1 << MANTISSA_BITS) - 1));
    let exponent = i32::try_from((bits >> MANTISSA_BITS) & 0x7ff).ok()?;
    let (size, exponent) = match exponent {
        0 => (fraction, 1 - EXPONENT_BIAS),
        normal => (fraction | 1 << MANTISSA_BITS, normal - EXPONENT_BIAS),
    };
    Some((if value.is_sign_negative() { -size } else { size }, exponent))
}

pub(crate) fn power_of_ten(exponent: u32) -> Option<i128> {
    10_i128.checked_pow(exponent)
}

fn power_of_two(exponent: i32) -> Option<i128> {
    2_i128.checked_pow(u32::try_from(exponent).ok()?)
}

/// The greatest common divisor of non-negative numbers; 1 for two zeros.
pub(crate) fn gcd(a: i128, b: i128) -> i128 {
    if b == 0 { a.max(1) } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use std::cmp::Ordering;

    use proptest::prelude::*;

    use super::{Decimal, full_precision};

    fn shown(decimal: Option<Decimal>) -> String {
        decimal.map_or_else(|| "none".to_owned(), |d| d.to_string())
    }

    #[test]
    fn a_fraction_is_rounded_once_with_ties_to_even() {
        for (above, below, places, expected) in [
            (19, 21, 2, "0.90"),
            (1, 8, 2, "0.12"),
            (3, 8, 2, "0.38"),
            (-1, 8, 2, "-0.12"),
            (-1, 1000, 2, "0.00"),
            (5, 2, 0, "2"),
            (7, 2, 0, "4"),
            (-7, 2, 0, "-4"),
            (1, 3, 9, "0.333333333"),
            (2, 2, 2, "1.00"),
            (1, 0, 2, "none"),
            (1, -3, 2, "none"),
            (i128::MAX, 1, 2, "none"),
        ] {
            assert_eq!(shown(Decimal::of_ratio(above, below, places)), expected, "{above}/{below}");
        }
    }

    #[test]
    fn a_root_is_rounded_on_its_exact_value() {
        for (above, below, places, expected) in [
            (1, 64, 2, "0.12"),
            (9, 64, 2, "0.38"),
            (2, 1, 9, "1.414213562"),
            (0, 5, 2, "0.00"),
            (1, 4, 0, "0"),
            (9, 4, 0, "2"),
            (-1, 4, 2, "none"),
            (1, 0, 2, "none"),
            (i128::MAX, 1, 2, "none"),
        ] {
            assert_eq!(shown(Decimal::of_root(above, below, places)), expected, "root of {above}/{below}");
        }
    }

    #[test]
    fn the_two_roundings_of_the_paper_differ_where_it_differs() {
        let rate = 19.0 / 21.0;
        assert_eq!(shown(Decimal::of_float(rate, 2)), "0.90");
        assert_eq!(shown(Decimal::of_float_twice(rate, 2)), "0.91");
        assert_eq!(shown(Decimal::of_float(0.125, 2)), "0.12");
        assert_eq!(shown(Decimal::of_float_twice(0.125, 2)), "0.13");
        assert_eq!(shown(Decimal::of_float_twice(1216.0 / 21.0, 2)), "57.91");
        assert_eq!(shown(Decimal::of_float_twice(-0.125, 2)), "-0.13");
    }

    #[test]
    fn a_float_is_rounded_on_its_binary_value() {
        for (value, expected) in [
            (2.675, "2.67"),
            (1.005, "1.00"),
            (-0.001, "0.00"),
            (-0.0, "0.00"),
            (5e-324, "0.00"),
            (1e-20, "0.00"),
            (1e20, "100000000000000000000.00"),
            (1e300, "none"),
            (f64::NAN, "none"),
            (f64::INFINITY, "none"),
        ] {
            assert_eq!(shown(Decimal::of_float(value, 2)), expected, "{value}");
        }
    }

    #[test]
    fn text_that_is_no_plain_number_is_refused() {
        for text in ["", ".", "1.", ".5", "-", "1e3", "1,5", " 1", "0.5 ", "--", "NaN", "0x1", "1.2.3"] {
            assert!(text.parse::<Decimal>().is_err(), "{text}");
        }
    }

    #[test]
    fn numbers_with_different_digits_compare_by_value() {
        let of = |text: &str| text.parse::<Decimal>().unwrap();
        assert_eq!(of("0.1").cmp_value(of("0.10")), Ordering::Equal);
        assert_eq!(of("-0.00").cmp_value(of("0")), Ordering::Equal);
        assert_eq!(of("9.9").cmp_value(of("10.01")), Ordering::Less);
        assert_eq!(of("-1").cmp_value(of("-1.5")), Ordering::Greater);
        let huge = i128::MAX.to_string();
        assert_eq!(of(&huge).cmp_value(of("0.000000001")), Ordering::Greater);
        assert_eq!(of(&huge).cmp_value(of(&huge)), Ordering::Equal);
    }

    #[test]
    fn little_room_drops_only_the_leading_zero() {
        for (text, expected) in [("0.50", ".50"), ("1.00", "1.00"), ("0", "0"), ("10.5", "10.5")] {
            assert_eq!(text.parse::<Decimal>().unwrap().compact(), expected);
        }
    }

    #[test]
    fn full_precision_has_no_negative_zero() {
        assert_eq!(full_precision(-0.0), "0");
        assert_eq!(full_precision(0.1), "0.1");
        assert_eq!(full_precision(1.0), "1");
    }

    proptest! {
        #[test]
        fn a_float_prints_as_the_standard_library_rounds(value in -1e12..1e12, places in 0_u32..7) {
            let expected = format!("{value:.*}", places as usize);
            let expected: Decimal = expected.parse().unwrap();
            prop_assert_eq!(Decimal::of_float(value, places), Some(expected));
        }

        #[test]
        fn print_then_parse_gives_the_number_back(above in -1_000_000_i128..1_000_000, places in 0_u32..9) {
            let decimal = Decimal::of_ratio(above, 997, places).unwrap();
            prop_assert_eq!(decimal.to_string().parse::<Decimal>(), Ok(decimal));
        }

        #[test]
        fn the_root_is_the_nearest_decimal(above in 0_i128..1_000_000_000, below in 1_i128..1_000_000) {
            let root = Decimal::of_root(above, below, 4).unwrap();
            // |r - root| <= half a unit  <=>  (2u - 1)^2 <= 4 * 10^8 * above / below <= (2u + 1)^2
            let target = 4 * 100_000_000 * above;
            let (low, high) = ((2 * root.units - 1).max(0), 2 * root.units + 1);
            prop_assert!(low * low * below <= target && target <= high * high * below);
        }
    }
}

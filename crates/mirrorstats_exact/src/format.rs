//! Numbers for readers: counts, a fixed number of decimals, p values, intervals.
//!
//! These numbers are floats from the start; `number` formats exact fractions.

/// `1 file`, `2 files`, `2 replies`.
pub fn counted(count: impl Into<u64>, noun: &str) -> String {
    match count.into() {
        1 => format!("1 {noun}"),
        count => match noun.strip_suffix("ply") {
            Some(stem) => format!("{count} {stem}plies"),
            None => format!("{count} {noun}s"),
        },
    }
}

pub const UNDEFINED: &str = "--";

/// `value` to `places` decimals; zero has no sign. Missing and non-finite values give [`UNDEFINED`].
pub fn fixed(value: Option<f64>, places: usize) -> String {
    let Some(value) = value.filter(|value| value.is_finite()) else {
        return UNDEFINED.to_owned();
    };
    let text = format!("{value:.places$}");
    match text.strip_prefix('-') {
        Some(digits) if digits.bytes().all(|b| b == b'0' || b == b'.') => digits.to_owned(),
        _ => text,
    }
}

/// A p value: three decimals, four below 0.001, never zero.
pub fn p_value(p: Option<f64>) -> String {
    match p {
        Some(p) if p < 0.0001 => "<0.0001".to_owned(),
        Some(p) if p < 0.001 => fixed(Some(p), 4),
        _ => fixed(p, 3),
    }
}

/// An e-value: two decimals, whole numbers from 100, and a bound if it is very large or very small.
pub fn e_value(e: f64) -> String {
    match e {
        e if e > 9999.0 => ">9999".to_owned(),
        e if e >= 100.0 => fixed(Some(e), 0),
        e if e < 0.01 => "<0.01".to_owned(),
        e => fixed(Some(e), 2),
    }
}

/// `[low, high]` to `places` decimals; [`UNDEFINED`] without bounds.
pub fn bounds(bounds: Option<(f64, f64)>, places: usize) -> String {
    bounds.map_or_else(
        || UNDEFINED.to_owned(),
        |(low, high)| format!("[{}, {}]", fixed(Some(low), places), fixed(Some(high), places)),
    )
}

#[cfg(test)]
mod tests {
    use super::{bounds, e_value, fixed, p_value};

    #[test]
    fn zero_is_unsigned_and_a_missing_value_is_a_dash() {
        assert_eq!(fixed(Some(-0.0004), 3), "0.000");
        assert_eq!(fixed(Some(-0.0006), 3), "-0.001");
        assert_eq!(fixed(Some(12.345), 1), "12.3");
        assert_eq!([fixed(None, 3), fixed(Some(f64::NAN), 3)], ["--"; 2]);
        assert_eq!(bounds(Some((0.0, 0.1546)), 3), "[0.000, 0.155]");
        assert_eq!(bounds(None, 3), "--");
    }

    #[test]
    fn a_small_p_value_is_not_zero() {
        let found = [1.0, 0.0391, 0.00027, 1e-30, 0.0].map(|p| p_value(Some(p)));
        assert_eq!(found, ["1.000", "0.039", "0.0003", "<0.0001", "<0.0001"]);
        assert_eq!(p_value(None), "--");
    }

    #[test]
    fn an_e_value_has_a_bound_at_either_end() {
        let found = [0.0, 0.25, 14.4375, 610.446, 9999.4, f64::MAX].map(e_value);
        assert_eq!(found, ["<0.01", "0.25", "14.44", "610", ">9999", ">9999"]);
    }
}

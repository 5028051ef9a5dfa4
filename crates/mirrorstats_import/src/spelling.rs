//! Cells of CSV, and decimal numbers of tables: texts whose type follows from their column.
//!
//! Rule: a number stays exact, or is refused or stays text; an empty cell is null. `nan` and `inf` are floats.

use std::borrow::Cow;

use super::value::Cell;
use mirrorstats_trace::schema::Kind;

pub(super) fn kind_of(cell: &str) -> Kind {
    match cell {
        cell if cell.eq_ignore_ascii_case("true") || cell.eq_ignore_ascii_case("false") => Kind::Bool,
        cell if cell.parse().is_ok_and(|number: i64| number.to_string() == cell) => Kind::Int,
        cell if is_decimal(cell) && is_held(cell) || is_special(cell) => Kind::Float,
        _ => Kind::String,
    }
}

/// The value of a cell in a column of this type; a text if the cell does not fit.
pub(super) fn typed(cell: Cow<'_, str>, column: Kind) -> Cell<'_> {
    let float = |cell: &str| cell.parse().map_or(f64::NAN, |number: f64| number);
    match (column, kind_of(&cell)) {
        (Kind::Bool, Kind::Bool) => Cell::Bool(cell.eq_ignore_ascii_case("true")),
        (Kind::Int | Kind::Float, Kind::Int) => cell.parse().map_or(Cell::Text(cell), Cell::Int),
        (Kind::Int, Kind::Float) => Cell::Float(float(&cell)).typed(Kind::Int),
        (Kind::Float, Kind::Float) => Cell::Float(float(&cell)),
        (Kind::Float, _) if is_number(&cell) && is_held(&cell) => Cell::Float(float(&cell)),
        (Kind::Int | Kind::Float, _) if is_number(&cell) => Cell::Unheld(cell),
        _ => Cell::Text(cell),
    }
}

pub(super) fn number(spelling: &str) -> Cell<'_> {
    match kind_of(spelling) {
        Kind::String => Cell::Unheld(spelling.into()),
        kind => typed(spelling.into(), kind),
    }
}

/// The numbers of columns without a type, for messages.
pub(super) fn held() -> String {
    format!("an integer of at most {}, or a number that 64-bit floats hold", i64::MAX)
}

/// The integer that a number with a point equals, as in `2.0`.
#[expect(clippy::cast_possible_truncation, reason = "it is whole and within 2^53")]
pub(super) fn whole(number: f64) -> Option<i64> {
    const EXACT: f64 = 9_007_199_254_740_992.0;
    (number.fract() == 0.0 && number.abs() <= EXACT).then_some(number as i64)
}

/// Spellings of missing values in CSV of R, pandas and spreadsheets.
pub(super) fn is_absent(text: &str) -> bool {
    ["NA", "N/A", "#N/A", "None", "null", "NULL"].contains(&text)
}

/// Returns true for cells that belong to a column of numbers or truth values but have no value there.
pub(super) fn is_odd(cell: &str) -> bool {
    is_absent(cell) || is_decimal(cell) && !is_held(cell)
}

pub(super) fn joined(before: Kind, now: Kind) -> Kind {
    match (before, now) {
        (before, now) if before == now => now,
        (Kind::Int | Kind::Float, Kind::Int | Kind::Float) => Kind::Float,
        _ => Kind::String,
    }
}

/// Returns true for numbers with a fraction or an exponent. Integers that 64 bits do not hold stay texts.
fn is_decimal(cell: &str) -> bool {
    let digits = cell.trim_start_matches('-');
    let is_integer = digits.len() > 1 && digits.bytes().all(|byte| byte.is_ascii_digit());
    !is_integer && is_number(cell)
}

/// Returns true for spelled numbers of any size, but not for texts of digits such as `007`.
fn is_number(cell: &str) -> bool {
    let digits = cell.trim_start_matches('-').as_bytes();
    let leads_with_zero = digits.first() == Some(&b'0') && digits.get(1).is_some_and(u8::is_ascii_digit);
    !leads_with_zero && digits.iter().any(u8::is_ascii_digit) && cell.parse::<f64>().is_ok()
}

fn is_special(cell: &str) -> bool {
    cell.parse().is_ok_and(|number: f64| !number.is_finite()) && !is_number(cell)
}

/// Returns true if the nearest float is this number: a whole number exactly, another one to all digits that are spelled
/// or to those of the float's shortest spelling, such as `0.1`.
pub(super) fn is_held(number: &str) -> bool {
    /// Up to this many significant digits, a decimal is the shortest spelling of its float (IEEE 754, binary64).
    const ALWAYS: usize = 15;
    /// No float has more significant digits.
    const MOST: usize = 767;
    let Ok(float) = number.parse::<f64>() else { return false };
    let (mantissa, exponent) = number.split_once(['e', 'E']).unwrap_or((number, ""));
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    if exponent.is_empty() && fraction.bytes().all(|digit| digit == b'0') {
        return format!("{:.0}", float.abs()) == significant(whole, false);
    }
    let digits = significant(mantissa, true);
    let spelled_as = |text: String| significant(text.split('e').next().unwrap_or_default(), true) == digits;
    match digits.len() {
        0 => true,
        _ if !float.is_finite() => false,
        1..=ALWAYS if float.is_normal() => true,
        count if count > MOST => false,
        count => spelled_as(format!("{float:e}")) || spelled_as(format!("{float:.*e}", count - 1)),
    }
}

/// The digits without leading zeros and, with `trim_end`, without trailing zeros.
fn significant(number: &str, trim_end: bool) -> String {
    let digits: String = number.chars().filter(char::is_ascii_digit).collect();
    let digits = digits.trim_start_matches('0');
    match if trim_end { digits.trim_end_matches('0') } else { digits } {
        "" if !trim_end => "0".to_owned(),
        digits => digits.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::{Cell, kind_of, typed};
    use mirrorstats_trace::schema::Kind;

    #[test]
    fn numbers_are_exact_or_texts() {
        for (cell, kind) in [
            ("9007199254740993", Kind::Int),
            ("9223372036854775808", Kind::String),
            ("9007199254740992.0", Kind::Float),
            ("9007199254740993.0", Kind::String),
            ("9007199254740993.01", Kind::String),
            ("12345678901234567890.12", Kind::String),
            ("33.18", Kind::Float),
            ("0.30000000000000004", Kind::Float),
            ("0.10000000000000000555", Kind::Float),
            ("0.1000000000000000066", Kind::String),
            ("1.7976931348623157e+308", Kind::Float),
            ("5e-324", Kind::Float),
            ("1e-400", Kind::String),
            ("-0", Kind::Float),
            ("007", Kind::String),
            ("1e3", Kind::Float),
            ("0e0", Kind::Float),
            (".5", Kind::Float),
            ("1e999", Kind::String),
            ("inf", Kind::Float),
            ("-Infinity", Kind::Float),
            ("NaN", Kind::Float),
            ("NA", Kind::String),
            ("False", Kind::Bool),
        ] {
            assert_eq!(kind_of(cell), kind, "{cell}");
        }
        assert_eq!(typed("9007199254740993".into(), Kind::Float), Cell::Int(9_007_199_254_740_993));
        assert_eq!(typed("9223372036854775808".into(), Kind::Float), Cell::Float(9_223_372_036_854_775_808.0));
        for cell in ["9223372036854775809", "9007199254740993.01"] {
            assert_eq!(typed(cell.into(), Kind::Float), Cell::Unheld(cell.into()));
        }
        assert_eq!(typed("2.0".into(), Kind::Int), Cell::Int(2));
        assert_eq!(typed("-inf".into(), Kind::Float), Cell::Float(f64::NEG_INFINITY));
        for cell in ["NA", "007"] {
            assert_eq!(typed(cell.into(), Kind::Float), Cell::Text(cell.into()));
        }
    }
}

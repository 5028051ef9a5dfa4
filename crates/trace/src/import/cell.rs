//! Cells of CSV, and decimal numbers of tables: texts whose type follows from their column.
//!
//! Rule: an integer stays exact or stays text; an empty cell is null.

use super::line::{LineValue, whole};
use crate::schema::Kind;

/// The type of a cell by itself.
pub(super) fn kind_of(cell: &str) -> Kind {
    match cell {
        cell if cell.eq_ignore_ascii_case("true") || cell.eq_ignore_ascii_case("false") => Kind::Bool,
        cell if cell.parse().is_ok_and(|number: i64| number.to_string() == cell) => Kind::Int,
        cell if is_decimal(cell) || is_nan(cell) => Kind::Float,
        _ => Kind::String,
    }
}

/// The value of a cell in a column of this type; a text if the cell does not fit.
pub(super) fn typed(cell: &str, column: Kind) -> LineValue {
    let text = || LineValue::Text(cell.to_owned());
    match (column, kind_of(cell)) {
        (Kind::Bool, Kind::Bool) => LineValue::Bool(cell.eq_ignore_ascii_case("true")),
        (Kind::Int | Kind::Float, Kind::Int) => cell.parse().map_or_else(|_| text(), LineValue::Int),
        (Kind::Int | Kind::Float, Kind::Float) if is_nan(cell) => LineValue::Null,
        (Kind::Int, Kind::Float) => {
            let number = cell.parse().unwrap_or(f64::NAN);
            whole(number).map_or(LineValue::Float(number), LineValue::Int)
        }
        (Kind::Float, Kind::Float) => cell.parse().map_or_else(|_| text(), LineValue::Float),
        (Kind::Int | Kind::Float, _) => {
            let number = cell.parse().ok().filter(|number: &u64| number.to_string() == cell);
            number.map_or_else(text, LineValue::LargeInt)
        }
        _ => text(),
    }
}

/// The type that fits cells of both types.
pub(super) fn joined(before: Kind, now: Kind) -> Kind {
    match (before, now) {
        (before, now) if before == now => now,
        (Kind::Int | Kind::Float, Kind::Int | Kind::Float) => Kind::Float,
        _ => Kind::String,
    }
}

/// Returns true for numbers with a fraction or an exponent, but not for texts of digits such as `007`, nor for integers
/// that 64 bits do not hold.
fn is_decimal(cell: &str) -> bool {
    let digits = cell.trim_start_matches('-');
    let leads_with_zero = digits.len() > 1 && digits.starts_with('0') && digits.as_bytes()[1].is_ascii_digit();
    let is_integer = digits.len() > 1 && digits.bytes().all(|byte| byte.is_ascii_digit());
    let has_digit = cell.bytes().any(|byte| byte.is_ascii_digit());
    !leads_with_zero && !is_integer && has_digit && cell.parse().is_ok_and(f64::is_finite)
}

fn is_nan(cell: &str) -> bool {
    cell.eq_ignore_ascii_case("nan")
}

#[cfg(test)]
mod tests {
    use super::{LineValue, kind_of, typed};
    use crate::schema::Kind;

    #[test]
    fn integers_are_exact_or_texts() {
        for (cell, kind) in [
            ("9007199254740993", Kind::Int),
            ("9223372036854775808", Kind::String),
            ("-0", Kind::Float),
            ("007", Kind::String),
            ("1e3", Kind::Float),
            ("0e0", Kind::Float),
            (".5", Kind::Float),
            ("1e999", Kind::String),
            ("inf", Kind::String),
            ("NA", Kind::String),
            ("False", Kind::Bool),
        ] {
            assert_eq!(kind_of(cell), kind, "{cell}");
        }
        assert_eq!(typed("9007199254740993", Kind::Float), LineValue::Int(9_007_199_254_740_993));
        assert_eq!(typed("9223372036854775808", Kind::Float), LineValue::LargeInt(1 << 63));
        assert_eq!(typed("2.0", Kind::Int), LineValue::Int(2));
        assert_eq!(typed("nan", Kind::Float), LineValue::Null);
        for cell in ["NA", "007"] {
            assert_eq!(typed(cell, Kind::Float), LineValue::Text(cell.into()));
        }
    }
}

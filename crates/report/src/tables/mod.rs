//! The table model spelled out: one file per format.
//!
//! Rule: whatever stands in a table (names from traces, titles, a style's own words) is text, never markup. Each
//! format escapes it; the one exception is a style's `latex` header.

pub mod csv;
pub mod fit;
pub mod html;
pub mod latex;
pub mod markdown;
pub mod side_by_side;
pub mod terminal;

use super::table::{Cell, DAGGER, Emphasis, Value};

/// A cell in a markup whose words for bold and underlined text are pairs of marks; `undefined` is escaped already.
fn marked_up(cell: &Cell, undefined: &str, bold: [&str; 2], underline: [&str; 2]) -> String {
    let (estimate, detail) = cell.value.parts(undefined);
    let mark = if cell.is_marked { DAGGER.to_string() } else { String::new() };
    let is_whole = matches!(cell.value, Value::MeanSe { .. });
    let (inside, after) = match detail {
        Some(detail) if is_whole => (format!("{estimate} {detail}"), mark),
        Some(detail) => (estimate, format!("{mark} {detail}")),
        None => (estimate, mark),
    };
    let [before, behind] = match cell.emphasis {
        Emphasis::Plain => ["", ""],
        Emphasis::Bold => bold,
        Emphasis::Underline => underline,
    };
    format!("{before}{inside}{behind}{after}")
}

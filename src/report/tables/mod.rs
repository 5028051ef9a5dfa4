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

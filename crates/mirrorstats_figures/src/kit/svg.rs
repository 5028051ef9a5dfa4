//! Numbers and texts of SVG elements.
//!
//! A position is a whole number of units, [`UNITS_PER_PX`] to a px, so that the last bits of floats never show.

use std::fmt::Write as _;

use super::sheet::Point;

const UNITS_PER_PX: f64 = 100.0;

#[expect(clippy::cast_possible_truncation, reason = "`as` clamps, and sheets are small")]
pub(super) fn units(px: f64) -> i32 {
    (px * UNITS_PER_PX).round() as i32
}

pub(super) fn px(units: impl Into<f64>) -> f64 {
    units.into() / UNITS_PER_PX
}

/// A point in units; the sheet begins at its top left corner.
pub(super) fn corner((x, y): Point) -> (i32, i32) {
    (units(x).max(0), units(y).max(0))
}

pub(super) fn path(points: &[Point]) -> String {
    let mut path = String::new();
    for (at, point) in points.iter().enumerate() {
        let verb = if at == 0 { 'M' } else { 'L' };
        let (x, y) = corner(*point);
        let _ = write!(path, "{verb}{} {}", px(x), px(y));
    }
    path
}

/// Text escaped for XML, in an element or between double quotes; characters that XML forbids become U+FFFD.
pub(crate) fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            '\t' | '\n' | '\r' => {
                let _ = write!(escaped, "&#{};", u32::from(c));
            }
            '\u{0}'..='\u{1f}' | '\u{7f}'..='\u{9f}' | '\u{fffe}' | '\u{ffff}' => escaped.push('\u{fffd}'),
            c => escaped.push(c),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::escaped;

    #[test]
    fn markup_is_text_and_forbidden_characters_are_gone() {
        assert_eq!(
            escaped("</text><script a=\"b\" c='d'>&"),
            "&lt;/text&gt;&lt;script a=&quot;b&quot; c=&#39;d&#39;&gt;&amp;"
        );
        assert_eq!(escaped("a\u{0}b\u{1b}c\u{ffff}\n"), "a\u{fffd}b\u{fffd}c\u{fffd}&#10;");
    }
}

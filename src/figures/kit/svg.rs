//! Parts of SVG as text: coordinates, paths, attributes, escaped texts.
//!
//! Coordinates are rounded to a hundredth of a px: finer than any eye, and the same bytes on every machine.

use std::fmt::Write as _;

use super::frame::Point;
use super::ink::{Fill, Stroke};

/// Steps of a coordinate in a px.
const STEPS_PER_PX: f64 = 100.0;

/// A length in px, rounded.
pub fn px(length: f64) -> f64 {
    // Adding zero takes the sign off a negative zero.
    (length * STEPS_PER_PX).round() / STEPS_PER_PX + 0.0
}

/// The difference of two rounded coordinates, px.
pub fn between(from: f64, to: f64) -> f64 {
    ((to * STEPS_PER_PX).round() - (from * STEPS_PER_PX).round()) / STEPS_PER_PX + 0.0
}

/// The `d` of a path through `points`.
pub fn path(points: &[Point]) -> String {
    points.iter().enumerate().fold(String::new(), |mut path, (at, &(x, y))| {
        let verb = if at == 0 { 'M' } else { 'L' };
        let _ = write!(path, "{verb}{} {}", px(x), px(y));
        path
    })
}

/// The attributes of a line, with a space before each.
pub fn stroke(stroke: Stroke) -> String {
    format!(" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\"{}", stroke.color, px(stroke.width), dash(stroke))
}

/// The attributes of an area, with a space before each.
pub fn fill(fill: Fill) -> String {
    let mut attributes = format!(" fill=\"{}\"", fill.color);
    if fill.opacity < 1.0 {
        let _ = write!(attributes, " fill-opacity=\"{}\"", fill.opacity);
    }
    if let Some(stroke) = fill.outline {
        let _ = write!(attributes, " stroke=\"{}\" stroke-width=\"{}\"{}", stroke.color, stroke.width, dash(stroke));
    }
    attributes
}

fn dash(stroke: Stroke) -> String {
    let lengths: Vec<_> = stroke.dash.iter().map(f64::to_string).collect();
    if lengths.is_empty() { String::new() } else { format!(" stroke-dasharray=\"{}\"", lengths.join(" ")) }
}

/// Text as XML takes it, in an element or between double quotes; characters that XML forbids become U+FFFD.
pub fn escaped(text: &str) -> String {
    text.chars().fold(String::with_capacity(text.len()), |mut out, c| {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            '\t' | '\n' | '\r' => {
                let _ = write!(out, "&#{};", u32::from(c));
            }
            '\u{0}'..='\u{1f}' | '\u{7f}'..='\u{9f}' | '\u{fffe}' | '\u{ffff}' => out.push('\u{fffd}'),
            c => out.push(c),
        }
        out
    })
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

//! The drawing backend for plotters: writes SVG elements.
//!
//! plotters draws on integers. One px is [`UNITS_PER_PX`] of them, so that marks have exact positions and the last bits
//! of floats never show.

use std::fmt::{self, Write as _};

use plotters::prelude::{DrawingBackend, FontTransform};
use plotters::style::text_anchor::HPos;
use plotters_backend::{BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingErrorKind, FontStyle};

use super::sheet::{Point, Rgb};

const UNITS_PER_PX: f64 = 100.0;
/// More room than any figure needs; plotters clamps everything outside.
const ROOM: u32 = 10_000_000;

type DrawResult = Result<(), DrawingErrorKind<fmt::Error>>;

#[derive(Debug, Default)]
pub(super) struct SvgBackend {
    /// The elements so far.
    pub body: String,
    /// Attributes of the next shape that plotters lacks (a dash, an outline around a fill), each with a leading space.
    pub extra: String,
}

#[expect(clippy::cast_possible_truncation, reason = "`as` clamps, and sheets are small")]
pub(super) fn units((x, y): Point) -> BackendCoord {
    let place = |px: f64| (px * UNITS_PER_PX).round() as i32;
    (place(x), place(y))
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` clamps, and sizes are small")]
pub(super) fn size_units(px: f64) -> u32 {
    (px * UNITS_PER_PX).round() as u32
}

pub(super) fn px(units: impl Into<f64>) -> f64 {
    units.into() / UNITS_PER_PX
}

impl SvgBackend {
    fn shape(&mut self, element: fmt::Arguments<'_>, paint: &str) -> DrawResult {
        writeln!(self.body, "<{element}{paint}{}/>", self.extra).map_err(DrawingErrorKind::DrawingError)
    }
}

impl DrawingBackend for SvgBackend {
    type ErrorType = fmt::Error;

    fn get_size(&self) -> (u32, u32) {
        (ROOM, ROOM)
    }

    fn ensure_prepared(&mut self) -> DrawResult {
        Ok(())
    }

    fn present(&mut self) -> DrawResult {
        Ok(())
    }

    fn draw_pixel(&mut self, (x, y): BackendCoord, color: BackendColor) -> DrawResult {
        self.draw_rect((x, y), (x + 1, y + 1), &color, true)
    }

    fn draw_rect<S: BackendStyle>(
        &mut self,
        (left, top): BackendCoord,
        (right, bottom): BackendCoord,
        style: &S,
        filled: bool,
    ) -> DrawResult {
        let [x, y, width, height] = [left, top, right - left, bottom - top].map(px);
        let element = format_args!("rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"");
        self.shape(element, &either(style, filled))
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(&mut self, points: I, style: &S) -> DrawResult {
        self.shape(format_args!("path d=\"{}\"", path(points)), &stroke(style))
    }

    fn draw_circle<S: BackendStyle>(
        &mut self,
        (x, y): BackendCoord,
        radius: u32,
        style: &S,
        filled: bool,
    ) -> DrawResult {
        let ([x, y], radius) = ([x, y].map(px), px(radius));
        self.shape(format_args!("circle cx=\"{x}\" cy=\"{y}\" r=\"{radius}\""), &either(style, filled))
    }

    fn fill_polygon<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        corners: I,
        style: &S,
    ) -> DrawResult {
        self.shape(format_args!("path d=\"{}Z\"", path(corners)), &paint("fill", style.color()))
    }

    /// `(x, y)` is the start, middle or end of the text's baseline, depending on the anchor of `style`.
    fn draw_text<T: BackendTextStyle>(&mut self, text: &str, style: &T, (x, y): BackendCoord) -> DrawResult {
        let ([x, y], size) = ([x, y].map(px), px(style.size()));
        let anchor = match style.anchor().h_pos {
            HPos::Left => "",
            HPos::Center => " text-anchor=\"middle\"",
            HPos::Right => " text-anchor=\"end\"",
        };
        let bold = matches!(style.style(), FontStyle::Bold);
        let weight = if bold { " font-weight=\"600\"" } else { "" };
        let upwards = matches!(style.transform(), FontTransform::Rotate270);
        let turn = if upwards { format!(" transform=\"rotate(-90 {x} {y})\"") } else { String::new() };
        let (paint, text) = (paint("fill", style.color()), escaped(text));
        writeln!(self.body, "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\"{weight}{anchor}{turn}{paint}>{text}</text>")
            .map_err(DrawingErrorKind::DrawingError)
    }
}

fn path(points: impl IntoIterator<Item = BackendCoord>) -> String {
    let mut path = String::new();
    for (at, (x, y)) in points.into_iter().enumerate() {
        let verb = if at == 0 { 'M' } else { 'L' };
        let _ = write!(path, "{verb}{} {}", px(x), px(y));
    }
    path
}

fn either<S: BackendStyle>(style: &S, filled: bool) -> String {
    if filled { paint("fill", style.color()) } else { stroke(style) }
}

fn stroke<S: BackendStyle>(style: &S) -> String {
    format!(" fill=\"none\"{} stroke-width=\"{}\"", paint("stroke", style.color()), px(style.stroke_width()))
}

fn paint(attribute: &str, BackendColor { rgb: (red, green, blue), alpha }: BackendColor) -> String {
    let opacity = if alpha < 1.0 { format!(" {attribute}-opacity=\"{alpha}\"") } else { String::new() };
    format!(" {attribute}=\"{}\"{opacity}", Rgb(red, green, blue))
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

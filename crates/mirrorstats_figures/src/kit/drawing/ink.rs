//! The drawing backend for `plotters`: writes SVG elements with a resolution of a hundredth of a px.
//!
//! plotters draws on integers; one px is [`UNITS_PER_PX`] of them, so that marks have exact positions. Features that
//! plotters lacks (a dash, an outline around a fill, a group with a title) are set beside it.

use std::convert::Infallible;
use std::fmt::Write as _;

use plotters::prelude::{DrawingBackend, FontTransform};
use plotters::style::text_anchor::HPos;
use plotters_backend::{BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingErrorKind, FontStyle};

use crate::kit::look::Rgb;

/// Integer units of plotters per px of the figure.
pub(crate) const UNITS_PER_PX: f64 = 100.0;
/// More room than any figure needs; plotters clamps everything outside.
const ROOM: u32 = 10_000_000;

type DrawResult = Result<(), DrawingErrorKind<Infallible>>;

#[derive(Debug, Default)]
pub(crate) struct Ink {
    pub body: String,
    /// Attributes of the next shapes that plotters does not support, each with a leading space.
    pub extra: String,
}

impl Ink {
    fn element(&mut self, element: &str, paint: &str) {
        let _ = writeln!(self.body, "<{element}{paint}{}/>", self.extra);
    }

    /// Horizontal bars of one height and colour as one stroke: pairs of left and right ends, ascending, at height `y`.
    pub(crate) fn bars(&mut self, ends: &[(i32, i32)], y: i32, height: u32, color: Rgb) {
        let mut path = String::new();
        let mut at = None;
        for &(left, right) in ends {
            let _ = match at {
                None => write!(path, "M{} {}", px(left), px(y)),
                Some(at) => write!(path, "m{} 0", px(left - at)),
            };
            let _ = write!(path, "h{}", px(right - left));
            at = Some(right);
        }
        if at.is_some() {
            let width = f64::from(height) / UNITS_PER_PX;
            let _ = writeln!(self.body, "<path d=\"{path}\" stroke=\"{color}\" stroke-width=\"{width}\"/>");
        }
    }
}

fn path(points: impl IntoIterator<Item = BackendCoord>) -> String {
    points.into_iter().enumerate().fold(String::new(), |mut path, (at, (x, y))| {
        let verb = if at == 0 { 'M' } else { 'L' };
        let _ = write!(path, "{verb}{} {}", px(x), px(y));
        path
    })
}

/// Lattice units as px, without trailing zeros.
fn px(units: i32) -> String {
    (f64::from(units) / UNITS_PER_PX + 0.0).to_string()
}

fn paint(attribute: &str, color: BackendColor) -> String {
    let (red, green, blue) = color.rgb;
    let mut text = format!(" {attribute}=\"{}\"", Rgb(red, green, blue));
    if color.alpha < 1.0 {
        let _ = write!(text, " {attribute}-opacity=\"{}\"", color.alpha);
    }
    text
}

fn stroke<S: BackendStyle>(style: &S) -> String {
    let width = f64::from(style.stroke_width()) / UNITS_PER_PX;
    format!(" fill=\"none\"{} stroke-width=\"{width}\"", paint("stroke", style.color()))
}

fn either<S: BackendStyle>(style: &S, filled: bool) -> String {
    if filled { paint("fill", style.color()) } else { stroke(style) }
}

impl DrawingBackend for Ink {
    type ErrorType = Infallible;

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
        let element = format!("rect x=\"{}\" y=\"{}\" width=\"1\" height=\"1\"", px(x), px(y));
        self.element(&element, &paint("fill", color));
        Ok(())
    }

    fn draw_rect<S: BackendStyle>(
        &mut self,
        from: BackendCoord,
        to: BackendCoord,
        style: &S,
        filled: bool,
    ) -> DrawResult {
        let (width, height) = (px(to.0 - from.0), px(to.1 - from.1));
        let element = format!("rect x=\"{}\" y=\"{}\" width=\"{width}\" height=\"{height}\"", px(from.0), px(from.1));
        self.element(&element, &either(style, filled));
        Ok(())
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(&mut self, points: I, style: &S) -> DrawResult {
        let element = format!("path d=\"{}\"", path(points));
        self.element(&element, &stroke(style));
        Ok(())
    }

    fn draw_circle<S: BackendStyle>(
        &mut self,
        (x, y): BackendCoord,
        radius: u32,
        style: &S,
        filled: bool,
    ) -> DrawResult {
        let radius = f64::from(radius) / UNITS_PER_PX;
        let element = format!("circle cx=\"{}\" cy=\"{}\" r=\"{radius}\"", px(x), px(y));
        self.element(&element, &either(style, filled));
        Ok(())
    }

    fn fill_polygon<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        corners: I,
        style: &S,
    ) -> DrawResult {
        let element = format!("path d=\"{}Z\"", path(corners));
        self.element(&element, &paint("fill", style.color()));
        Ok(())
    }

    /// `pos` is the start, middle or end of the text's baseline, depending on the anchor of `style`.
    fn draw_text<T: BackendTextStyle>(&mut self, text: &str, style: &T, (x, y): BackendCoord) -> DrawResult {
        let (x, y) = (px(x), px(y));
        let anchor = match style.anchor().h_pos {
            HPos::Left => "",
            HPos::Center => " text-anchor=\"middle\"",
            HPos::Right => " text-anchor=\"end\"",
        };
        let weight = match style.style() {
            FontStyle::Bold => " font-weight=\"600\"",
            FontStyle::Normal | FontStyle::Oblique | FontStyle::Italic => "",
        };
        let turn = match style.transform() {
            FontTransform::Rotate270 => format!(" transform=\"rotate(-90 {x} {y})\""),
            FontTransform::None | FontTransform::Rotate90 | FontTransform::Rotate180 => String::new(),
        };
        let size = style.size() / UNITS_PER_PX;
        let paint = paint("fill", style.color());
        let text = escaped(text);
        let _ = writeln!(
            self.body,
            "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\"{weight}{anchor}{turn}{paint}>{text}</text>"
        );
        Ok(())
    }
}

/// Text escaped for XML, in an element or between double quotes; characters that XML forbids become U+FFFD.
pub(crate) fn escaped(text: &str) -> String {
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

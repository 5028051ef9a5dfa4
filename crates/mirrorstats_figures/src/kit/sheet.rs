//! The sheet for drawing a figure: SVG elements at positions in px, and groups that carry values.
//!
//! Rule: positions and sizes are whole hundredths of a px, so that no text depends on the last bits of a float.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::font::{self, Weight};
use super::frame::{Frame, Point};
use super::lettering::{Lettering, TextAnchor};
use super::look::{Fill, Rgb, Stroke};
use super::mark::Mark;
use mirrorstats_exact::format::fixed;

pub(super) const HUNDREDTHS: f64 = 100.0;
/// The largest position, in hundredths of a px: more room than any figure needs.
const ROOM: i32 = 10_000_000;

/// A figure in progress. Elements below its final height must not be drawn.
#[derive(Debug)]
pub struct Sheet {
    body: String,
    width: f64,
}

impl Sheet {
    pub fn new(width: f64) -> Self {
        Self { body: String::new(), width }
    }

    pub const fn width(&self) -> f64 {
        self.width
    }

    pub fn line(&mut self, points: &[Point], stroke: Stroke) {
        let (path, dash, width) = (path(points), dash(stroke), length(stroke.width));
        self.element(&format!(
            "path d=\"{path}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{width}\"{dash}",
            stroke.color
        ));
    }

    pub(crate) fn polygon(&mut self, corners: &[Point], fill: Fill) {
        self.element(&format!("path d=\"{}Z\"{}", path(corners), paint(fill)));
    }

    pub fn rectangle(&mut self, frame: Frame, fill: Fill) {
        let (from, to) = (place((frame.left, frame.top)), place((frame.right(), frame.bottom())));
        let [x, y] = [from.0.min(to.0), from.1.min(to.1)].map(px);
        let [width, height] = [(to.0 - from.0).abs(), (to.1 - from.1).abs()].map(px);
        self.element(&format!("rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"{}", paint(fill)));
    }

    /// Draws filled rectangles side by side, with the same top and height: pairs of left and right ends, ascending.
    /// As one path, many of them take little space in the file.
    pub(crate) fn bars(&mut self, ends: &[(f64, f64)], top: f64, height: f64, color: Rgb) {
        let mut path = String::new();
        let mut at = None;
        for &(left, right) in ends {
            let (left, right) = (hundredths(left), hundredths(right));
            let _ = match at {
                None => write!(path, "M{} {}", px(left), px(hundredths(top + height / 2.0))),
                Some(at) => write!(path, "m{} 0", px(left - at)),
            };
            let _ = write!(path, "h{}", px(right - left));
            at = Some(right);
        }
        if at.is_some() {
            self.element(&format!("path d=\"{path}\" stroke=\"{color}\" stroke-width=\"{}\"", length(height)));
        }
    }

    pub(crate) fn circle(&mut self, center: Point, radius: f64, fill: Fill) {
        let (x, y) = shown(center);
        self.element(&format!("circle cx=\"{x}\" cy=\"{y}\" r=\"{}\"{}", length(radius), paint(fill)));
    }

    /// Draws one line of text, with the middle of its capitals at the height of `at`.
    pub fn text(&mut self, at: Point, text: &str, lettering: Lettering) {
        let Lettering { size, color, .. } = lettering;
        let drop = font::drop_to_baseline(size);
        let (x, y) = shown(if lettering.upwards { (at.0 + drop, at.1) } else { (at.0, at.1 + drop) });
        let weight = if lettering.weight == Weight::Semibold { " font-weight=\"600\"" } else { "" };
        let anchor = match lettering.align {
            TextAnchor::Start => "",
            TextAnchor::Middle => " text-anchor=\"middle\"",
            TextAnchor::End => " text-anchor=\"end\"",
        };
        let turn = if lettering.upwards { format!(" transform=\"rotate(-90 {x} {y})\"") } else { String::new() };
        let text = escaped(&font::drawable(text));
        let _ = writeln!(
            self.body,
            "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\"{weight}{anchor}{turn} fill=\"{color}\">{text}</text>"
        );
    }

    pub(crate) fn picture(&mut self, frame: Frame, png: &[u8]) {
        let [left, top, width, height] =
            [frame.left, frame.top, frame.width, frame.height].map(|length| fixed(Some(length), 2));
        self.element(&format!(
            "image x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\" \
             preserveAspectRatio=\"none\" href=\"data:image/png;base64,{}\"",
            STANDARD.encode(png)
        ));
    }

    pub fn mark(&mut self, mark: &Mark, draw: impl FnOnce(&mut Self)) {
        self.body += &mark.opening();
        draw(self);
        self.body += "</g>\n";
    }

    /// The elements that were drawn, as SVG.
    pub(crate) fn into_body(self) -> String {
        self.body
    }

    fn element(&mut self, element: &str) {
        let _ = writeln!(self.body, "<{element}/>");
    }
}

#[expect(clippy::cast_possible_truncation, reason = "`as` clamps, and sheets are small")]
pub(super) fn hundredths(px: f64) -> i32 {
    (px * HUNDREDTHS).round() as i32
}

/// Hundredths of a px as px, without trailing zeros.
fn px(hundredths: i32) -> String {
    (f64::from(hundredths) / HUNDREDTHS + 0.0).to_string()
}

fn length(px: f64) -> f64 {
    f64::from(hundredths(px).max(0)) / HUNDREDTHS
}

fn place((x, y): Point) -> (i32, i32) {
    (hundredths(x).clamp(0, ROOM), hundredths(y).clamp(0, ROOM))
}

fn shown(point: Point) -> (String, String) {
    let (x, y) = place(point);
    (px(x), px(y))
}

fn path(points: &[Point]) -> String {
    points.iter().enumerate().fold(String::new(), |mut path, (at, &point)| {
        let ((x, y), verb) = (shown(point), if at == 0 { 'M' } else { 'L' });
        let _ = write!(path, "{verb}{x} {y}");
        path
    })
}

fn paint(fill: Fill) -> String {
    let mut text = format!(" fill=\"{}\"", fill.color);
    if fill.opacity < 1.0 {
        let _ = write!(text, " fill-opacity=\"{}\"", fill.opacity);
    }
    if let Some(stroke) = fill.outline {
        let _ = write!(text, " stroke=\"{}\" stroke-width=\"{}\"{}", stroke.color, stroke.width, dash(stroke));
    }
    text
}

fn dash(stroke: Stroke) -> String {
    let lengths: Vec<_> = stroke.dash.iter().map(f64::to_string).collect();
    if lengths.is_empty() { String::new() } else { format!(" stroke-dasharray=\"{}\"", lengths.join(" ")) }
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
    use super::{Fill, Frame, Lettering, Rgb, Sheet, Stroke, TextAnchor, escaped};
    use crate::kit::mark::Mark;
    use crate::kit::picture::Figure;

    #[test]
    fn a_small_drawing_is_this_text() {
        let (black, red) = (Rgb(0, 0, 0), Rgb(200, 16, 46));
        let mut sheet = Sheet::new(40.0);
        let dashed = Stroke { color: black, width: 1.5, dash: &[2.0, 1.0] };
        sheet.line(&[(1.0, 2.0), (3.25, 4.5)], dashed);
        sheet.mark(&Mark::new("a < b").with("model", "\"x\"").value(Some(1.0 / 3.0)), |sheet| {
            sheet.circle(
                (10.0, 10.0),
                2.5,
                Fill { color: red, opacity: 0.5, outline: Some(Stroke::solid(black, 0.5)) },
            );
            sheet.rectangle(Frame::new(0.0, 0.0, 4.0, 3.0), Fill::plain(red));
        });
        sheet.text((20.0, 10.0), "T & A", Lettering::new(10.0, black).semibold().aligned(TextAnchor::Middle));
        insta::assert_snapshot!(Figure::new(sheet, 20.0, "Title", "What it is.").inline_svg());
    }

    #[test]
    fn markup_is_text_and_forbidden_characters_are_gone() {
        assert_eq!(
            escaped("</text><script a=\"b\" c='d'>&"),
            "&lt;/text&gt;&lt;script a=&quot;b&quot; c=&#39;d&#39;&gt;&amp;"
        );
        assert_eq!(escaped("a\u{0}b\u{1b}c\u{ffff}\n"), "a\u{fffd}b\u{fffd}c\u{fffd}&#10;");
    }
}

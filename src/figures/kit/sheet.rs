//! The sheet a figure is drawn on: a few verbs in px that write SVG elements, and groups that carry values.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::font::{self, Weight};
use super::frame::{Frame, Point};
use super::ink::{Fill, Rgb, Stroke};
use super::lettering::{Align, Lettering};
use super::mark::Mark;
use super::svg::{self, escaped, px};
use crate::base::format::fixed;

/// A figure in the making. What lies further down than its final height must not be drawn.
#[derive(Debug)]
pub struct Sheet {
    body: String,
    width: f64,
}

impl Sheet {
    /// An empty sheet, `width` px wide.
    pub const fn new(width: f64) -> Self {
        Self { body: String::new(), width }
    }

    /// The sheet's width, px.
    pub const fn width(&self) -> f64 {
        self.width
    }

    /// A line through these points.
    pub fn line(&mut self, points: &[Point], stroke: Stroke) {
        let _ = writeln!(self.body, "<path d=\"{}\"{}/>", svg::path(points), svg::stroke(stroke));
    }

    /// A filled polygon.
    pub fn polygon(&mut self, corners: &[Point], fill: Fill) {
        let _ = writeln!(self.body, "<path d=\"{}Z\"{}/>", svg::path(corners), svg::fill(fill));
    }

    /// A filled rectangle.
    pub fn rectangle(&mut self, frame: Frame, fill: Fill) {
        let [x, y] = [frame.left, frame.top].map(px);
        let [width, height] = [svg::between(frame.left, frame.right()), svg::between(frame.top, frame.bottom())];
        let paint = svg::fill(fill);
        let _ = writeln!(self.body, "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"{paint}/>");
    }

    /// Filled rectangles side by side, from the same top and of the same height: pairs of left and right ends,
    /// ascending. Many of them take little room in the file.
    pub fn bars(&mut self, ends: &[(f64, f64)], top: f64, height: f64, color: Rgb) {
        let Some(&(first, _)) = ends.first() else { return };
        let mut path = format!("M{} {}", px(first), px(top + height / 2.0));
        let mut at = first;
        for (index, &(left, right)) in ends.iter().enumerate() {
            if index > 0 {
                let _ = write!(path, "m{} 0", svg::between(at, left));
            }
            let _ = write!(path, "h{}", svg::between(left, right));
            at = right;
        }
        let _ = writeln!(self.body, "<path d=\"{path}\" stroke=\"{color}\" stroke-width=\"{}\"/>", px(height));
    }

    /// A filled circle.
    pub fn circle(&mut self, (x, y): Point, radius: f64, fill: Fill) {
        let (x, y, radius, paint) = (px(x), px(y), px(radius), svg::fill(fill));
        let _ = writeln!(self.body, "<circle cx=\"{x}\" cy=\"{y}\" r=\"{radius}\"{paint}/>");
    }

    /// One line of text, the middle of its capitals at the height of `at`.
    pub fn text(&mut self, at: Point, text: &str, lettering: Lettering) {
        let drop = font::drop_to_baseline(lettering.size);
        let (x, y) = if lettering.upwards { (at.0 + drop, at.1) } else { (at.0, at.1 + drop) };
        let (x, y) = (px(x), px(y));
        let weight = match lettering.weight {
            Weight::Regular => "",
            Weight::Semibold => " font-weight=\"600\"",
        };
        let anchor = match lettering.align {
            Align::Start => "",
            Align::Middle => " text-anchor=\"middle\"",
            Align::End => " text-anchor=\"end\"",
        };
        let turn = if lettering.upwards { format!(" transform=\"rotate(-90 {x} {y})\"") } else { String::new() };
        let (size, color, text) = (lettering.size, lettering.color, escaped(&font::drawable(text)));
        let _ = writeln!(
            self.body,
            "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\"{weight}{anchor}{turn} fill=\"{color}\">{text}</text>"
        );
    }

    /// A picture that fills a frame; it is carried along in the file.
    pub fn picture(&mut self, frame: Frame, png: &[u8]) {
        let [left, top, width, height] =
            [frame.left, frame.top, frame.width, frame.height].map(|length| fixed(Some(length), 2));
        let _ = writeln!(
            self.body,
            "<image x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\" \
             preserveAspectRatio=\"none\" href=\"data:image/png;base64,{}\"/>",
            STANDARD.encode(png)
        );
    }

    /// What `draw` draws, as one group that carries the mark's title and values.
    pub fn mark(&mut self, mark: &Mark, draw: impl FnOnce(&mut Self)) {
        self.body.push_str(&mark.opening());
        draw(self);
        self.body.push_str("</g>\n");
    }

    /// The SVG, cut at `height`; `title` and `description` are for those who do not see it.
    pub fn finish(self, height: f64, title: &str, description: &str) -> Drawing {
        Drawing {
            width: self.width.ceil(),
            height: height.ceil(),
            title: title.into(),
            description: description.into(),
            body: self.body,
        }
    }
}

/// A finished drawing, not yet a document.
#[derive(Clone, Debug)]
pub struct Drawing {
    width: f64,
    height: f64,
    title: String,
    description: String,
    body: String,
}

impl Drawing {
    /// The SVG to set into another document, which brings the font along.
    pub fn inline(&self) -> String {
        self.element("")
    }

    /// The SVG as a document of its own, with a title and `style` as its style sheet.
    pub fn document(&self, style: &str) -> String {
        self.element(&format!("<title>{}</title>\n<style>{style}</style>\n", escaped(&self.title)))
    }

    fn element(&self, head: &str) -> String {
        let Self { width, height, .. } = self;
        let (title, description) = (escaped(&self.title), escaped(&self.description));
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{title}\" \
             font-family=\"'{}', sans-serif\" stroke-linejoin=\"round\">\n\
             {head}<desc>{description}</desc>\n",
            font::FAMILY
        );
        let _ = writeln!(svg, "<rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>");
        svg.push_str(&self.body);
        svg.push_str("</svg>\n");
        svg
    }
}

#[cfg(test)]
mod tests {
    use super::{Align, Fill, Frame, Lettering, Rgb, Sheet, Stroke};
    use crate::figures::kit::mark::Mark;

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
        sheet.text((20.0, 10.0), "T & A", Lettering::new(10.0, black).semibold().aligned(Align::Middle));
        insta::assert_snapshot!(sheet.finish(20.0, "Title", "What it is.").inline());
    }
}

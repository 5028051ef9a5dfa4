//! The sheet for drawing a figure: a few functions in px over plotters' elements, and groups that carry values.

use std::cell::RefCell;
use std::fmt::Write as _;
use std::rc::Rc;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use plotters::coord::Shift;
use plotters::drawing::DrawingArea;
use plotters::element::{Circle, Drawable, PathElement, PointCollection, Polygon, Rectangle, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color as _, FontDesc, FontFamily, FontStyle, FontTransform, RGBColor, ShapeStyle, TextStyle};
use plotters_backend::BackendCoord;

use super::font::{self, Weight};
use super::frame::{Frame, Point};
use super::ink::{Ink, UNITS_PER_PX};
use super::lettering::{Lettering, TextAnchor};
use super::look::{Fill, Rgb, Stroke};
use super::mark::Mark;
use mirrorstats_exact::format::fixed;

/// A figure in progress. Elements below its final height must not be drawn.
#[derive(Debug)]
pub struct Sheet {
    ink: Rc<RefCell<Ink>>,
    width: f64,
}

impl Sheet {
    pub fn new(width: f64) -> Self {
        Self { ink: Rc::default(), width }
    }

    pub const fn width(&self) -> f64 {
        self.width
    }

    pub fn line(&mut self, points: &[Point], stroke: Stroke) {
        let points: Vec<_> = points.iter().map(|&at| lattice(at)).collect();
        let style =
            ShapeStyle { color: RGBColor::from(stroke.color).into(), filled: false, stroke_width: units(stroke.width) };
        self.put(&PathElement::new(points, style), dash_attribute(stroke));
    }

    pub(crate) fn polygon(&mut self, corners: &[Point], fill: Fill) {
        let corners: Vec<_> = corners.iter().map(|&at| lattice(at)).collect();
        self.put(&Polygon::new(corners, shape(fill)), outline_attributes(fill));
    }

    pub fn rectangle(&mut self, frame: Frame, fill: Fill) {
        let corners = [lattice((frame.left, frame.top)), lattice((frame.right(), frame.bottom()))];
        self.put(&Rectangle::new(corners, shape(fill)), outline_attributes(fill));
    }

    /// Draws filled rectangles side by side, with the same top and height: pairs of left and right ends, ascending.
    /// Many of them take little space in the file.
    pub(crate) fn bars(&mut self, ends: &[(f64, f64)], top: f64, height: f64, color: Rgb) {
        let ends: Vec<_> =
            ends.iter().map(|&(left, right)| (lattice((left, top)).0, lattice((right, top)).0)).collect();
        let middle = lattice((0.0, top + height / 2.0)).1;
        self.ink.borrow_mut().bars(&ends, middle, units(height), color);
    }

    pub(crate) fn circle(&mut self, center: Point, radius: f64, fill: Fill) {
        self.put(&Circle::new(lattice(center), units(radius), shape(fill)), outline_attributes(fill));
    }

    /// Draws one line of text, with the middle of its capitals at the height of `at`.
    pub fn text(&mut self, at: Point, text: &str, lettering: Lettering) {
        let drop = font::drop_to_baseline(lettering.size);
        let at = if lettering.upwards { (at.0 + drop, at.1) } else { (at.0, at.1 + drop) };
        let style = text_style(lettering);
        self.put(&Text::new(font::drawable(text), lattice(at), style), String::new());
    }

    pub(crate) fn picture(&mut self, frame: Frame, png: &[u8]) {
        let [left, top, width, height] =
            [frame.left, frame.top, frame.width, frame.height].map(|length| fixed(Some(length), 2));
        let _ = writeln!(
            self.ink.borrow_mut().body,
            "<image x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\" \
             preserveAspectRatio=\"none\" href=\"data:image/png;base64,{}\"/>",
            STANDARD.encode(png)
        );
    }

    pub fn mark(&mut self, mark: &Mark, draw: impl FnOnce(&mut Self)) {
        self.ink.borrow_mut().body.push_str(&mark.opening());
        draw(self);
        self.ink.borrow_mut().body.push_str("</g>\n");
    }

    /// The elements that were drawn, as SVG.
    pub(crate) fn into_body(self) -> String {
        self.ink.take().body
    }

    fn put<E>(&mut self, element: &E, extra: String)
    where
        for<'a> &'a E: PointCollection<'a, BackendCoord>,
        E: Drawable<Ink>,
    {
        self.ink.borrow_mut().extra = extra;
        let area: DrawingArea<Ink, Shift> = (&self.ink).into();
        area.draw(element).expect("writing to a string does not fail, and nobody else holds the ink");
    }
}

#[expect(clippy::cast_possible_truncation, reason = "`as` clamps, and sheets are small")]
pub(super) fn lattice((x, y): Point) -> BackendCoord {
    let place = |px: f64| (px * UNITS_PER_PX).round() as i32;
    (place(x), place(y))
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` clamps, and sizes are small")]
fn units(px: f64) -> u32 {
    (px * UNITS_PER_PX).round() as u32
}

fn shape(fill: Fill) -> ShapeStyle {
    ShapeStyle { color: RGBColor::from(fill.color).mix(fill.opacity), filled: true, stroke_width: 0 }
}

fn text_style(lettering: Lettering) -> TextStyle<'static> {
    let style = match lettering.weight {
        Weight::Regular => FontStyle::Normal,
        Weight::Semibold => FontStyle::Bold,
    };
    let turn = if lettering.upwards { FontTransform::Rotate270 } else { FontTransform::None };
    let font = FontDesc::new(FontFamily::Name(font::FAMILY), lettering.size * UNITS_PER_PX, style).transform(turn);
    let h_pos = match lettering.align {
        TextAnchor::Start => HPos::Left,
        TextAnchor::Middle => HPos::Center,
        TextAnchor::End => HPos::Right,
    };
    let color = RGBColor::from(lettering.color).to_backend_color();
    TextStyle { font, color, pos: Pos::new(h_pos, VPos::Center) }
}

fn dash_attribute(stroke: Stroke) -> String {
    let lengths: Vec<_> = stroke.dash.iter().map(f64::to_string).collect();
    if lengths.is_empty() { String::new() } else { format!(" stroke-dasharray=\"{}\"", lengths.join(" ")) }
}

fn outline_attributes(fill: Fill) -> String {
    let Some(stroke) = fill.outline else { return String::new() };
    let dash = dash_attribute(stroke);
    format!(" stroke=\"{}\" stroke-width=\"{}\"{dash}", stroke.color, stroke.width)
}

#[cfg(test)]
mod tests {
    use super::{Fill, Frame, Lettering, Rgb, Sheet, Stroke, TextAnchor};
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
}

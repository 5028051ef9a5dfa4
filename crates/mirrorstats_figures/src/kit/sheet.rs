//! The sheet of a figure: plotters' elements in px from the top left corner, and groups that carry values.

use std::borrow::Cow;
use std::cell::RefCell;
use std::fmt::{self, Write as _};
use std::rc::Rc;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use plotters::coord::Shift;
use plotters::drawing::DrawingArea;
use plotters::element::{Circle, Drawable, PathElement, PointCollection, Polygon, Rectangle, Text};
use plotters::style::{Color, ShapeStyle};
use plotters_backend::{BackendColor, BackendCoord};
use serde::Deserialize;

use super::lettering::{self, Lettering};
use super::svg::{SvgBackend, escaped, px, size_units, units};
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::format::fixed;
use mirrorstats_exact::number::full_precision;
use mirrorstats_statistics::intervals::interval::Interval;

/// A point: right, down.
pub type Point = (f64, f64);

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Frame {
    pub left: f64,
    pub top: f64,
    pub width: f64,
    pub height: f64,
}

impl Frame {
    pub const fn new(left: f64, top: f64, width: f64, height: f64) -> Self {
        Self { left, top, width, height }
    }

    pub fn right(self) -> f64 {
        self.left + self.width
    }

    pub fn bottom(self) -> f64 {
        self.top + self.height
    }

    pub fn center(self) -> Point {
        (self.left + self.width / 2.0, self.top + self.height / 2.0)
    }

    pub(crate) fn inset(self, by: f64) -> Self {
        Self::new(self.left + by, self.top + by, self.width - 2.0 * by, self.height - 2.0 * by)
    }
}

pub(crate) fn many(things: usize) -> f64 {
    // Counts of drawn things are far below billions.
    f64::from(u32::try_from(things).unwrap_or(u32::MAX))
}

/// A colour, written `#rrggbb`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct Rgb(pub u8, pub u8, pub u8);

impl TryFrom<String> for Rgb {
    type Error = String;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        let fault = || format!("expected a colour such as `#0063a6`, found `{text}`");
        let digits = text.strip_prefix('#').filter(|digits| digits.len() == 6).ok_or_else(fault)?;
        let value = u32::from_str_radix(digits, 16).map_err(|_| fault())?;
        let [_, red, green, blue] = value.to_be_bytes();
        Ok(Self(red, green, blue))
    }
}

impl fmt::Display for Rgb {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "#{:02x}{:02x}{:02x}", self.0, self.1, self.2)
    }
}

impl Color for Rgb {
    fn to_backend_color(&self) -> BackendColor {
        BackendColor { rgb: (self.0, self.1, self.2), alpha: 1.0 }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stroke {
    pub color: Rgb,
    pub width: f64,
    /// Alternating lengths of ink and gap, px; empty for a solid line.
    pub dash: &'static [f64],
}

impl Stroke {
    pub const fn solid(color: Rgb, width: f64) -> Self {
        Self { color, width, dash: &[] }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fill {
    pub color: Rgb,
    opacity: f64,
    /// The line around it, drawn half inside: its colour and width, px.
    outline: Option<(Rgb, f64)>,
}

impl Fill {
    pub const fn plain(color: Rgb) -> Self {
        Self { color, opacity: 1.0, outline: None }
    }

    /// A colour that others show through.
    pub(crate) const fn faint(color: Rgb) -> Self {
        Self { color, opacity: 0.12, outline: None }
    }

    pub(crate) const fn outlined(color: Rgb, outline: Rgb, width: f64) -> Self {
        Self { color, opacity: 1.0, outline: Some((outline, width)) }
    }

    fn style(self) -> ShapeStyle {
        self.color.mix(self.opacity).filled()
    }

    /// The outline as attributes: plotters either fills a shape or draws its outline.
    fn outline_attributes(self) -> String {
        let outline = self.outline.map(|(color, width)| format!(" stroke=\"{color}\" stroke-width=\"{width}\""));
        outline.unwrap_or_default()
    }
}

/// A figure in progress. Elements below its final height must not be drawn.
#[derive(Debug)]
pub struct Sheet {
    svg: Rc<RefCell<SvgBackend>>,
    pub(crate) width: f64,
}

impl Sheet {
    pub fn new(width: f64) -> Self {
        Self { svg: Rc::default(), width }
    }

    /// The elements that were drawn, as SVG.
    pub(crate) fn into_body(self) -> String {
        self.svg.take().body
    }

    pub fn line(&mut self, points: &[Point], Stroke { color, width, dash }: Stroke) {
        let points: Vec<_> = points.iter().copied().map(units).collect();
        let dash = dash.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
        let dash = if dash.is_empty() { dash } else { format!(" stroke-dasharray=\"{dash}\"") };
        self.draw(&PathElement::new(points, color.stroke_width(size_units(width))), dash);
    }

    pub(crate) fn polygon(&mut self, corners: &[Point], fill: Fill) {
        let corners: Vec<_> = corners.iter().copied().map(units).collect();
        self.draw(&Polygon::new(corners, fill.style()), fill.outline_attributes());
    }

    pub fn rectangle(&mut self, frame: Frame, fill: Fill) {
        let corners = [(frame.left, frame.top), (frame.right(), frame.bottom())].map(units);
        self.draw(&Rectangle::new(corners, fill.style()), fill.outline_attributes());
    }

    pub(crate) fn circle(&mut self, center: Point, radius: f64, fill: Fill) {
        self.draw(&Circle::new(units(center), size_units(radius), fill.style()), fill.outline_attributes());
    }

    /// Draws one line of text, with the middle of its capitals at the height of `at`.
    pub fn text(&mut self, (x, y): Point, text: &str, lettering: Lettering) {
        let drop = lettering::drop_to_baseline(lettering.size);
        let at = if lettering.upwards { (x + drop, y) } else { (x, y + drop) };
        self.draw(&Text::new(lettering::drawable(text), units(at), lettering.style()), String::new());
    }

    /// Draws filled rectangles side by side, with the same top and height: pairs of left and right ends, ascending.
    /// One path of relative steps, so that many of them take little space in the file.
    pub(crate) fn bars(&mut self, ends: &[(f64, f64)], top: f64, height: f64, color: Rgb) {
        let mut path = String::new();
        let mut at = None;
        for &(left, right) in ends {
            let (left, y) = units((left, top + height / 2.0));
            let (right, _) = units((right, top));
            let _ = match at {
                None => write!(path, "M{} {}", px(left), px(y)),
                Some(at) => write!(path, "m{} 0", px(left - at)),
            };
            let _ = write!(path, "h{}", px(right - left));
            at = Some(right);
        }
        if at.is_some() {
            let width = px(size_units(height));
            self.write(format_args!("<path d=\"{path}\" stroke=\"{color}\" stroke-width=\"{width}\"/>"));
        }
    }

    pub(crate) fn picture(&mut self, frame: Frame, png: &[u8]) {
        let [left, top, width, height] =
            [frame.left, frame.top, frame.width, frame.height].map(|length| fixed(Some(length), 2));
        let png = STANDARD.encode(png);
        self.write(format_args!(
            "<image x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\" preserveAspectRatio=\"none\" \
             href=\"data:image/png;base64,{png}\"/>"
        ));
    }

    pub fn mark(&mut self, mark: &Mark, draw: impl FnOnce(&mut Self)) {
        let value = |(name, value): &(_, String)| format!(" data-{name}=\"{}\"", escaped(&visible(value)));
        let (data, title): (String, _) = (mark.data.iter().map(value).collect(), escaped(&visible(&mark.title)));
        self.write(format_args!("<g class=\"mark\"{data}><title>{title}</title>"));
        draw(self);
        self.write(format_args!("</g>"));
    }

    fn draw<E>(&self, element: &E, extra: String)
    where
        for<'a> &'a E: PointCollection<'a, BackendCoord>,
        E: Drawable<SvgBackend>,
    {
        self.svg.borrow_mut().extra = extra;
        let area: DrawingArea<SvgBackend, Shift> = (&self.svg).into();
        area.draw(element).expect("writing to a string does not fail, and nobody else holds the backend");
    }

    /// Writes a line that plotters has no element for.
    fn write(&self, line: fmt::Arguments<'_>) {
        let _ = writeln!(self.svg.borrow_mut().body, "{line}");
    }
}

/// The data behind a mark: its title on hover, and its values as attributes for programs.
///
/// Rule: `data-value` has all digits, as in `cells.csv`, and is empty without a value. Names are spelled as on the
/// page.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    title: String,
    data: Vec<(Cow<'static, str>, String)>,
}

impl Mark {
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), data: Vec::new() }
    }

    pub fn of_cell(title: String, experiment: &str, model: &str, metric: &str) -> Self {
        Self::new(title).with("experiment", experiment).with("model", model).with("metric", metric)
    }

    /// Adds a value as `data-NAME`; a name already in use gets a dash.
    #[expect(clippy::needless_pass_by_value, reason = "numbers and text alike, as they come")]
    pub fn with(mut self, name: impl Into<Cow<'static, str>>, value: impl ToString) -> Self {
        let mut name = name.into();
        while self.data.iter().any(|(known, _)| *known == name) {
            name.to_mut().push('-');
        }
        self.data.push((name, value.to_string()));
        self
    }

    pub fn value(self, value: Option<f64>) -> Self {
        self.number("value", value)
    }

    /// Adds a number in full precision; empty without one.
    pub fn number(self, name: impl Into<Cow<'static, str>>, value: Option<f64>) -> Self {
        self.with(name, value.map(full_precision).unwrap_or_default())
    }

    pub fn interval(self, bounds: Option<Interval>) -> Self {
        self.number("low", bounds.map(|bounds| bounds.low)).number("high", bounds.map(|bounds| bounds.high))
    }
}

#[cfg(test)]
mod tests {
    use super::{Fill, Frame, Lettering, Mark, Rgb, Sheet, Stroke};
    use crate::Figure;
    use crate::kit::TextAnchor;

    #[test]
    fn a_small_drawing_is_this_text() {
        let (black, red) = (Rgb(0, 0, 0), Rgb(200, 16, 46));
        let mut sheet = Sheet::new(40.0);
        let dashed = Stroke { color: black, width: 1.5, dash: &[2.0, 1.0] };
        sheet.line(&[(1.0, 2.0), (3.25, 4.5)], dashed);
        sheet.mark(&Mark::new("a < b").with("model", "\"x\"").value(Some(1.0 / 3.0)), |sheet| {
            sheet.circle((10.0, 10.0), 2.5, Fill { opacity: 0.5, ..Fill::outlined(red, black, 0.5) });
            sheet.rectangle(Frame::new(0.0, 0.0, 4.0, 3.0), Fill::plain(red));
        });
        sheet.text((20.0, 10.0), "T & A", Lettering::new(10.0, black).semibold().aligned(TextAnchor::Middle));
        insta::assert_snapshot!(Figure::new(sheet, 20.0, "Title", "What it is.").inline_svg());
    }
}

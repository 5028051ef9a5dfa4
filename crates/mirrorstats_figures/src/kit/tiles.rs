//! Cells of a heat map: a coloured value, hatched if undefined, crossed without episodes.

use super::lettering::{self, Lettering, TextAnchor};
use super::palette::{PALETTE, text_on};
use super::sheet::{Fill, Frame, Point, Rgb, Sheet, Stroke, many};

/// A value: its colour, and the first of `texts` that fits into the cell.
pub(crate) fn known(sheet: &mut Sheet, frame: Frame, color: Rgb, texts: &[String]) {
    let lettering = lettering::value().aligned(TextAnchor::Middle);
    sheet.rectangle(frame, Fill::plain(color));
    if let Some(text) = texts.iter().find(|text| lettering.width(text) <= frame.width - 2.0) {
        sheet.text(frame.center(), text, Lettering { color: text_on(color), ..lettering });
    }
}

pub(crate) fn undefined(sheet: &mut Sheet, frame: Frame) {
    const BETWEEN: f64 = 4.0;
    let surface = &PALETTE.surface;
    let stroke = Stroke::solid(surface.hatch, 0.6);
    sheet.rectangle(frame, framed());
    let lines = (1..).map(|i| BETWEEN * many(i)).take_while(|&c| c < frame.width + frame.height);
    for c in lines {
        let from = ((c - frame.height).max(0.0), c.min(frame.height));
        let to = (c.min(frame.width), (c - frame.width).max(0.0));
        sheet.line(&[from, to].map(|(x, y)| (frame.left + x, frame.top + y)), stroke);
    }
    let text = lettering::value().aligned(TextAnchor::Middle);
    let (x, y) = frame.center();
    let half = text.width("--") / 2.0 + 1.5;
    sheet.rectangle(Frame::new(x - half, y - 3.5, 2.0 * half, 7.0), Fill::plain(surface.paper));
    sheet.text((x, y), "--", text);
}

pub(crate) fn empty(sheet: &mut Sheet, frame: Frame) {
    let stroke = Stroke::solid(PALETTE.surface.hatch, 0.8);
    sheet.rectangle(frame, framed());
    sheet.line(&[(frame.left, frame.top), (frame.right(), frame.bottom())], stroke);
    sheet.line(&[(frame.left, frame.bottom()), (frame.right(), frame.top)], stroke);
}

/// Draws a colour scale at `corner`, with a word at each end; returns its right edge, px.
pub(crate) fn scale(sheet: &mut Sheet, corner: Point, colors: impl Fn(f64) -> Rgb, ends: [&str; 2]) -> f64 {
    // Each a whole number of PNG pixels, so that no seams show.
    const STEPS: usize = 60;
    const WIDTH: f64 = 120.0;
    let lettering = lettering::tick();
    let left = (corner.0 + lettering.width(ends[0]) + 6.0).ceil();
    let bar = Frame::new(left, (corner.1 + 2.0).ceil(), WIDTH, 9.0);
    let step = WIDTH / many(STEPS);
    for i in 0..STEPS {
        let tile = Frame::new(bar.left + step * many(i), bar.top, step, bar.height);
        sheet.rectangle(tile, Fill::plain(colors(many(i) / many(STEPS - 1))));
    }
    let middle = bar.center().1;
    sheet.text((corner.0, middle), ends[0], lettering);
    sheet.text((bar.right() + 6.0, middle), ends[1], lettering);
    bar.right() + 6.0 + lettering.width(ends[1])
}

fn framed() -> Fill {
    Fill::outlined(PALETTE.surface.paper, PALETTE.surface.hatch, 0.6)
}

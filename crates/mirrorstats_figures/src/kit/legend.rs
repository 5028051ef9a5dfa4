//! Legends: models and signs with their meanings, laid out by the measured widths of their texts.

use super::lettering::{self, Lettering, MARGIN, NAME_ROOM};
use super::palette::{ModelStyle, PALETTE};
use super::panels::Panels;
use super::roster::Roster;
use super::sheet::{Fill, Frame, Point, Sheet, Stroke, many};
use super::{label, marker, tiles};

const SWATCH_WIDTH: f64 = 24.0;
const SWATCH_GAP: f64 = 5.0;
const COLUMN_GAP: f64 = 16.0;

#[derive(Clone, Copy, Debug)]
pub(crate) enum Swatch {
    Line(&'static ModelStyle),
    Marker(&'static ModelStyle),
    Tile(Fill),
    Undefined,
    Empty,
    Chance,
    Rule(Stroke),
    Tick(Stroke),
    /// A ring with this radius, px.
    Ring(f64),
    Dot(Fill),
    Cross,
    /// No sign: a note.
    None,
}

#[derive(Clone, Debug)]
pub(crate) struct Legend {
    entries: Vec<(Swatch, String, Point)>,
    lettering: Lettering,
    pub height: f64,
}

impl Legend {
    /// The models in columns, as many as fit into `width` px, in column-major order.
    pub(crate) fn of_models(roster: &Roster<'_>, width: f64, swatch: fn(&'static ModelStyle) -> Swatch) -> Self {
        let lettering = lettering::label();
        let room = NAME_ROOM.min(width - SWATCH_WIDTH - SWATCH_GAP);
        let labels = label::fitted(&roster.names(), room, lettering);
        let columns = (1..=labels.len().max(1)).rev().find(|&n| column_widths(&labels, n, lettering).1 <= width);
        let columns = columns.unwrap_or(1);
        let (widths, _) = column_widths(&labels, columns, lettering);
        let rows = labels.len().div_ceil(columns);
        let leading = line_height(lettering);
        let left = |column: usize| widths[..column].iter().sum::<f64>();
        let entries =
            roster.0.iter().zip(labels).enumerate().map(|(at, (member, label))| {
                (swatch(member.style), label, (left(at / rows), leading * many(at % rows)))
            });
        Self { entries: entries.collect(), lettering, height: leading * many(rows) }
    }

    /// Signs one after another, in as many lines as needed.
    pub(crate) fn of_signs(signs: Vec<(Swatch, String)>, width: f64) -> Self {
        let lettering = lettering::tick();
        let leading = line_height(lettering);
        let mut place = (0.0, 0.0);
        let mut entries = Vec::with_capacity(signs.len());
        for (swatch, text) in signs {
            for (at, line) in label::wrapped(&text, width - swatch_room(swatch), lettering).into_iter().enumerate() {
                let swatch = if at == 0 { swatch } else { Swatch::None };
                let taken = swatch_room(swatch) + lettering.width(&line);
                if place.0 > 0.0 && (at > 0 || place.0 + taken > width) {
                    place = (0.0, place.1 + leading);
                }
                entries.push((swatch, line, place));
                place.0 += taken + COLUMN_GAP;
            }
        }
        let height = if entries.is_empty() { 0.0 } else { place.1 + leading };
        Self { entries, lettering, height }
    }

    pub(crate) fn draw(&self, sheet: &mut Sheet, corner: Point) {
        let leading = line_height(self.lettering);
        for (swatch, text, (x, y)) in &self.entries {
            let (left, middle) = (corner.0 + x, corner.1 + y + leading / 2.0);
            draw_swatch(sheet, *swatch, Frame::new(left, middle - 5.0, SWATCH_WIDTH, 10.0));
            sheet.text((left + swatch_room(*swatch), middle), text, self.lettering);
        }
    }
}

/// Draws signs at `corner`; returns the bottom edge, px.
pub(crate) fn draw_signs(sheet: &mut Sheet, corner: Point, signs: Vec<(Swatch, String)>) -> f64 {
    let legend = Legend::of_signs(signs, sheet.width - corner.0 - MARGIN);
    legend.draw(sheet, corner);
    corner.1 + legend.height
}

/// The models in the free place of `panels` if they fit, else below them; `signs` last. Returns the figure's height.
pub(crate) fn around(
    sheet: &mut Sheet,
    roster: &Roster<'_>,
    panels: &Panels,
    swatch: fn(&'static ModelStyle) -> Swatch,
    signs: Vec<(Swatch, String)>,
) -> f64 {
    let width = sheet.width - 2.0 * MARGIN;
    let mut bottom = panels.bottom;
    let beside = panels.rest.map(|rest| (rest, Legend::of_models(roster, rest.width, swatch)));
    if let Some((rest, legend)) = beside.filter(|(rest, legend)| legend.height <= rest.height) {
        legend.draw(sheet, (rest.left, rest.center().1 - legend.height / 2.0));
    } else {
        let legend = Legend::of_models(roster, width, swatch);
        legend.draw(sheet, (MARGIN, bottom + 10.0));
        bottom += 10.0 + legend.height;
    }
    draw_signs(sheet, (MARGIN, bottom + 8.0), signs) + MARGIN
}

fn line_height(lettering: Lettering) -> f64 {
    lettering::leading(lettering) + 2.0
}

fn swatch_room(swatch: Swatch) -> f64 {
    match swatch {
        Swatch::None => 0.0,
        _ => SWATCH_WIDTH + SWATCH_GAP,
    }
}

fn column_widths(labels: &[String], columns: usize, lettering: Lettering) -> (Vec<f64>, f64) {
    let rows = labels.len().div_ceil(columns).max(1);
    let width = |column: &[String]| SWATCH_WIDTH + SWATCH_GAP + lettering.widest(column) + COLUMN_GAP;
    let widths: Vec<f64> = labels.chunks(rows).map(width).collect();
    let all = widths.iter().sum::<f64>() - COLUMN_GAP;
    (widths, all)
}

fn draw_swatch(sheet: &mut Sheet, swatch: Swatch, frame: Frame) {
    let (center, surface) = (frame.center(), &PALETTE.surface);
    let across = [(frame.left, center.1), (frame.right(), center.1)];
    match swatch {
        Swatch::Line(style) => {
            sheet.line(&across, style.stroke(1.4));
            marker::draw(sheet, center, 3.2, style);
        }
        Swatch::Marker(style) => marker::draw(sheet, center, 3.6, style),
        Swatch::Tile(fill) => sheet.rectangle(frame.inset(0.5), fill),
        Swatch::Undefined => tiles::undefined(sheet, frame.inset(0.5)),
        Swatch::Empty => tiles::empty(sheet, frame.inset(0.5)),
        Swatch::Chance => chance(sheet, center),
        Swatch::Rule(stroke) => sheet.line(&across, stroke),
        Swatch::Tick(stroke) => sheet.line(&[(center.0, frame.top), (center.0, frame.bottom())], stroke),
        Swatch::Ring(radius) => sheet.circle(center, radius, Fill::outlined(surface.paper, surface.axis, 1.0)),
        Swatch::Dot(fill) => sheet.circle(center, 3.0, fill),
        Swatch::Cross => cross(sheet, center),
        Swatch::None => {}
    }
}

/// A small cross: no verdict.
pub fn cross(sheet: &mut Sheet, (x, y): Point) {
    for turn in [2.6, -2.6] {
        sheet.line(&[(x - 2.6, y - turn), (x + 2.6, y + turn)], Stroke::solid(PALETTE.surface.quiet, 1.2));
    }
}

/// The red mark of chance: a diamond, whose colour and dark outline differ from any model's.
pub fn chance(sheet: &mut Sheet, (x, y): Point) {
    let fill = Fill::outlined(PALETTE.surface.chance, PALETTE.surface.paper, 0.8);
    sheet.polygon(&[(x, y - 4.5), (x + 3.2, y), (x, y + 4.5), (x - 3.2, y)], fill);
}

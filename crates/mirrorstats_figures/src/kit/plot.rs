//! A plot with two linear axes: maps values to positions, with grid lines and numbers beside them.

use std::ops::Range;

use plotters::coord::CoordTranslate;
use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::ranged1d::{BoldPoints, Ranged};
use plotters::coord::types::RangedCoordf64;

use super::frame::{Frame, Point};
use super::ink::UNITS_PER_PX;
use super::lettering::{self, TextAnchor};
use super::look::Stroke;
use super::palette::PALETTE;
use super::sheet::{Sheet, lattice};
use mirrorstats_exact::number::Decimal;

/// Two linear axes over a frame; y points up.
pub(crate) struct Plot {
    pub frame: Frame,
    spec: Cartesian2d<RangedCoordf64, RangedCoordf64>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tick {
    pub at: f64,
    /// Its text; empty for only a grid line.
    pub text: String,
}

impl Plot {
    pub(crate) fn new(frame: Frame, x: Range<f64>, y: Range<f64>) -> Self {
        let (left, top) = lattice((frame.left, frame.top));
        let (right, bottom) = lattice((frame.right(), frame.bottom()));
        Self { frame, spec: Cartesian2d::new(x, y, (left..right, bottom..top)) }
    }

    pub(crate) fn at(&self, x: f64, y: f64) -> Point {
        let (x, y) = self.spec.translate(&(x, y));
        (f64::from(x) / UNITS_PER_PX, f64::from(y) / UNITS_PER_PX)
    }

    pub(crate) fn x_axis(&self, sheet: &mut Sheet, ticks: &[Tick]) {
        let lettering = lettering::tick().aligned(TextAnchor::Middle);
        for tick in ticks {
            let x = self.at(tick.at, 0.0).0;
            sheet.line(&[(x, self.frame.top), (x, self.frame.bottom())], grid());
            if !tick.text.is_empty() {
                sheet.text((x, self.frame.bottom() + 8.0), &tick.text, lettering);
            }
        }
    }

    pub(crate) fn y_axis(&self, sheet: &mut Sheet, ticks: &[Tick]) {
        let lettering = lettering::tick().aligned(TextAnchor::End);
        for tick in ticks {
            let y = self.at(0.0, tick.at).1;
            sheet.line(&[(self.frame.left, y), (self.frame.right(), y)], grid());
            if !tick.text.is_empty() {
                sheet.text((self.frame.left - 5.0, y), &tick.text, lettering);
            }
        }
    }

    pub(crate) fn x_title(&self, sheet: &mut Sheet, text: &str) {
        let at = (self.frame.center().0, self.frame.bottom() + 20.0);
        sheet.text(at, text, lettering::label().aligned(TextAnchor::Middle));
    }

    /// Draws the title of the y axis, `away` px from the plot.
    pub(crate) fn y_title(&self, sheet: &mut Sheet, text: &str, away: f64) {
        let at = (self.frame.left - away, self.frame.center().1);
        sheet.text(at, text, lettering::label().aligned(TextAnchor::Middle).upwards());
    }
}

/// 0, 0.5 and 1 with numbers, the quarters only as grid lines.
pub(crate) fn rate_ticks() -> Vec<Tick> {
    let tick = |(at, text): (f64, &str)| Tick { at, text: text.to_owned() };
    [(0.0, "0"), (0.25, ""), (0.5, "0.5"), (0.75, ""), (1.0, "1")].map(tick).into()
}

/// At most `most` integers from 0 to `last`, at even distances.
pub(crate) fn whole_ticks(last: u32, most: usize) -> Vec<Tick> {
    let axis = RangedCoordf64::from(0.0..f64::from(last));
    let whole = axis.key_points(BoldPoints(most)).into_iter().filter(|at| at.fract() == 0.0);
    whole.filter_map(|at| Some(Tick { at, text: Decimal::of_float(at, 0)?.to_string() })).collect()
}

fn grid() -> Stroke {
    Stroke::solid(PALETTE.surface.rule, 0.7)
}

#[cfg(test)]
mod tests {
    use super::{Plot, whole_ticks};
    use crate::kit::frame::Frame;

    #[test]
    fn the_corners_of_the_values_are_the_corners_of_the_frame() {
        let plot = Plot::new(Frame::new(10.0, 20.0, 100.0, 50.0), 0.0..2.0, 0.0..1.0);
        assert_eq!((plot.at(0.0, 0.0), plot.at(2.0, 1.0)), ((10.0, 70.0), (110.0, 20.0)));
        assert_eq!(plot.at(1.0, 0.5), (60.0, 45.0));
    }

    #[test]
    fn ticks_are_whole_and_few() {
        for end in [1, 2, 7, 100, 12345, u32::MAX] {
            let ticks = whole_ticks(end, 6);
            assert!(!ticks.is_empty() && ticks.len() <= 6 && ticks[0].at == 0.0, "{end}: {ticks:?}");
        }
    }
}

//! A plot with two linear axes: maps values to positions, with grid lines and numbers beside them.

use std::ops::Range;

use plotters::coord::CoordTranslate;
use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::ranged1d::{BoldPoints, Ranged};
use plotters::coord::types::RangedCoordf64;

use super::lettering::{self, TextAnchor};
use super::palette::PALETTE;
use super::sheet::{Frame, Point, Sheet, Stroke};
use super::svg::{px, units};

/// Room for the numbers and the title of an axis, px.
pub(crate) const ROOM_LEFT: f64 = 34.0;
pub(crate) const ROOM_BELOW: f64 = 28.0;

/// Two linear axes over a frame; y points up.
pub(crate) struct Plot {
    pub frame: Frame,
    axes: Cartesian2d<RangedCoordf64, RangedCoordf64>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tick {
    pub at: f64,
    /// Its text; empty for only a grid line.
    pub text: String,
}

impl Plot {
    pub(crate) fn new(frame: Frame, x: Range<f64>, y: Range<f64>) -> Self {
        let [(left, top), (right, bottom)] = [(frame.left, frame.top), (frame.right(), frame.bottom())].map(units);
        Self { frame, axes: Cartesian2d::new(x, y, (left..right, bottom..top)) }
    }

    pub(crate) fn at(&self, x: f64, y: f64) -> Point {
        let (x, y) = self.axes.translate(&(x, y));
        (px(x), px(y))
    }

    pub(crate) fn x(&self, value: f64) -> f64 {
        self.at(value, 0.0).0
    }

    pub(crate) fn y(&self, value: f64) -> f64 {
        self.at(0.0, value).1
    }

    pub(crate) fn axes(&self, sheet: &mut Sheet, x: (&[Tick], &str), y: (&[Tick], &str)) {
        self.x_ticks(sheet, x.0);
        self.y_ticks(sheet, y.0);
        self.x_title(sheet, x.1);
        self.y_title(sheet, y.1, 26.0);
    }

    pub(crate) fn x_axis(&self, sheet: &mut Sheet, ticks: &[Tick], title: &str) {
        self.x_ticks(sheet, ticks);
        self.x_title(sheet, title);
    }

    fn x_ticks(&self, sheet: &mut Sheet, ticks: &[Tick]) {
        let lettering = lettering::tick().aligned(TextAnchor::Middle);
        for tick in ticks {
            let x = self.x(tick.at);
            sheet.line(&[(x, self.frame.top), (x, self.frame.bottom())], grid());
            if !tick.text.is_empty() {
                sheet.text((x, self.frame.bottom() + 8.0), &tick.text, lettering);
            }
        }
    }

    pub(crate) fn y_ticks(&self, sheet: &mut Sheet, ticks: &[Tick]) {
        let lettering = lettering::tick().aligned(TextAnchor::End);
        for tick in ticks {
            let y = self.y(tick.at);
            sheet.line(&[(self.frame.left, y), (self.frame.right(), y)], grid());
            if !tick.text.is_empty() {
                sheet.text((self.frame.left - 5.0, y), &tick.text, lettering);
            }
        }
    }

    fn x_title(&self, sheet: &mut Sheet, text: &str) {
        let at = (self.frame.center().0, self.frame.bottom() + 20.0);
        sheet.text(at, text, lettering::label().aligned(TextAnchor::Middle));
    }

    /// Draws the title of the y axis, `away` px from the plot.
    pub(crate) fn y_title(&self, sheet: &mut Sheet, text: &str, away: f64) {
        let at = (self.frame.left - away, self.frame.center().1);
        sheet.text(at, text, lettering::label().aligned(TextAnchor::Middle).upwards());
    }
}

/// The quarters of an axis from 0 to 1; only 0, a half and 1 have a text.
pub(crate) fn quarters(zero: &str, half: &str, one: &str) -> [Tick; 5] {
    let tick = |(at, text): (f64, &str)| Tick { at, text: text.to_owned() };
    [(0.0, zero), (0.25, ""), (0.5, half), (0.75, ""), (1.0, one)].map(tick)
}

pub(crate) fn rate_ticks() -> [Tick; 5] {
    quarters("0", "0.5", "1")
}

/// At most `most` integers from 0 to `last`, at even distances.
pub(crate) fn whole_ticks(last: u32, most: usize) -> Vec<Tick> {
    let axis = RangedCoordf64::from(0.0..f64::from(last));
    let whole = axis.key_points(BoldPoints(most)).into_iter().filter(|at| at.fract() == 0.0);
    whole.map(|at| Tick { at, text: at.to_string() }).collect()
}

fn grid() -> Stroke {
    Stroke::solid(PALETTE.surface.rule, 0.7)
}

#[cfg(test)]
mod tests {
    use super::{Plot, whole_ticks};
    use crate::kit::sheet::Frame;

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

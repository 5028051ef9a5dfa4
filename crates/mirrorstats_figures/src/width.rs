//! The printed width of a figure, and the layout that keeps its text legible.

use std::fmt;
use std::str::FromStr;

use super::kit::lettering::FULL_WIDTH;

/// The smallest scale of text: from 9 px, the smallest lettering, to 6 pt.
const LEAST_SCALE: f64 = 8.0 / 9.0;
const PX_PER_CM: f64 = 96.0 / 2.54;
const RANGE_CM: [f64; 2] = [8.0, 50.0];
const UNITS: [(&str, f64); 5] =
    [("cm", PX_PER_CM), ("mm", PX_PER_CM / 10.0), ("in", 96.0), ("pt", 96.0 / 72.0), ("px", 1.0)];

/// The printed width of a figure, such as `8.5cm`: from 8 cm to 50 cm, in cm, mm, in, pt or px.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FigureWidth {
    px: f64,
}

#[derive(Debug, thiserror::Error)]
#[error("expected a width from 8cm to 50cm such as 8.5cm, 85mm, 3.3in, 240pt or 640px, found `{0}`")]
pub struct InvalidWidth(String);

impl FromStr for FigureWidth {
    type Err = InvalidWidth;

    fn from_str(text: &str) -> Result<Self, InvalidWidth> {
        let number = |(unit, px): (&str, f64)| Some(text.trim().strip_suffix(unit)?.trim().parse::<f64>().ok()? * px);
        let [least, most] = RANGE_CM.map(|cm| cm * PX_PER_CM);
        let px = UNITS.into_iter().find_map(number).filter(|px| (least - 0.01..=most + 0.01).contains(px));
        px.map(|px| Self { px }).ok_or_else(|| InvalidWidth(text.to_owned()))
    }
}

impl fmt::Display for FigureWidth {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.1} cm", self.px / PX_PER_CM)
    }
}

impl FigureWidth {
    pub(super) fn layout(self) -> f64 {
        self.px.max((self.px / LEAST_SCALE).min(FULL_WIDTH))
    }

    /// The printed width of a drawing of `width` px, px; `Err` has the narrowest legible width.
    pub(super) fn printed(self, width: f64) -> Result<f64, Self> {
        let least = width * LEAST_SCALE;
        if self.px + 1.0 < least { Err(Self { px: least }) } else { Ok(self.px) }
    }
}

//! Styles and sizes of text: few, so that readers see which texts belong together.

use crate::kit::font::{self, Weight};
use crate::kit::look::Rgb;
use crate::kit::palette::PALETTE;

/// The empty margin of every figure, px.
pub const MARGIN: f64 = 8.0;
/// The width of a full-width figure, px: its smallest text exceeds 5 pt at a text width of 5.5 inches.
pub(crate) const FULL_WIDTH: f64 = 640.0;
/// The most room for names of models beside rows or in a legend, px.
pub(crate) const NAME_ROOM: f64 = 210.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TextAnchor {
    Start,
    Middle,
    End,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lettering {
    pub size: f64,
    pub weight: Weight,
    pub color: Rgb,
    pub align: TextAnchor,
    pub upwards: bool,
}

impl Lettering {
    pub const fn new(size: f64, color: Rgb) -> Self {
        Self { size, weight: Weight::Regular, color, align: TextAnchor::Start, upwards: false }
    }

    pub(crate) const fn semibold(self) -> Self {
        Self { weight: Weight::Semibold, ..self }
    }

    pub(crate) const fn aligned(self, align: TextAnchor) -> Self {
        Self { align, ..self }
    }

    pub(crate) const fn upwards(self) -> Self {
        Self { upwards: true, ..self }
    }

    pub fn width(self, text: &str) -> f64 {
        font::width(text, self.size, self.weight)
    }
}

pub fn heading() -> Lettering {
    Lettering::new(11.5, PALETTE.surface.text).semibold()
}

/// Names of models and metrics.
pub(crate) fn label() -> Lettering {
    Lettering::new(10.0, PALETTE.surface.text)
}

/// Numbers beside an axis, subheadings, notes and keys.
pub(crate) fn tick() -> Lettering {
    Lettering::new(9.0, PALETTE.surface.quiet)
}

/// Numbers inside the plot.
pub fn value() -> Lettering {
    Lettering::new(9.0, PALETTE.surface.text)
}

pub(crate) fn leading(lettering: Lettering) -> f64 {
    (lettering.size * 1.25).ceil()
}

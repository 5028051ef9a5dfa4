//! Styles and sizes of text: few, so that a reader sees at once which texts belong together.

use crate::figures::kit::font::{self, Weight};
use crate::figures::kit::look::Rgb;
use crate::figures::kit::palette::PALETTE;

/// The empty rim of every figure, px.
pub const MARGIN: f64 = 8.0;

/// A full-width figure, px: its smallest text is still above 5 pt on a page with a text width of 5.5 inches.
pub(crate) const FULL_WIDTH: f64 = 640.0;

/// The widest that names of models beside rows or in a legend get, px.
pub(crate) const NAME_ROOM: f64 = 210.0;

/// The alignment of text at its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    Start,
    /// The text's middle is there.
    Middle,
    End,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lettering {
    /// The font's size, px.
    pub size: f64,
    /// Regular, or semibold for headings.
    pub weight: Weight,
    pub color: Rgb,
    /// The alignment at its point.
    pub align: Align,
    pub upwards: bool,
}

impl Lettering {
    /// Regular weight, level, from its point on.
    pub const fn new(size: f64, color: Rgb) -> Self {
        Self { size, weight: Weight::Regular, color, align: Align::Start, upwards: false }
    }

    pub(crate) const fn semibold(self) -> Self {
        Self { weight: Weight::Semibold, ..self }
    }

    pub(crate) const fn aligned(self, align: Align) -> Self {
        Self { align, ..self }
    }

    pub(crate) const fn upwards(self) -> Self {
        Self { upwards: true, ..self }
    }

    /// The width of `text` so set, px.
    pub fn width(self, text: &str) -> f64 {
        font::width(text, self.size, self.weight)
    }
}

/// The heading of a panel.
pub fn heading() -> Lettering {
    Lettering::new(11.5, PALETTE.surface.text).semibold()
}

/// The style of a subheading.
pub(crate) fn subheading() -> Lettering {
    Lettering::new(9.0, PALETTE.surface.quiet)
}

/// Names of models and metrics.
pub(crate) fn label() -> Lettering {
    Lettering::new(10.0, PALETTE.surface.text)
}

/// Numbers beside an axis, notes and keys.
pub(crate) fn tick() -> Lettering {
    Lettering::new(9.0, PALETTE.surface.quiet)
}

/// Numbers in the plot itself.
pub fn value() -> Lettering {
    Lettering::new(9.0, PALETTE.surface.text)
}

/// From line to line of text at `lettering`, px.
pub(crate) fn leading(lettering: Lettering) -> f64 {
    (lettering.size * 1.25).ceil()
}

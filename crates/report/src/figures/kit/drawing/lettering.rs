//! Styles and sizes of text: few, so that readers see which texts belong together.

use crate::figures::kit::font::{self, Weight};
use crate::figures::kit::look::Rgb;
use crate::figures::kit::palette::PALETTE;

/// The empty margin of every figure, px.
pub const MARGIN: f64 = 8.0;

/// The width of a full-width figure, px: its smallest text exceeds 5 pt at a text width of 5.5 inches.
pub(crate) const FULL_WIDTH: f64 = 640.0;

/// The most room for names of models beside rows or in a legend, px.
pub(crate) const NAME_ROOM: f64 = 210.0;

/// The alignment of text at its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    Start,
    /// The text's middle is at the point.
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
    /// Regular weight, horizontal, starting at its point.
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

    /// The width of `text` in this style, px.
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

/// Numbers inside the plot.
pub fn value() -> Lettering {
    Lettering::new(9.0, PALETTE.surface.text)
}

/// The line height of text in `lettering`, px.
pub(crate) fn leading(lettering: Lettering) -> f64 {
    (lettering.size * 1.25).ceil()
}

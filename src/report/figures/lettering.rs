//! The sizes of text: few, so that a reader sees at once what belongs together.

use super::palette::PALETTE;
use super::sheet::Lettering;

/// A full-width figure, px: its smallest text is still above 5 pt on a page with a text width of 5.5 inches.
pub const FULL_WIDTH: f64 = 640.0;

/// The widest that names of models beside rows or in a legend get, px.
pub const NAME_ROOM: f64 = 210.0;

/// The heading of a panel.
pub fn heading() -> Lettering {
    Lettering::new(11.5, PALETTE.surface.text.0).semibold()
}

/// What is below a heading.
pub fn subheading() -> Lettering {
    Lettering::new(9.0, PALETTE.surface.quiet.0)
}

/// Names of models and metrics.
pub fn label() -> Lettering {
    Lettering::new(10.0, PALETTE.surface.text.0)
}

/// Numbers beside an axis, notes and keys.
pub fn tick() -> Lettering {
    Lettering::new(9.0, PALETTE.surface.quiet.0)
}

/// Numbers in the plot itself.
pub fn value() -> Lettering {
    Lettering::new(9.0, PALETTE.surface.text.0)
}

/// From line to line of text at `lettering`, px.
pub fn leading(lettering: Lettering) -> f64 {
    (lettering.size * 1.25).ceil()
}

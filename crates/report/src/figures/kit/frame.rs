//! Places on the sheet: points and upright rectangles, in px from the upper left corner.

/// A place: right, down.
pub type Point = (f64, f64);

/// An upright rectangle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Frame {
    pub left: f64,
    pub top: f64,
    /// From the left edge to the right one.
    pub width: f64,
    /// From the upper edge to the lower one.
    pub height: f64,
}

impl Frame {
    /// A rectangle by its upper left corner and its extent.
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

    /// The rectangle that is smaller by `by` on all four sides.
    pub(crate) fn inset(self, by: f64) -> Self {
        Self::new(self.left + by, self.top + by, self.width - 2.0 * by, self.height - 2.0 * by)
    }
}

/// A number of things as a factor of layout.
pub(crate) fn many(things: usize) -> f64 {
    // Nothing drawn comes in billions.
    f64::from(u32::try_from(things).unwrap_or(u32::MAX))
}

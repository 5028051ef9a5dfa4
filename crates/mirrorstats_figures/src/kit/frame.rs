//! Positions on the sheet: points and axis-aligned rectangles, in px from the top left corner.

/// A point: right, down.
pub type Point = (f64, f64);

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Frame {
    pub left: f64,
    pub top: f64,
    pub width: f64,
    pub height: f64,
}

impl Frame {
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

    pub(crate) fn inset(self, by: f64) -> Self {
        Self::new(self.left + by, self.top + by, self.width - 2.0 * by, self.height - 2.0 * by)
    }
}

pub(crate) fn many(things: usize) -> f64 {
    // Counts of drawn things are far below billions.
    f64::from(u32::try_from(things).unwrap_or(u32::MAX))
}

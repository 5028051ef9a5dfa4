/// The label of every pixel, row by row from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LabelImage {
    pub width: usize,
    pub height: usize,
    /// `width * height` codes, which [`Shown::of_code`](crate::visibility::Shown::of_code) reads.
    pub codes: Vec<u8>,
}

impl LabelImage {
    /// The bounding rectangle of all pixels with selected codes; `None` if there are none.
    pub(crate) fn around(&self, is_asked: impl Fn(&u8) -> bool) -> Option<Rectangle> {
        let mut found: Option<Rectangle> = None;
        for (y, row) in self.codes.chunks_exact(self.width.max(1)).enumerate() {
            let Some(left) = row.iter().position(&is_asked) else { continue };
            let right = 1 + row.iter().rposition(&is_asked).unwrap_or(left);
            let before = found.unwrap_or(Rectangle { left, right, top: y, bottom: y });
            found = Some(Rectangle {
                left: before.left.min(left),
                right: before.right.max(right),
                top: before.top,
                bottom: y + 1,
            });
        }
        found
    }
}

/// Pixels from `left` to before `right`, in rows from `top` to before `bottom`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Rectangle {
    pub left: usize,
    pub right: usize,
    pub top: usize,
    pub bottom: usize,
}

impl Rectangle {
    /// Returns true if the two overlap or nearly do: drawing smooths edges over neighbouring pixels.
    pub(crate) const fn meets(self, other: Self) -> bool {
        const NEARLY: usize = 2;
        self.left < other.right + NEARLY
            && other.left < self.right + NEARLY
            && self.top < other.bottom + NEARLY
            && other.top < self.bottom + NEARLY
    }
}

//! Patches: connected pixels of one colour of the palette.
//!
//! Rule: eight neighbours connect; patches are ordered by their first pixel, row by row, so only the picture matters.

use mirrorstats_trace::frame::Frame;
use mirrorstats_trace::schema::colors::Color;

use super::{paint, real};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ColorPatch {
    pub color: Color,
    pub pixels: usize,
    pub left: usize,
    pub right: usize,
    pub top: usize,
    pub bottom: usize,
}

impl ColorPatch {
    pub const fn width(&self) -> usize {
        self.right - self.left + 1
    }

    pub const fn height(&self) -> usize {
        self.bottom - self.top + 1
    }

    /// The middle of the box, in columns.
    pub fn middle(&self) -> f64 {
        real(self.left + self.right + 1) / 2.0
    }

    /// The box and the pixels of both.
    #[must_use]
    pub fn joined(&self, other: &Self) -> Self {
        Self {
            color: self.color,
            pixels: self.pixels + other.pixels,
            left: self.left.min(other.left),
            right: self.right.max(other.right),
            top: self.top.min(other.top),
            bottom: self.bottom.max(other.bottom),
        }
    }
}

pub(crate) fn patches(frame: &Frame, least: usize) -> Vec<ColorPatch> {
    let runs = runs(frame);
    let roots = connect(&runs);
    let mut found: Vec<Option<ColorPatch>> = vec![None; runs.len()];
    for (run, &root) in runs.iter().zip(&roots) {
        found[root] = Some(found[root].map_or(*run, |patch| patch.joined(run)));
    }
    found.into_iter().flatten().filter(|patch| patch.pixels >= least).collect()
}

/// The patches within each row: pixels of one colour side by side.
fn runs(frame: &Frame) -> Vec<ColorPatch> {
    let mut runs: Vec<ColorPatch> = Vec::new();
    for (row, line) in frame.rgb.chunks_exact(3 * frame.width.max(1)).enumerate() {
        let mut open: Option<ColorPatch> = None;
        for (column, pixel) in line.chunks_exact(3).enumerate() {
            let color = paint::color(pixel);
            if let Some(run) = open.as_mut().filter(|run| Some(run.color) == color) {
                (run.right, run.pixels) = (column, run.pixels + 1);
            } else {
                runs.extend(open.take());
                let (pixels, left, right, top, bottom) = (1, column, column, row, row);
                open = color.map(|color| ColorPatch { color, pixels, left, right, top, bottom });
            }
        }
        runs.extend(open);
    }
    runs
}

fn connect(runs: &[ColorPatch]) -> Vec<usize> {
    let mut parent: Vec<usize> = (0..runs.len()).collect();
    let mut above = 0;
    for (at, run) in runs.iter().enumerate() {
        // `above` never passes a run that a later run of this row may touch.
        while runs[above].top + 1 < run.top || (runs[above].top < run.top && runs[above].right + 1 < run.left) {
            above += 1;
        }
        let candidates = runs[above..at].iter().take_while(|other| other.top < run.top && other.left <= run.right + 1);
        for (offset, other) in candidates.enumerate() {
            if other.color == run.color {
                let (first, second) = (root(&mut parent, above + offset), root(&mut parent, at));
                parent[first.max(second)] = first.min(second);
            }
        }
    }
    (0..runs.len()).map(|at| root(&mut parent, at)).collect()
}

fn root(parent: &mut [usize], mut at: usize) -> usize {
    while parent[at] != at {
        parent[at] = parent[parent[at]];
        at = parent[at];
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of letters: `R` red, `G` green, anything else grey.
    fn picture(rows: &[&str]) -> Frame {
        let pixel = |letter| match letter {
            'R' => paint::lit(Color::Red),
            'G' => paint::lit(Color::Green),
            _ => [110, 110, 110],
        };
        let rgb = rows.iter().flat_map(|row| row.chars().flat_map(pixel)).collect();
        Frame::new(rows[0].len(), rows.len(), rgb)
    }

    fn found(rows: &[&str]) -> Vec<(Color, usize, [usize; 4])> {
        let patches = patches(&picture(rows), 1);
        patches.iter().map(|p| (p.color, p.pixels, [p.left, p.right, p.top, p.bottom])).collect()
    }

    #[test]
    fn a_cup_and_its_content_are_two_patches() {
        let expected = vec![(Color::Red, 11, [0, 4, 0, 3]), (Color::Green, 1, [2, 2, 1, 1])];
        assert_eq!(found(&["R...R", "R.G.R", "R...R", "RRRRR"]), expected);
    }

    #[test]
    fn corners_connect_and_colors_divide() {
        let expected = vec![(Color::Red, 2, [0, 1, 0, 1]), (Color::Green, 2, [1, 2, 0, 1])];
        assert_eq!(found(&["RG.", ".RG"]), expected);
    }

    #[test]
    fn the_last_column_does_not_touch_the_first_of_the_next_row() {
        assert_eq!(found(&["..R", "...", "R.."]).len(), 2);
        assert_eq!(found(&["..R", "R.."]).len(), 2);
    }

    #[test]
    fn small_patches_are_left_out() {
        assert_eq!(patches(&picture(&["RR.G"]), 2).len(), 1);
        assert_eq!(patches(&picture(&["...."]), 1), Vec::new());
    }
}

//! Small multiples: one panel an experiment, in rows, each under its heading.

use super::MARGIN;
use super::frame::{Frame, Point, many};
use super::label;
use super::lettering::{self, leading};
use super::matrix::Matrix;
use super::sheet::Sheet;

/// Panels in rows under headings of equal height.
#[derive(Clone, Debug)]
pub struct Panels {
    /// What is below each heading.
    pub bodies: Vec<Frame>,
    headings: Vec<(Point, String, Vec<String>)>,
    /// The edge below the last row.
    pub bottom: f64,
    /// The place after the last panel of a last row that is not full, heading included.
    pub rest: Option<Frame>,
}

/// How panels are laid out.
#[derive(Clone, Copy, Debug)]
pub struct Arrangement {
    /// The left edge of the first column, px.
    pub left: f64,
    /// Panels beside each other.
    pub columns: usize,
    /// The height of a panel without its heading, px.
    pub height: f64,
    /// Between two panels beside each other, px.
    pub gap: f64,
    /// Whether there is a line for the experiment's title.
    pub titles: Titles,
}

/// What a heading says beside the experiment's name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Titles {
    /// The experiment's title, in up to two lines.
    Shown,
    /// Nothing.
    Hidden,
}

impl Panels {
    /// A panel for each of `experiments` on a sheet of `width` px.
    pub fn new(matrix: &Matrix<'_>, experiments: &[&str], width: f64, arranged: Arrangement) -> Self {
        let Arrangement { left, columns, height, gap, titles } = arranged;
        let room = width - left - MARGIN;
        let panel = (room - gap * many(columns - 1)) / many(columns);
        let titled = |e: &str| match titles {
            Titles::Shown => title_lines(matrix.title(e), panel),
            Titles::Hidden => Vec::new(),
        };
        let lines: Vec<Vec<String>> = experiments.iter().map(|e| titled(e)).collect();
        let most = lines.iter().map(Vec::len).max().unwrap_or(0);
        let head = leading(lettering::heading()) + leading(lettering::subheading()) * many(most) + 6.0;
        let row_height = head + height + 14.0;
        let corner = |at: usize| (left + (panel + gap) * many(at % columns), MARGIN + row_height * many(at / columns));
        let place = |at: usize| {
            let (x, y) = corner(at);
            Frame::new(x, y + head, panel, height)
        };
        let rows = experiments.len().div_ceil(columns);
        let count = experiments.len();
        let rest = (!count.is_multiple_of(columns)).then(|| {
            let (x, y) = corner(count);
            Frame::new(x, y, width - MARGIN - x, head + height)
        });
        let names = label::fitted(experiments, panel, lettering::heading());
        let headings = names.into_iter().zip(lines).enumerate();
        let headings = headings.map(|(at, (name, lines))| (corner(at), name, lines)).collect();
        let bodies = (0..count).map(place).collect();
        Self { bodies, headings, bottom: MARGIN + row_height * many(rows) - 14.0, rest }
    }

    /// Draws the headings.
    pub fn draw(&self, sheet: &mut Sheet) {
        for ((x, y), name, lines) in &self.headings {
            let mut middle = y + leading(lettering::heading()) / 2.0;
            sheet.text((*x, middle), name, lettering::heading());
            middle += leading(lettering::heading()) / 2.0 + leading(lettering::subheading()) / 2.0;
            for line in lines {
                sheet.text((*x, middle), line, lettering::subheading());
                middle += leading(lettering::subheading());
            }
        }
    }
}

/// Columns for `count` panels, at most `most`, so that rows are about equally full.
pub fn balanced(count: usize, most: usize) -> usize {
    let rows = count.div_ceil(most.max(1)).max(1);
    count.div_ceil(rows).max(1)
}

/// A title in at most two lines of `room` px.
fn title_lines(title: &str, room: f64) -> Vec<String> {
    if title.is_empty() {
        return Vec::new();
    }
    let lettering = lettering::subheading();
    let mut lines = label::wrapped(title, room, lettering);
    if lines.len() > 2 {
        let rest = lines.split_off(1).join(" ");
        lines.push(label::cut(&rest, room, lettering));
    }
    lines
}

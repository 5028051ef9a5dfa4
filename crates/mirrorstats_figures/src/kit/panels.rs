//! Small multiples: one panel per experiment, in rows, each under its heading.

use super::frame::{Frame, Point, many};
use super::label;
use super::lettering::{self, MARGIN, leading};
use super::sheet::Sheet;

#[derive(Clone, Debug)]
pub(crate) struct Panels {
    /// The frame below each heading.
    pub bodies: Vec<Frame>,
    headings: Vec<(Point, String, Vec<String>)>,
    pub bottom: f64,
    /// The place after the last panel if the last row is not full, including its heading.
    pub rest: Option<Frame>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Arrangement {
    pub left: f64,
    pub columns: usize,
    /// The height of a panel without its heading, px.
    pub height: f64,
    pub gap: f64,
}

impl Panels {
    /// A panel for each of `names` on a sheet of `width` px, with a title of up to two lines if `titles` has one.
    pub(crate) fn new(names: &[&str], titles: &[&str], width: f64, arranged: Arrangement) -> Self {
        let Arrangement { left, columns, height, gap } = arranged;
        let room = width - left - MARGIN;
        let panel = (room - gap * many(columns - 1)) / many(columns);
        let title = |at: usize| title_lines(titles.get(at).unwrap_or(&""), panel);
        let lines: Vec<Vec<String>> = (0..names.len()).map(title).collect();
        let most = lines.iter().map(Vec::len).max().unwrap_or(0);
        let head = leading(lettering::heading()) + leading(lettering::tick()) * many(most) + 6.0;
        let row_height = head + height + 14.0;
        let corner = |at: usize| (left + (panel + gap) * many(at % columns), MARGIN + row_height * many(at / columns));
        let place = |at: usize| {
            let (x, y) = corner(at);
            Frame::new(x, y + head, panel, height)
        };
        let count = names.len();
        let rows = count.div_ceil(columns);
        let rest = (!count.is_multiple_of(columns)).then(|| {
            let (x, y) = corner(count);
            Frame::new(x, y, width - MARGIN - x, head + height)
        });
        let names = label::fitted(names, panel, lettering::heading());
        let headings = names.into_iter().zip(lines).enumerate();
        let headings = headings.map(|(at, (name, lines))| (corner(at), name, lines)).collect();
        let bodies = (0..count).map(place).collect();
        Self { bodies, headings, bottom: MARGIN + row_height * many(rows) - 14.0, rest }
    }

    pub(crate) fn sheet(&self, width: f64) -> Sheet {
        let mut sheet = Sheet::new(width);
        for ((x, y), name, lines) in &self.headings {
            let mut middle = y + leading(lettering::heading()) / 2.0;
            sheet.text((*x, middle), name, lettering::heading());
            middle += leading(lettering::heading()) / 2.0 + leading(lettering::tick()) / 2.0;
            for line in lines {
                sheet.text((*x, middle), line, lettering::tick());
                middle += leading(lettering::tick());
            }
        }
        sheet
    }
}

/// The columns for `count` panels of at least `least` px in `room` px, at most `most`, in about equally full rows.
pub(crate) fn fitting(count: usize, most: usize, room: f64, [least, gap]: [f64; 2]) -> usize {
    balanced(count, self::most(most, room, [least, gap]).0)
}

/// The most columns of panels of at least `least` px in `room` px, up to `most`; and the width of a panel, px.
pub(crate) fn most(most: usize, room: f64, [least, gap]: [f64; 2]) -> (usize, f64) {
    let fits = |&n: &usize| least * many(n) + gap * many(n - 1) <= room;
    let columns = (1..=most).rev().find(fits).unwrap_or(1);
    (columns, (room - gap * many(columns - 1)) / many(columns))
}

/// The columns for `count` panels, at most `most`, in about equally full rows.
pub(crate) fn balanced(count: usize, most: usize) -> usize {
    let rows = count.div_ceil(most.max(1)).max(1);
    count.div_ceil(rows).max(1)
}

fn title_lines(title: &str, room: f64) -> Vec<String> {
    if title.is_empty() {
        return Vec::new();
    }
    let lettering = lettering::tick();
    let mut lines = label::wrapped(title, room, lettering);
    if lines.len() > 2 {
        let rest = lines.split_off(1).join(" ");
        lines.push(label::cut(&rest, room, lettering));
    }
    lines
}

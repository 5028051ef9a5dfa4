//! Small multiples: one panel per experiment, in rows, each under its heading.

use super::label;
use super::lettering::{self, MARGIN, leading};
use super::sheet::{Frame, Sheet, many};

/// The columns of panels on a sheet of `width` px.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    pub width: f64,
    pub left: f64,
    /// The distance between two columns, px.
    pub gap: f64,
    pub columns: usize,
}

#[derive(Clone, Debug)]
pub(crate) struct Panels {
    /// The frame below each heading.
    pub bodies: Vec<Frame>,
    pub bottom: f64,
    /// The place after the last panel if the last row is not full, including its heading.
    pub rest: Option<Frame>,
}

impl Grid {
    /// The same with fewer columns if a panel would have less than `least` px.
    pub(crate) fn at_least(self, least: f64) -> Self {
        let room = self.width - self.left - MARGIN;
        let fits = |&n: &usize| least * many(n) + self.gap * many(n - 1) <= room;
        Self { columns: (1..=self.columns).rev().find(fits).unwrap_or(1), ..self }
    }

    /// The same with fewer columns if that gives `count` panels in about equally full rows.
    pub(crate) fn balanced(self, count: usize) -> Self {
        let rows = count.div_ceil(self.columns).max(1);
        Self { columns: count.div_ceil(rows).max(1), ..self }
    }

    /// The width of a panel, px.
    pub(crate) fn panel(self) -> f64 {
        (self.width - self.left - MARGIN - self.gap * many(self.columns - 1)) / many(self.columns)
    }

    /// A sheet with a panel for each of `names`, with a title of up to two lines if `titles` has one. A panel has
    /// `height` px below its heading.
    pub(crate) fn panels(self, names: &[&str], titles: &[&str], height: f64) -> (Sheet, Panels) {
        let mut sheet = Sheet::new(self.width);
        let panels = self.panels_below(&mut sheet, MARGIN, names, titles, height);
        (sheet, panels)
    }

    /// The same on a sheet, from `top` on.
    pub(crate) fn panels_below(
        self,
        sheet: &mut Sheet,
        top: f64,
        names: &[&str],
        titles: &[&str],
        height: f64,
    ) -> Panels {
        let Self { width, left, gap, columns } = self;
        let panel = self.panel();
        let title = |at: usize| title_lines(titles.get(at).unwrap_or(&""), panel);
        let titles: Vec<Vec<String>> = (0..names.len()).map(title).collect();
        let most = titles.iter().map(Vec::len).max().unwrap_or(0);
        let (heading, line) = (leading(lettering::heading()), leading(lettering::tick()));
        let head = heading + line * many(most) + 6.0;
        let row_height = head + height + 14.0;
        let corner = |at: usize| (left + (panel + gap) * many(at % columns), top + row_height * many(at / columns));
        let mut bodies = Vec::with_capacity(names.len());
        let headings = label::fitted(names, panel, lettering::heading());
        for (at, (name, title)) in headings.iter().zip(&titles).enumerate() {
            let (x, y) = corner(at);
            sheet.text((x, y + heading / 2.0), name, lettering::heading());
            let mut middle = y + heading / 2.0 + (heading / 2.0 + line / 2.0);
            for text in title {
                sheet.text((x, middle), text, lettering::tick());
                middle += line;
            }
            bodies.push(Frame::new(x, y + head, panel, height));
        }
        let (x, y) = corner(names.len());
        let rest = Frame::new(x, y, width - MARGIN - x, head + height);
        let rest = (!names.len().is_multiple_of(columns)).then_some(rest);
        let bottom = top + row_height * many(names.len().div_ceil(columns)) - 14.0;
        Panels { bodies, bottom, rest }
    }
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

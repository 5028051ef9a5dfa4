//! Sheets of metrics.
//!
//! On a terminal the best is bold and the second best underlined; elsewhere they print as `*0.91*` and `_0.86_`. A
//! table wider than the terminal puts each cell's interval under its estimate; if that is not enough, long names wrap
//! and columns continue in further tables below. The layout is our own because headings span all columns, and styled
//! text must be measured by its visible width.

use unicode_width::UnicodeWidthStr;

use super::wrap::{broken, wrapped};
use super::{Marks, Terminal};
use crate::{Emphasis, RowGroup, Table, TableCell};
use mirrorstats_exact::escape::visible;

const GAP: &str = "  ";
const LEAST_ROOM: usize = 40;

const BOLD: &str = "\x1b[1m";
const UNDERLINE: &str = "\x1b[4m";
const RESET: &str = "\x1b[0m";

pub fn render(table: &Table, terminal: Terminal) -> String {
    let grids = Grid::within(table, terminal);
    let room = terminal.width.unwrap_or_else(|| grids[0].width()).max(LEAST_ROOM);
    let mut lines = wrapped(&format!("{}.", visible(&table.title)), room, 0);
    lines.push(String::new());
    for grid in &grids {
        lines.extend(grid.lines(table, terminal.width.map(|_| room)));
        lines.push(String::new());
    }
    for sentence in &table.sentences {
        lines.extend(wrapped(&visible(sentence), room, 0));
    }
    if terminal.emphasis == Marks::Signs {
        let has = |sign| table.cells().any(|cell| cell.emphasis == sign);
        let best = if table.is_tied { "*tied for the best*" } else { "*best*" };
        let signs = [(Emphasis::Bold, best), (Emphasis::Underline, "_second best_")];
        let used: Vec<&str> = signs.iter().filter(|(sign, _)| has(*sign)).map(|(_, words)| *words).collect();
        lines.extend((!used.is_empty()).then(|| format!("Marked as {}.", used.join(", "))));
    }
    while lines.last().is_some_and(String::is_empty) {
        lines.pop();
    }
    lines.join("\n") + "\n"
}

/// The columns that a text takes; the sequences of emphasis take none. Names have no such sequences: [`visible`] spells
/// them out.
fn shown_width(text: &str) -> usize {
    [BOLD, UNDERLINE, RESET].iter().fold(text.to_owned(), |text, sequence| text.replace(sequence, "")).width()
}

/// Every cell as lines, and the widths of the columns; column 0 has the row names.
struct Grid {
    header: Vec<String>,
    groups: Vec<Vec<Vec<Vec<String>>>>,
    widths: Vec<usize>,
}

impl Grid {
    fn within(table: &Table, terminal: Terminal) -> Vec<Self> {
        let one_line = Self::new(table, terminal.emphasis, false);
        let Some(width) = terminal.width.filter(|width| one_line.width() > *width) else { return vec![one_line] };
        let two_lines = Self::new(table, terminal.emphasis, true);
        if two_lines.width() <= width { vec![two_lines] } else { two_lines.split(width) }
    }

    /// Grids of some columns each, at most `width` wide unless a single column is wider; each has the row names.
    fn split(mut self, width: usize) -> Vec<Self> {
        self.break_names(width / 2);
        let mut parts: Vec<Vec<usize>> = Vec::new();
        let mut taken = 0;
        for column in 1..self.widths.len() {
            let room = GAP.len() + self.widths[column];
            match parts.last_mut() {
                Some(part) if taken + room <= width => part.push(column),
                _ => {
                    parts.push(vec![0, column]);
                    taken = self.widths[0];
                }
            }
            taken += room;
        }
        parts.into_iter().map(|part| self.only(&part)).collect()
    }

    fn break_names(&mut self, room: usize) {
        for cell in self.groups.iter_mut().flatten().filter_map(|row| row.first_mut()) {
            *cell = cell.iter().flat_map(|line| broken(line, room)).collect();
        }
        let names = self.groups.iter().flatten().filter_map(|row| row.first()).flatten().chain([&self.header[0]]);
        self.widths[0] = names.map(|line| shown_width(line)).max().unwrap_or(0);
    }

    fn only(&self, columns: &[usize]) -> Self {
        let row = |row: &Vec<Vec<String>>| columns.iter().map(|&at| row[at].clone()).collect();
        Self {
            header: columns.iter().map(|&at| self.header[at].clone()).collect(),
            groups: self.groups.iter().map(|group| group.iter().map(row).collect()).collect(),
            widths: columns.iter().map(|&at| self.widths[at]).collect(),
        }
    }

    /// Cells in one line each, or in two, with the uncertainty below.
    fn new(table: &Table, marks: Marks, in_two: bool) -> Self {
        let header: Vec<String> = table.columns.iter().map(|column| column.spelled(visible)).collect();
        let lines = |row: &Vec<TableCell>| row.iter().map(|cell| spell(cell, marks, in_two)).collect();
        let groups: Vec<Vec<Vec<Vec<String>>>> =
            table.groups.iter().map(|group| group.rows.iter().map(lines).collect()).collect();
        let mut widths: Vec<usize> = header.iter().map(|text| shown_width(text)).collect();
        for row in groups.iter().flatten() {
            for (width, cell) in widths.iter_mut().zip(row) {
                *width = cell.iter().map(|line| shown_width(line)).fold(*width, usize::max);
            }
        }
        Self { header, groups, widths }
    }

    fn width(&self) -> usize {
        self.widths.iter().sum::<usize>() + GAP.len() * self.widths.len().saturating_sub(1)
    }

    fn lines(&self, table: &Table, room: Option<usize>) -> Vec<String> {
        let heading = |group: &RowGroup| {
            let heading = group.heading.as_deref().map(visible);
            heading.map_or_else(Vec::new, |heading| match room {
                Some(room) => broken(&heading, room),
                None => vec![heading],
            })
        };
        let headings = table.groups.iter().flat_map(heading).map(|heading| heading.width());
        let rule = "─".repeat(headings.fold(self.width(), usize::max));
        let mut lines = vec![self.line(&self.header), rule.clone()];
        for (at, (group, rows)) in table.groups.iter().zip(&self.groups).enumerate() {
            if at > 0 {
                lines.push(String::new());
            }
            lines.extend(heading(group));
            for row in rows {
                let height = row.iter().map(Vec::len).max().unwrap_or(1);
                let nth =
                    |n: usize| row.iter().map(|cell| cell.get(n).cloned().unwrap_or_default()).collect::<Vec<_>>();
                lines.extend((0..height).map(|n| self.line(&nth(n))));
            }
        }
        lines.push(rule);
        lines
    }

    fn line(&self, texts: &[String]) -> String {
        let aligned = texts.iter().zip(&self.widths).enumerate().map(|(at, (text, width))| {
            let room = " ".repeat(width.saturating_sub(shown_width(text)));
            if at == 0 { format!("{text}{room}") } else { format!("{room}{text}") }
        });
        aligned.collect::<Vec<_>>().join(GAP).trim_end().to_owned()
    }
}

fn spell(cell: &TableCell, marks: Marks, in_two: bool) -> Vec<String> {
    let [bold, underline] = match marks {
        Marks::Signs => [["*"; 2], ["_"; 2]],
        Marks::Ansi => [[BOLD, RESET], [UNDERLINE, RESET]],
    };
    let spelled = |cell: &TableCell| cell.marked_up(visible, bold, underline);
    match &cell.detail {
        Some(detail) if in_two => vec![spelled(&TableCell { detail: None, ..cell.clone() }), detail.clone()],
        _ => vec![spelled(cell)],
    }
}

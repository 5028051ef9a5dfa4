//! Tables for a terminal, and for a pipe.
//!
//! On a terminal the best is bold and the second best underlined; elsewhere they stand as `*0.91*` and `_0.86_`.
//! A table wider than the terminal puts each cell's interval under its estimate. The layout is our own because
//! headings span all columns and styled text must measure as what it shows.

use unicode_width::UnicodeWidthStr;

use crate::base::visible::visible;
use crate::report::table::{Cell, Column, DAGGER, Emphasis, Row, RowGroup, Table, Value};

/// What the text is printed on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Terminal {
    /// Columns of the terminal; none where lines may be of any length.
    pub width: Option<usize>,
    /// How emphasis is shown.
    pub emphasis: Marks,
}

/// How emphasis is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Marks {
    /// By `*` and `_` around it.
    #[default]
    Signs,
    /// By ANSI escape sequences.
    Ansi,
}

/// Spaces between columns.
const GAP: &str = "  ";

/// The whole table: title, rows, notes.
pub fn render(table: &Table, terminal: Terminal) -> String {
    let one_line = Grid::new(table, terminal.emphasis, Shape::OneLine);
    let grid = match terminal.width {
        Some(width) if one_line.width() > width => Grid::new(table, terminal.emphasis, Shape::TwoLines),
        _ => one_line,
    };
    let room = terminal.width.unwrap_or_else(|| grid.width()).max(40);
    let mut lines = wrapped(&format!("{}.", visible(&table.title)), room);
    lines.push(String::new());
    lines.extend(grid.lines(table));
    lines.push(String::new());
    for sentence in table.sentences() {
        lines.extend(wrapped(&visible(sentence), room));
    }
    if terminal.emphasis == Marks::Signs && is_any_emphasised(table) {
        lines.push("Marked as *best*, _second best_.".to_owned());
    }
    while lines.last().is_some_and(String::is_empty) {
        lines.pop();
    }
    lines.join("\n") + "\n"
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Shape {
    OneLine,
    TwoLines,
}

/// Text and the columns that it takes on the screen.
#[derive(Clone, Default)]
struct Piece {
    text: String,
    width: usize,
}

impl Piece {
    fn new(text: String) -> Self {
        Self { width: text.width(), text }
    }

    fn emphasised(text: &str, emphasis: Emphasis, marks: Marks) -> Self {
        match (emphasis, marks) {
            (Emphasis::Plain, _) => Self::new(text.to_owned()),
            (Emphasis::Bold, Marks::Signs) => Self::new(format!("*{text}*")),
            (Emphasis::Underline, Marks::Signs) => Self::new(format!("_{text}_")),
            (Emphasis::Bold, Marks::Ansi) => Self { text: format!("\x1b[1m{text}\x1b[0m"), width: text.width() },
            (Emphasis::Underline, Marks::Ansi) => Self { text: format!("\x1b[4m{text}\x1b[0m"), width: text.width() },
        }
    }

    fn followed_by(self, text: &str) -> Self {
        Self { width: self.width + text.width(), text: self.text + text }
    }

    fn to_the_right(&self, width: usize) -> String {
        format!("{}{}", " ".repeat(width.saturating_sub(self.width)), self.text)
    }

    fn to_the_left(&self, width: usize) -> String {
        format!("{}{}", self.text, " ".repeat(width.saturating_sub(self.width)))
    }
}

/// Every cell as its lines, and the widths of the columns; the names of the rows are column 0.
struct Grid {
    header: Vec<Piece>,
    /// Group, row, column, line.
    groups: Vec<Vec<Vec<Vec<Piece>>>>,
    widths: Vec<usize>,
}

impl Grid {
    fn new(table: &Table, marks: Marks, shape: Shape) -> Self {
        let header = header(table);
        let groups: Vec<Vec<Vec<Vec<Piece>>>> = table
            .groups
            .iter()
            .map(|group| group.rows.iter().map(|row| pieces(row, table, marks, shape)).collect())
            .collect();
        let mut widths: Vec<usize> = header.iter().map(|piece| piece.width).collect();
        for row in groups.iter().flatten() {
            for (width, cell) in widths.iter_mut().zip(row) {
                *width = cell.iter().map(|piece| piece.width).fold(*width, usize::max);
            }
        }
        Self { header, groups, widths }
    }

    fn width(&self) -> usize {
        self.widths.iter().sum::<usize>() + GAP.len() * self.widths.len().saturating_sub(1)
    }

    fn lines(&self, table: &Table) -> Vec<String> {
        let headings = table.groups.iter().filter_map(heading).map(|heading| heading.width());
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

    fn line(&self, pieces: &[Piece]) -> String {
        let aligned = pieces.iter().zip(&self.widths).enumerate().map(|(at, (piece, &width))| match at {
            0 => piece.to_the_left(width),
            _ => piece.to_the_right(width),
        });
        aligned.collect::<Vec<_>>().join(GAP).trim_end().to_owned()
    }
}

fn heading(group: &RowGroup) -> Option<String> {
    group.heading.as_deref().map(visible)
}

fn header(table: &Table) -> Vec<Piece> {
    let of_column = |column: &Column| match column.better.arrow() {
        Some(arrow) => format!("{} {arrow}", visible(&column.metric)),
        None => visible(&column.metric),
    };
    std::iter::once(visible(&table.row_heading)).chain(table.columns.iter().map(of_column)).map(Piece::new).collect()
}

fn pieces(row: &Row, table: &Table, marks: Marks, shape: Shape) -> Vec<Vec<Piece>> {
    let name = vec![Piece::new(visible(&row.name))];
    std::iter::once(name).chain(row.cells.iter().map(|cell| spell(cell, table, marks, shape))).collect()
}

fn spell(cell: &Cell, table: &Table, marks: Marks, shape: Shape) -> Vec<Piece> {
    let (estimate, detail) = cell.value.parts(&visible(&table.undefined));
    let mark = if cell.is_marked { DAGGER.to_string() } else { String::new() };
    let is_whole = matches!(cell.value, Value::MeanSe { .. });
    match (detail, shape) {
        (Some(detail), Shape::OneLine) if is_whole => {
            vec![Piece::emphasised(&format!("{estimate} {detail}"), cell.emphasis, marks).followed_by(&mark)]
        }
        (Some(detail), Shape::OneLine) => {
            vec![Piece::emphasised(&estimate, cell.emphasis, marks).followed_by(&format!("{mark} {detail}"))]
        }
        (Some(detail), Shape::TwoLines) => {
            vec![Piece::emphasised(&estimate, cell.emphasis, marks).followed_by(&mark), Piece::new(detail)]
        }
        (None, _) => vec![Piece::emphasised(&estimate, cell.emphasis, marks).followed_by(&mark)],
    }
}

fn is_any_emphasised(table: &Table) -> bool {
    let rows = table.groups.iter().flat_map(|group| &group.rows);
    rows.flat_map(|row| &row.cells).any(|cell| cell.emphasis != Emphasis::Plain)
}

/// `text` in lines of at most `width` columns where its words allow.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if line.is_empty() => line.push_str(word),
            Some(line) if line.width() + 1 + word.width() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

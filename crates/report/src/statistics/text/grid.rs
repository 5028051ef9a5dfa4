//! Lines under a header, as `stats` prints them.

use comfy_table::{CellAlignment, ContentArrangement, Table, presets};

use crate::tables::fit::fitted;
use exact::escape::visible;

/// Lines under a header: columns of text first, then columns of numbers, which stand to the right.
pub(super) struct Grid {
    header: Vec<String>,
    texts: usize,
    lines: Vec<Vec<String>>,
}

impl Grid {
    /// The names of the text columns, then those of the numbers.
    pub fn new<T: AsRef<str>>(texts: &[T], numbers: &[&str]) -> Self {
        let header = texts.iter().map(AsRef::as_ref).chain(numbers.iter().copied());
        Self { header: header.map(visible).collect(), texts: texts.len(), lines: Vec::new() }
    }

    pub fn with(mut self, lines: impl Iterator<Item = Vec<String>>) -> Self {
        self.lines.extend(lines);
        self
    }

    pub fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }

    /// Whether some cell has this mark.
    pub fn has(&self, mark: char) -> bool {
        self.lines.iter().flatten().any(|cell| cell.contains(mark))
    }

    pub fn render(&self, width: Option<usize>) -> String {
        let mut table = Table::new();
        table.load_style(presets::NOTHING).set_content_arrangement(ContentArrangement::Disabled);
        table.set_header(&self.header);
        table.add_rows(self.lines.iter().map(|line| line.iter().map(|cell| visible(cell))));
        for (at, column) in table.column_iter_mut().enumerate() {
            column.set_cell_alignment(if at < self.texts { CellAlignment::Left } else { CellAlignment::Right });
        }
        fitted(&table, self.texts, width) + "\n"
    }
}

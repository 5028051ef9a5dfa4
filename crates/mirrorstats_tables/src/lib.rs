//! The model of printed tables, and its formats in one file each: terminal, Markdown, LaTeX, CSV, HTML.
//!
//! ```
//! use mirrorstats_tables::Table;
//!
//! let mut table = Table::plain(&["model"], &["TSA"]);
//! table.push(["oracle", "1.00"]);
//! assert_eq!(table.csv(), "model,TSA\noracle,1.00\n");
//! ```
//!
//! Rule: everything in a table (names from traces, titles, a style's own words) is text, never markup. Each format
//! escapes it; the one exception is a style's `latex` header.

#![warn(clippy::print_stdout, clippy::print_stderr)]

mod csv;
mod html;
mod latex;
mod markdown;
mod terminal;

use mirrorstats_metric::catalogs::catalog::Better;

pub use csv::{text_field, text_of};
pub use markdown::escape as escape_markdown;
pub use terminal::wrap::{push_wrapped, wrapped};
pub use terminal::{Marks, Terminal};

/// A table as text: all decisions are made, a format only prints them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    /// The first words of its caption; empty for none.
    pub title: String,
    /// The sentences after the title: notes, then footnotes.
    pub sentences: Vec<String>,
    pub label: Option<String>,
    pub look: Look,
    pub columns: Vec<Column>,
    /// The number of leading columns that name a row.
    pub names: usize,
    /// True if bold marks all that are tied for the best.
    pub is_tied: bool,
    /// The rows, in groups with a heading each.
    pub groups: Vec<RowGroup>,
}

/// The looks of a table. Captions are above sheets and never below lists.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Look {
    /// Cells of metrics under headings of groups, as in a paper.
    Sheet,
    /// Lines without a rule.
    Plain,
    /// Lines with a rule below the header.
    #[default]
    Ruled,
    /// Lines between rules.
    Framed,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    pub heading: String,
    /// The heading as LaTeX, if the escaped text does not suffice.
    pub latex: Option<String>,
    /// The direction of the arrow beside the heading.
    pub better: Better,
    pub align: Align,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    Left,
    Right,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RowGroup {
    /// `E1: Active mirror-based self-identification`; `None` if there is only one group.
    pub heading: Option<String>,
    pub rows: Vec<Vec<TableCell>>,
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TableCell {
    pub text: String,
    /// The uncertainty of the text: `± 0.11`, `[0.22, 0.47]`.
    pub detail: Option<String>,
    /// True if emphasis covers the detail too.
    pub is_whole: bool,
    /// True if LaTeX prints it in math mode.
    pub is_number: bool,
    pub emphasis: Emphasis,
    /// True if a dagger marks it.
    pub is_marked: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Emphasis {
    #[default]
    Plain,
    Bold,
    /// The second best.
    Underline,
}

/// The sign that marks a cell of few episodes.
pub const DAGGER: char = '†';

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ListTable {
    pub name: String,
    /// For people; its sentences explain how to read it and its limits.
    pub printed: Table,
    /// The full version for programs: numbers are exact, unknown values are empty.
    pub records: Table,
}

impl Table {
    /// An empty list; the first `names` columns name a row.
    pub fn list(look: Look, names: usize, columns: impl IntoIterator<Item = Column>) -> Self {
        Self { look, names, columns: columns.into_iter().collect(), ..Self::default() }
    }

    /// An empty list without a rule: text columns, which name a row, then number columns.
    pub fn plain<T: AsRef<str>>(texts: &[T], numbers: &[&str]) -> Self {
        let texts_of = texts.iter().map(|text| Column::left(text.as_ref()));
        Self::list(Look::Plain, texts.len(), texts_of.chain(numbers.iter().copied().map(Column::right)))
    }

    /// An empty list of text columns under a rule; the first column names a row.
    pub fn of_texts(columns: impl IntoIterator<Item = impl Into<String>>) -> Self {
        Self::list(Look::Ruled, 1, columns.into_iter().map(Column::left))
    }

    #[must_use]
    pub fn titled(self, title: impl Into<String>) -> Self {
        Self { title: title.into(), ..self }
    }

    /// Aligns these columns to the right, as numbers are.
    #[must_use]
    pub fn aligned_right(mut self, columns: impl IntoIterator<Item = usize>) -> Self {
        for column in columns {
            self.columns[column].align = Align::Right;
        }
        self
    }

    /// Adds rows to the last group.
    #[must_use]
    pub fn with<R: IntoIterator<Item: Into<TableCell>>>(mut self, rows: impl IntoIterator<Item = R>) -> Self {
        rows.into_iter().for_each(|row| self.push(row));
        self
    }

    pub fn push(&mut self, row: impl IntoIterator<Item: Into<TableCell>>) {
        let row = row.into_iter().map(Into::into).collect();
        match self.groups.last_mut() {
            Some(group) => group.rows.push(row),
            None => self.groups.push(RowGroup { heading: None, rows: vec![row] }),
        }
    }

    pub fn rows(&self) -> impl Iterator<Item = &Vec<TableCell>> {
        self.groups.iter().flat_map(|group| &group.rows)
    }

    pub fn is_empty(&self) -> bool {
        self.rows().next().is_none()
    }

    fn cells(&self) -> impl Iterator<Item = &TableCell> {
        self.rows().flatten()
    }
}

impl Column {
    pub fn left(heading: impl Into<String>) -> Self {
        Self { heading: heading.into(), latex: None, better: Better::Neither, align: Align::Left }
    }

    pub fn right(heading: impl Into<String>) -> Self {
        Self { align: Align::Right, ..Self::left(heading) }
    }

    fn spelled(&self, escape: fn(&str) -> String) -> String {
        let heading = escape(&self.heading);
        self.better.arrow().map_or_else(|| heading.clone(), |arrow| format!("{heading} {arrow}"))
    }
}

impl<T: Into<String>> From<T> for TableCell {
    fn from(text: T) -> Self {
        Self { text: text.into(), ..Self::default() }
    }
}

impl TableCell {
    fn marked_up(&self, escape: fn(&str) -> String, bold: [&str; 2], underline: [&str; 2]) -> String {
        let (text, mark) = (escape(&self.text), if self.is_marked { "†" } else { "" });
        let (inside, after) = match &self.detail {
            Some(detail) if self.is_whole => (format!("{text} {detail}"), mark.to_owned()),
            Some(detail) => (text, format!("{mark} {detail}")),
            None => (text, mark.to_owned()),
        };
        let [before, behind] = match self.emphasis {
            Emphasis::Plain => ["", ""],
            Emphasis::Bold => bold,
            Emphasis::Underline => underline,
        };
        format!("{before}{inside}{behind}{after}")
    }
}

// The words of CSV files.
mirrorstats_exact::names!(Emphasis { Plain: "", Bold: "bold", Underline: "underline" });

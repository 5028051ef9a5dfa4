//! A table that is written column by column, each heading beside its cells.

use crate::study::RowKey;
use mirrorstats_exact::format::p_value;
use mirrorstats_tables::Table;

/// A table under construction, one line per row. Text columns come before number columns.
pub(super) struct TextTable<R> {
    rows: Vec<R>,
    lines: Vec<Vec<String>>,
    texts: Vec<String>,
    numbers: Vec<&'static str>,
}

impl<R> TextTable<R> {
    pub fn of(rows: impl IntoIterator<Item = R>) -> Self {
        let rows: Vec<R> = rows.into_iter().collect();
        Self { lines: vec![Vec::new(); rows.len()], rows, texts: Vec::new(), numbers: Vec::new() }
    }

    pub fn text<S: ToString>(mut self, heading: &str, cell: impl Fn(&R) -> S) -> Self {
        self.texts.push(heading.to_owned());
        self.filled(cell)
    }

    pub fn number<S: ToString>(mut self, heading: &'static str, cell: impl Fn(&R) -> S) -> Self {
        self.numbers.push(heading);
        self.filled(cell)
    }

    pub fn number_if<S: ToString>(self, is_shown: bool, heading: &'static str, cell: impl Fn(&R) -> S) -> Self {
        if is_shown { self.number(heading, cell) } else { self }
    }

    pub fn cell(self, of: impl Fn(&R) -> (&RowKey, &String)) -> Self {
        self.text("experiment", |row| of(row).0.experiment.clone())
            .text("model", |row| of(row).0.name())
            .text("metric", |row| of(row).1.clone())
    }

    /// The columns of the p value, the mid-p value if `is_full`, and the adjusted p value.
    pub fn p_values(self, is_full: bool, of: impl Fn(&R) -> [Option<f64>; 3]) -> Self {
        self.number("p", |row| p_value(of(row)[0]))
            .number_if(is_full, "mid-p", |row| p_value(of(row)[1]))
            .number("p (Holm)", |row| p_value(of(row)[2]))
    }

    pub fn table(self) -> Table {
        Table::plain(&self.texts, &self.numbers).with(self.lines)
    }

    fn filled<S: ToString>(mut self, cell: impl Fn(&R) -> S) -> Self {
        self.lines.iter_mut().zip(&self.rows).for_each(|(line, row)| line.push(cell(row).to_string()));
        self
    }
}

//! The rows of a file of any shape, as columns of values by their paths.

use std::collections::HashSet;

use arrow::array::{Array, ArrayRef, AsArray as _};
use indexmap::IndexMap;
use serde_json::Value;

use super::MOST_ROWS;
use crate::arrays::plain;
use crate::error::ImportError;
use crate::text::Text;
use crate::value::Cell;

/// The values of the rows of a file, by the paths of mappings.
#[derive(Debug, Default)]
pub(super) struct Rows {
    /// The list that holds the rows, as in `rows = "steps[]"`.
    pub(super) list: String,
    pub(super) columns: IndexMap<String, Vec<Cell<'static>>>,
    pub(super) count: usize,
    pub(super) is_cut: bool,
}

impl Rows {
    pub(super) fn of_values(values: &[Value]) -> Self {
        let list = longest_list(values).unwrap_or_default();
        let mut rows = Self { list, ..Self::default() };
        for value in values {
            let parts: Vec<&str> = rows.list.split("[]").map(|part| part.trim_start_matches('.')).collect();
            let parts: Vec<String> = parts[..parts.len() - 1].iter().map(|part| (*part).to_owned()).collect();
            rows.add(value, &parts, &IndexMap::new());
        }
        rows.fill();
        rows
    }

    fn add(&mut self, value: &Value, lists: &[String], around: &IndexMap<String, Cell<'static>>) {
        let mut values = around.clone();
        flatten("", value, lists.first().map(String::as_str), &mut values);
        let Some((list, inner)) = lists.split_first() else {
            return self.push(values);
        };
        for item in crate::source::at(value, list).and_then(Value::as_array).into_iter().flatten() {
            self.add(item, inner, &values);
        }
    }

    fn push(&mut self, values: IndexMap<String, Cell<'static>>) {
        if self.count == MOST_ROWS {
            self.is_cut = true;
            return;
        }
        for (path, value) in values {
            let column = self.columns.entry(path).or_default();
            column.resize(self.count, Cell::Null);
            column.push(value);
        }
        self.count += 1;
    }

    fn fill(&mut self) {
        self.columns.values_mut().for_each(|column| column.resize(self.count, Cell::Null));
    }

    pub(super) fn of_tables(text: &Text) -> Result<Self, ImportError> {
        let mut rows = Self::default();
        for batch in 0..text.batches() {
            if rows.count >= MOST_ROWS {
                rows.is_cut = true;
                break;
            }
            let table = text.batch(batch)?;
            for (field, values) in table.schema().fields().iter().zip(table.columns()) {
                rows.add_column(field.name(), values);
            }
            rows.count += table.num_rows();
            rows.fill();
        }
        Ok(rows)
    }

    fn add_column(&mut self, path: &str, values: &ArrayRef) {
        if let Some(members) = values.as_struct_opt() {
            for (name, values) in members.column_names().into_iter().zip(members.columns()) {
                self.add_column(&format!("{path}.{name}"), values);
            }
        } else if let Ok(values) = plain(values) {
            let count = self.count;
            let column = self.columns.entry(path.to_owned()).or_default();
            column.resize(count, Cell::Null);
            column.extend((0..values.len()).map(|row| Cell::at(&values, row).into_owned()));
        }
    }

    /// The path with the first of these names that a fit column has.
    pub(super) fn named(&self, names: &[String], fits: impl Fn(&[Cell<'_>]) -> bool) -> Option<String> {
        let of_name =
            |name: &String| self.columns.iter().find(|(path, values)| names_of(path).contains(name) && fits(values));
        names.iter().find_map(of_name).map(|(path, _)| path.clone())
    }

    /// The fit column with which the values of these columns are different in each row; `None` if they are so already.
    pub(super) fn distinguishing(&self, paths: &[String], fits: impl Fn(&[Cell<'_>]) -> bool) -> Option<&str> {
        let is_unique = |paths: &[String]| self.keys(paths).into_iter().collect::<HashSet<_>>().len() == self.count;
        if paths.is_empty() || is_unique(paths) {
            return None;
        }
        let mut others = self.columns.iter().filter(|(path, values)| !paths.contains(path) && fits(values));
        others.find(|(path, _)| is_unique(&[paths, &[(*path).clone()]].concat())).map(|(path, _)| path.as_str())
    }

    /// The first column, if all values of all columns are lists.
    pub(super) fn only_lists(&self) -> Option<&str> {
        let is_list = |values: &Vec<Cell<'_>>| values.iter().all(|value| *value == Cell::List);
        self.columns.keys().next().filter(|_| self.columns.values().all(is_list)).map(String::as_str)
    }

    /// The texts of these columns in each row.
    pub(super) fn keys(&self, paths: &[String]) -> Vec<Vec<String>> {
        let text = |path: &String, row: usize| self.columns[path][row].text().unwrap_or_default().into_owned();
        (0..self.count).map(|row| paths.iter().map(|path| text(path, row)).collect()).collect()
    }
}

/// The plain values of an object by their paths; those of the list `without` are rows.
fn flatten(path: &str, value: &Value, without: Option<&str>, values: &mut IndexMap<String, Cell<'static>>) {
    let Value::Object(members) = value else {
        values.insert(path.to_owned(), Cell::of_json(value).into_owned());
        return;
    };
    for (name, member) in members {
        let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
        if without != Some(&*path) {
            flatten(&path, member, without, values);
        }
    }
}

/// The list of objects with the most items, such as `tasks[].episodes[]`; `None` if the objects themselves are the rows.
fn longest_list(values: &[Value]) -> Option<String> {
    let mut counts: IndexMap<String, usize> = IndexMap::new();
    for value in values {
        count_lists("", value, &mut counts);
    }
    let longest = counts.into_iter().rev().max_by_key(|(_, count)| *count)?;
    // Each line may have a few items of something, and still be the row.
    (values.len() == 1 || longest.1 > 3 * values.len()).then_some(longest.0)
}

fn count_lists(path: &str, value: &Value, counts: &mut IndexMap<String, usize>) {
    match value {
        Value::Object(members) => {
            for (name, member) in members {
                let dot = if path.is_empty() || path.ends_with('.') { "" } else { "." };
                count_lists(&format!("{path}{dot}{name}"), member, counts);
            }
        }
        Value::Array(items) if items.first().is_some_and(Value::is_object) => {
            let list = format!("{path}[]");
            *counts.entry(list.clone()).or_default() += items.len();
            for item in items {
                count_lists(&format!("{list}."), item, counts);
            }
        }
        _ => {}
    }
}

/// The names that a path may mean: its last part, and the last two, in small letters and digits alone.
pub(super) fn names_of(path: &str) -> [String; 2] {
    let small = |text: &str| text.chars().filter(char::is_ascii_alphanumeric).collect::<String>().to_ascii_lowercase();
    let mut parts = path.rsplit('.');
    let last = parts.next().unwrap_or_default();
    [small(last), small(parts.next().unwrap_or_default()) + &small(last)]
}

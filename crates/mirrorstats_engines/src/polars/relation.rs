//! A table in the course of a query: a frame, and what its columns are called in SQL.

use polars::prelude::{Expr, LazyFrame, col};

use super::accepted::Kind;
use super::value::Value;

#[derive(Clone, Debug)]
pub(super) struct Column {
    pub(super) table: String,
    pub(super) name: String,
    /// The name in the frame, which no other column of the query has.
    pub(super) inner: String,
    pub(super) kind: Kind,
    pub(super) bits: u32,
    /// The second of two columns of USING: not part of `*`.
    pub(super) hidden: bool,
}

impl Column {
    pub(super) fn value(&self) -> Value {
        Value { expr: col(self.inner.as_str()), kind: self.kind, bits: self.bits }
    }
}

#[derive(Clone)]
pub(super) struct Relation {
    pub(super) frame: LazyFrame,
    pub(super) columns: Vec<Column>,
}

impl Relation {
    /// The same table once more, under an alias.
    pub(super) fn renamed(&self, table: &str, mut fresh: impl FnMut() -> String) -> Self {
        let (mut columns, mut chosen): (Vec<Column>, Vec<Expr>) = (Vec::new(), Vec::new());
        for column in &self.columns {
            let inner = fresh();
            chosen.push(col(column.inner.as_str()).alias(inner.as_str()));
            columns.push(Column { table: table.to_owned(), inner, hidden: false, ..column.clone() });
        }
        Self { frame: self.frame.clone().select(chosen), columns }
    }
}

/// A resolved name.
pub(super) enum Found<'c> {
    One(&'c Column),
    Several,
    None,
}

/// The column of a name: the exact name first, then in any case, as in DuckDB.
pub(super) fn find<'c>(columns: &'c [Column], table: Option<&str>, name: &str) -> Found<'c> {
    let of_table = |column: &&Column| match table {
        Some(table) => column.table.eq_ignore_ascii_case(table),
        None => !column.hidden,
    };
    for same in [str::eq, str::eq_ignore_ascii_case] {
        let found: Vec<&Column> = columns.iter().filter(of_table).filter(|column| same(&column.name, name)).collect();
        match found.as_slice() {
            [] => {}
            [one] => return Found::One(one),
            _ => return Found::Several,
        }
    }
    Found::None
}

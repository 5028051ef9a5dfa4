//! A table in the course of a query: a frame, what its columns are called in SQL, and its order.

use std::cell::Cell;

use polars::prelude::{Expr, LazyFrame, SortMultipleOptions, col};
use sqlparser::ast::Ident;

use super::value::Value;

/// New names of columns: each is used once in a query.
#[derive(Default)]
pub(super) struct Names(Cell<usize>);

impl Names {
    pub(super) fn fresh(&self) -> String {
        self.0.set(self.0.get() + 1);
        format!("column {}", self.0.get())
    }

    /// Adds an expression under a new name to those that a frame will compute. Returns its column.
    pub(super) fn keep(&self, computed: &mut Vec<Expr>, expr: Expr) -> Expr {
        let name = self.fresh();
        computed.push(expr.alias(name.as_str()));
        col(name.as_str())
    }
}

#[derive(Clone, Debug)]
pub(super) struct Column {
    pub(super) table: String,
    pub(super) name: String,
    /// A column of the frame, with a name that no other column of the query has.
    pub(super) value: Value,
    /// The second of two columns of USING: not part of `*`.
    pub(super) hidden: bool,
}

#[derive(Clone)]
pub(super) struct Relation {
    pub(super) frame: LazyFrame,
    pub(super) columns: Vec<Column>,
}

impl Relation {
    /// The same table once more, under an alias.
    pub(super) fn renamed(&self, table: &str, names: &Names) -> Self {
        let mut chosen = Vec::new();
        let columns = self.columns.iter().map(|column| {
            let expr = names.keep(&mut chosen, column.value.expr.clone());
            let value = Value { expr, ..column.value.clone() };
            Column { table: table.to_owned(), value, hidden: false, ..column.clone() }
        });
        let columns = columns.collect();
        Self { frame: self.frame.clone().select(chosen), columns }
    }
}

/// The columns of a name: those with the exact name, else those with it in any case, as in DuckDB.
pub(super) fn find<'c>(columns: &'c [Column], table: Option<&Ident>, name: &Ident) -> Vec<&'c Column> {
    let of_table = |column: &&Column| match table {
        Some(table) => column.table.eq_ignore_ascii_case(&table.value),
        None => !column.hidden,
    };
    let named = |same: fn(&str, &str) -> bool| {
        columns.iter().filter(of_table).filter(|column| same(&column.name, &name.value)).collect::<Vec<_>>()
    };
    let exact = named(str::eq);
    if exact.is_empty() { named(str::eq_ignore_ascii_case) } else { exact }
}

/// A key of ORDER BY.
#[derive(Clone, Debug)]
pub(super) struct Order {
    pub(super) column: Expr,
    pub(super) descending: bool,
    pub(super) nulls_last: bool,
}

pub(super) fn sort(frame: LazyFrame, keys: &[Order]) -> LazyFrame {
    if keys.is_empty() {
        return frame;
    }
    let columns: Vec<Expr> = keys.iter().map(|key| key.column.clone()).collect();
    let options = SortMultipleOptions::new()
        .with_order_descending_multi(keys.iter().map(|key| key.descending))
        .with_nulls_last_multi(keys.iter().map(|key| key.nulls_last));
    frame.sort_by_exprs(columns, options)
}

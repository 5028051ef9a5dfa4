//! The columns of a trace, for unit tests.

use mirrorstats_trace::schema::{self, COLUMNS, Kind};

use crate::columns::{Column, Columns, Fallback, Level, Type};

pub(crate) fn schema_columns() -> Columns {
    let column = |column: &schema::Column| {
        let level = if column.constant { Level::Episode } else { Level::Step };
        type_of(column.stored.kind()).map(|ty| (column.name, Column { ty, level }))
    };
    let columns: Columns = COLUMNS.iter().filter(|column| column.name != "t").filter_map(column).collect();
    let lists = COLUMNS.iter().filter(|column| !column.values.is_empty()).map(|column| (column.name, column.values));
    let mut columns = columns.with_values(lists);
    for column in COLUMNS.iter() {
        if let Some(expression) = column.default {
            columns.set_fallback(column.name, Fallback { expression, is_read: column.required });
        }
    }
    columns
}

fn type_of(kind: Kind) -> Option<Type> {
    match kind {
        Kind::Bool => Some(Type::Bool),
        Kind::Int => Some(Type::Int),
        Kind::Float => Some(Type::Float),
        Kind::String => Some(Type::Text),
        Kind::Unsupported => None,
    }
}

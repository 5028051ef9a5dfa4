//! The columns of a trace, for unit tests.

use mirrorstats_trace::schema::{self, COLUMNS, Kind};

use crate::columns::{Column, ColumnOrigin, Columns, Fallback, KnownColumn, Level, Type};

pub(crate) fn schema_columns() -> Columns {
    let known = |column: &schema::Column| {
        let level = if column.constant { Level::Episode } else { Level::Step };
        let known = KnownColumn {
            column: Column { ty: type_of(column.stored.kind())?, level },
            origin: ColumnOrigin::Schema,
            values: column.values.iter().map(ToString::to_string).collect(),
            fallback: column.default.map(|expression| Fallback { expression, is_read: column.required }),
            decimals: None,
        };
        Some((column.name, known))
    };
    COLUMNS.iter().filter(|column| column.name != "t").filter_map(known).collect()
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

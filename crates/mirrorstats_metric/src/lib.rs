//! Definition files: metrics as data, checked and planned.
//!
//! ```text
//! file.rs ──► syntax ─────► bind ─────► logical_plan ──► (kernels in score)
//! (TOML)      (SQL text)    (names,     (typed
//!                            types,      operations)
//!                            levels)
//! ```
//!
//! A definition file can also become one SQL statement:
//!
//! ```
//! use mirrorstats_metric::columns::{Column, Columns, Level, Type};
//! use mirrorstats_metric::definitions::Definitions;
//! use mirrorstats_metric::sql::{Dialect, lower};
//!
//! let columns: Columns = [("reward", Column { ty: Type::Int, level: Level::Step })].into_iter().collect();
//! let text = "[metric.BEST]\ntitle = \"Best reward\"\nunit = \"points\"\nvalue = \"max(reward)\"\n";
//! let definitions = Definitions::from_toml("mine.toml", text, &columns).map_err(|error| error.to_string())?;
//! assert!(lower(&definitions.plan, Dialect::Portable).map_err(|error| error.to_string())?.contains("MAX("));
//! # Ok::<(), String>(())
//! ```
//!
//! Rule: this crate does not know trace readers, batches of steps or tables.

#![warn(clippy::print_stdout, clippy::print_stderr)]

mod bind;
pub mod catalogs;
pub mod columns;
pub mod definitions;
pub mod file;
mod functions;
pub mod logical_plan;
pub mod names;
pub mod shape;
pub mod sql;
pub mod syntax;

#[cfg(test)]
mod tests {
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
}

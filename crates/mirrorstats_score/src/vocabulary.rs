//! The columns that definitions may name: the schema's and the traces' own; and the columns that a question needs.

use super::error::ScoreError;
use mirrorstats_exact::suggest::nearest;
use mirrorstats_metric::columns::{Column, ColumnOrigin, Columns, Fallback, KnownColumn, Level, Type};
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_metric::file::ColumnEntry;
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::schema::domain::is_general;
use mirrorstats_trace::schema::{self, COLUMNS, DeclaredColumn, Domain, Kind};

/// The schema's columns, which definitions may name whether or not the traces have them.
pub fn schema_columns() -> Columns {
    // A trace without a required column is an exception that its experiment declares.
    of_schema(COLUMNS.iter(), |column| column.required)
}

/// The columns that definitions may name before any trace is open: like [`schema_columns`], but each row may have a
/// value.
pub fn unknown_columns() -> Columns {
    of_schema(COLUMNS.iter(), |_| true)
}

fn of_schema<'c>(
    columns: impl Iterator<Item = &'c schema::Column>,
    is_read: impl Fn(&schema::Column) -> bool,
) -> Columns {
    let known = |column: &'c schema::Column| {
        let level = if column.constant { Level::Episode } else { Level::Step };
        let fallback = |expression| Fallback { expression, is_read: is_read(column) };
        let known = KnownColumn {
            column: Column { ty: type_of(column.stored.kind())?, level },
            origin: if is_general(column.name) { ColumnOrigin::Schema } else { ColumnOrigin::Mirror },
            values: column.values.iter().map(ToString::to_string).collect(),
            fallback: column.default.map(fallback),
            decimals: None,
        };
        Some((column.name, known))
    };
    columns.filter(|column| column.name != "t").filter_map(known).collect()
}

/// The columns that definitions may name over these traces: the schema's and the traces' own.
pub fn trace_columns(traces: &TraceSet) -> Columns {
    let known = COLUMNS.iter().filter(|column| traces.knows(column));
    let mut columns = of_schema(known, |column| traces.declares(column.name))
        .with_help("`mirrorstats trace schema`, `trace info` and `trace labels` list the columns");
    for name in traces.label_columns() {
        columns.add(name, KnownColumn::new(Column { ty: Type::Bool, level: Level::Episode }, ColumnOrigin::Schema));
    }
    for name in traces.column_names().into_iter().filter(|name| *name != "t") {
        let Some(found) = traces.column(name) else { continue };
        let (ty, origin) = match type_of(found.kind) {
            _ if found.is_null => (Type::Text, ColumnOrigin::OnlyNulls),
            Some(ty) => (ty, ColumnOrigin::Own),
            None => continue,
        };
        columns.add(name, KnownColumn::new(Column { ty, level: Level::Step }, origin));
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

/// The type of a column of the traces; a column of nulls has the declared one. `None` if no trace has it.
pub fn kind_in(traces: &TraceSet, declared: &[DeclaredColumn], name: &str) -> Option<Kind> {
    let found = traces.column(name)?;
    let declared = declared.iter().find(|column| found.is_null && column.name == name);
    Some(declared.map_or(found.kind, |column| column.kind))
}

/// Checks that every column that is read is in every file, with one type.
pub fn check_columns(traces: &TraceSet, definitions: &Definitions) -> Result<(), ScoreError> {
    let plan = &definitions.plan;
    let outputs = plan.outputs.iter().map(|output| (output.name.as_str(), output.node));
    for (wanted_by, node) in outputs.chain(plan.filter.map(|node| ("--where", node))) {
        for (column, _) in plan.columns(&plan.needed_by([node])) {
            if let Some((problem, help)) = column_problem(traces, column) {
                let (wanted_by, column) = (wanted_by.to_owned(), column.to_owned());
                return Err(ScoreError::Column { wanted_by, column, problem, help });
            }
        }
    }
    Ok(())
}

fn column_problem(traces: &TraceSet, column: &str) -> Option<(String, String)> {
    let absent = || "record it, or choose other metrics with --metrics".to_owned();
    let has_default =
        traces.domain().column(column).is_some_and(|known| known.default.is_some() || known.is_of_some_tasks);
    let Some(found) = traces.column(column) else { return Some(("no trace has it".to_owned(), absent())) };
    if let Some([(first, a), (second, b)]) = found.conflict {
        let problem = format!("it is {} in `{first}` and {} in `{second}`", a.name(), b.name());
        return Some((problem, "write it with one type in all traces".to_owned()));
    }
    found.missing_from.filter(|_| !has_default).map(|file| (format!("`{file}` has no such column"), absent()))
}

pub fn declared_columns(definitions: &Definitions) -> Vec<DeclaredColumn> {
    let own = |(name, entry): (&str, &ColumnEntry)| DeclaredColumn {
        name: name.to_owned(),
        kind: kind_of(entry.column.ty),
        values: entry.values.clone(),
        constant: entry.column.level == Level::Episode,
    };
    definitions.declared_columns().map(own).collect()
}

const fn kind_of(ty: Type) -> Kind {
    match ty {
        Type::Bool => Kind::Bool,
        Type::Int => Kind::Int,
        Type::Float => Kind::Float,
        Type::Text => Kind::String,
    }
}

/// Returns true if a column of the schema has one value in all steps of an episode.
pub fn is_constant(name: &str) -> bool {
    COLUMNS.iter().any(|column| column.name == name && column.constant)
}

/// Refuses a column to group by that varies within an episode, or that some trace lacks.
pub fn check_label(traces: &TraceSet, label: &str) -> Result<(), ScoreError> {
    if traces.is_label_column(label) {
        return Ok(());
    }
    let problem = column_problem(traces, label);
    // Optional columns are null in traces without them, or have a meaning for missing values.
    let is_known_anyway = traces.domain().column(label).is_some_and(|known| {
        let found = traces.column(label);
        known.default_text().is_some() || !known.required && found.is_some_and(|found| found.conflict.is_none())
    });
    // Reading shows whether an own column varies between steps.
    let is_constant = |name: &str| match traces.domain() {
        Domain::Mirror => is_constant(name),
        Domain::Own => {
            name != "t" && traces.column(name).is_some_and(|column| matches!(column.kind, Kind::Int | Kind::String))
        }
    };
    if is_constant(label) && (problem.is_none() || is_known_anyway) {
        return Ok(());
    }
    let known = traces.column_names().into_iter().filter(|name| is_constant(name)).map(str::to_owned);
    let known: Vec<String> = known.chain(traces.label_columns().iter().cloned()).collect();
    let near = nearest(label, known.iter().map(String::as_str)).filter(|near| *near != label);
    let help = match (near, problem) {
        (Some(near), _) => format!("did you mean `{near}`?"),
        (None, Some((problem, _))) => problem,
        (None, None) => "its value changes from step to step".to_owned(),
    };
    Err(ScoreError::Label { name: label.to_owned(), known, help })
}

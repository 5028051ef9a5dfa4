//! A SELECT over the steps, episodes and cells of a study.

use mirrorstats_engines::polars::answer::{Format, plan};
use mirrorstats_engines::polars::refused::QueryError;
use mirrorstats_engines::polars::shared_file::in_memory;
use mirrorstats_engines::polars::statement::{self, Checked, Table};
use mirrorstats_engines::polars::tables;
use mirrorstats_score::vocabulary::declared_columns;
use mirrorstats_toml_spec::Faults;
use mirrorstats_trace::schema::DeclaredColumn;
use polars::prelude::LazyFrame;

use crate::{Study, StudyError};

/// The lazy answer to a checked query, and a note if the filter keeps nothing. Computes only the tables that it
/// names. Errors: a query that DuckDB would answer differently, with the same query for DuckDB.
pub fn query(study: &Study, query: &Checked) -> Result<(LazyFrame, Option<String>), StudyError> {
    let (mut loaded, mut note) = (Vec::new(), None);
    if query.tables.contains(&Table::Steps) {
        loaded.push((Table::Steps, tables::steps(study.traces()?, &own_columns(study))?));
    }
    if query.tables.contains(&Table::Episodes) || query.tables.contains(&Table::Cells) {
        let scores = study.score()?.episodes;
        note = study.empty_filter(scores.len())?;
        loaded.push((Table::Episodes, tables::episodes(&scores)?));
        if query.tables.contains(&Table::Cells) {
            loaded.push((Table::Cells, tables::cells(&study.cells_of(&scores)?)?));
        }
    }
    let frame = plan(query, loaded).map_err(|error| match error {
        QueryError::Faults(faults) => StudyError::from(faults),
        QueryError::Polars(error) => error.into(),
        QueryError::Unsupported(mut fault) => {
            let other = fault.help.take().map(|help| format!("{help}; or ")).unwrap_or_default();
            let help = format!("{other}{}", in_duckdb(study, query));
            Faults(vec![fault.help(help)]).into()
        }
    })?;
    Ok((frame, note))
}

/// A command line with which DuckDB answers the same query.
pub fn in_duckdb(study: &Study, query: &Checked) -> String {
    let is_in_files = |table| {
        let has_labels = |traces: &mirrorstats_trace::read::open::TraceSet| {
            traces.column_names().iter().any(|name| traces.is_label_column(name))
        };
        table == Table::Steps && study.traces().is_ok_and(|traces| !has_labels(traces))
    };
    let (mut exports, mut views) = (String::new(), String::new());
    for table in query.tables.iter().copied() {
        let name = table.name();
        let from = if is_in_files(table) {
            let files = study.inputs.iter().map(|input| sql_text(&input.path.to_string_lossy())).collect::<Vec<_>>();
            format!("read_parquet([{}], union_by_name = true, hive_partitioning = false)", files.join(", "))
        } else {
            exports.push_str(&export(study, name));
            sql_text(&format!("{name}.parquet"))
        };
        views.extend(["CREATE VIEW ", name, " AS SELECT * FROM ", &from, "; "]);
    }
    format!("run it in DuckDB: {exports}duckdb -c {}", shell_text(&format!("{views}{}", query.on_one_line())))
}

fn export(study: &Study, table: &str) -> String {
    let question = &study.question;
    let option = |name: &str, value: Option<String>| {
        value.map(|value| format!(" {name} {}", shell_text(&value))).unwrap_or_default()
    };
    let names = study.inputs.iter().map(|input| shell_text(&input.path.to_string_lossy())).collect::<Vec<_>>();
    let files = names.join(" ");
    let definitions = question.definitions.as_ref().map(|name| name.to_string_lossy().into_owned());
    format!(
        "mirrorstats query {} {files}{}{}{} -o {table}.parquet && ",
        shell_text(&format!("SELECT * FROM {table}")),
        option("--definitions", definitions),
        option("--metrics", question.metrics.as_ref().map(|names| names.join(","))),
        option("--where", question.filter.clone()),
    )
}

/// The columns that the definitions declare; none if the definitions do not fit the traces.
fn own_columns(study: &Study) -> Vec<DeclaredColumn> {
    let definitions = study.traces().and_then(|traces| study.question.bind(traces));
    definitions.map(|definitions| declared_columns(&definitions)).unwrap_or_default()
}

/// The rows of a query as a Parquet file in memory. Errors: a query that cannot be run; faults of the inputs.
pub fn query_parquet(study: &Study, sql: &str) -> Result<Vec<u8>, StudyError> {
    let (frame, _) = query(study, &statement::check(sql)?)?;
    Ok(in_memory(frame, Format::Parquet)?)
}

fn sql_text(text: &str) -> String {
    format!("'{}'", text.replace('\'', "''"))
}

fn shell_text(text: &str) -> String {
    format!("'{}'", text.replace('\'', r"'\''"))
}

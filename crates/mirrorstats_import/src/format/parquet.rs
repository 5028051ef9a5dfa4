//! Parquet of any shape: one row per step, with the values of its columns unchanged.

use std::fs::File;
use std::sync::Arc;

use ::parquet::arrow::parquet_to_arrow_schema;
use ::parquet::file::metadata::ParquetMetaData;
use ::parquet::schema::types::Type;
use arrow::array::RecordBatch;
use arrow::datatypes::DataType;

use crate::error::{Fault, ImportError};
use crate::rows::Rows;
use mirrorstats_exact::budget::Limit;
use mirrorstats_trace::catch_panic::contained;
use mirrorstats_trace::diagnostic::{Code, Finding};
use mirrorstats_trace::read::flat::table_rows;
use mirrorstats_trace::read::footer::{Extent, Footer, footer_of};

/// The most values that an import reads one by one: rows of constant columns take no bytes.
const fn most_imported(bytes: u64) -> Limit {
    Limit::in_proportion("rows times columns of a file of its size", 8_000_000, 16, bytes)
}

pub(super) fn read(file: File, rows: &mut Rows<'_>) -> Result<(), ImportError> {
    each_batch(file, rows, &[], |batch, rows| rows.add_table(&batch))
}

/// The rows of a file in batches: its flat columns, and the nested ones that the mapping or `also` names. The other
/// nested columns are counted as left out.
pub(super) fn each_batch(
    file: File,
    rows: &mut Rows<'_>,
    also: &[&str],
    add: impl FnMut(RecordBatch, &mut Rows<'_>) -> Result<(), ImportError>,
) -> Result<(), ImportError> {
    let choose = |root: &Type, count, rows: &mut Rows<'_>| {
        let is_wanted = !root.is_group() || also.contains(&root.name()) || rows.mapping.reads(root.name());
        if !is_wanted {
            rows.notes.leave_out(root.name(), count);
        }
        is_wanted
    };
    each_batch_of(file, rows, choose, add)
}

/// The rows of a file in batches, with the columns that `choose` wants, given their types and the number of rows.
pub(super) fn each_batch_of(
    mut file: File,
    rows: &mut Rows<'_>,
    choose: impl Fn(&Type, u64, &mut Rows<'_>) -> bool,
    mut add: impl FnMut(RecordBatch, &mut Rows<'_>) -> Result<(), ImportError>,
) -> Result<(), ImportError> {
    let Footer { metadata, chunks, bytes, .. } =
        footer_of(&rows.file, &mut file, Extent::Pages).map_err(|finding| refused(rows, *finding))?;
    let count = u64::try_from(metadata.file_metadata().num_rows()).unwrap_or_default();
    let roots = metadata.file_metadata().schema_descr().root_schema().get_fields().to_vec();
    if let Some(twice) =
        roots.iter().enumerate().find(|(at, root)| roots[..*at].iter().any(|b| b.name() == root.name()))
    {
        let finding = Finding::new(Code::RepeatedColumn, &rows.file, "one column of that name", "more than one");
        return Err(refused(rows, finding.in_column(twice.1.name())));
    }
    let durations = durations(&metadata);
    if let Some(root) = roots.iter().find(|root| durations.iter().any(|name| name == root.name())) {
        let help = "cast it where the file is written, to an integer whose name says the unit, such as `latency_ms`";
        let finding = Finding::new(Code::WrongType, &rows.file, "a column without a unit in its type", "durations");
        return Err(refused(rows, finding.in_column(root.name()).with_help(help)));
    }
    let wanted: Vec<_> = (0..roots.len()).filter(|at| choose(&roots[*at], count, rows)).collect();
    if let Err(exceeded) = most_imported(bytes).check(count.saturating_mul(wanted.len() as u64)) {
        return Err(refused(rows, Finding::over_budget(&rows.file, &exceeded)));
    }
    let opened = table_rows(&rows.file, file, Arc::new(metadata), chunks, Some(wanted.as_slice()));
    for batch in opened.map_err(|finding| refused(rows, *finding))? {
        add(batch.map_err(|finding| refused(rows, *finding))?, rows)?;
    }
    Ok(())
}

/// The columns that Arrow's schema in the footer declares as durations: Parquet has only their integers.
fn durations(metadata: &ParquetMetaData) -> Vec<String> {
    let file = metadata.file_metadata();
    let schema = contained(|| parquet_to_arrow_schema(file.schema_descr(), file.key_value_metadata()));
    let fields = schema.ok().and_then(Result::ok).map(|schema| schema.fields().clone()).unwrap_or_default();
    let durations = fields.iter().filter(|field| matches!(field.data_type(), DataType::Duration(_)));
    durations.map(|field| field.name().clone()).collect()
}

fn refused(rows: &Rows<'_>, finding: Finding) -> ImportError {
    let Finding { column, expected, found, help, .. } = finding;
    Fault { file: rows.file.clone(), key: column, ..Fault::new(expected, found, help) }.into()
}

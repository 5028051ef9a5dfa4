//! Part of an episode table: some metrics, some episodes.
//!
//! A table of scores has no steps, so a condition can name keys, labels and metrics, but no aggregates. The same engine
//! evaluates it, with each episode as one step.

use std::sync::Arc;

use arrow::array::{ArrayRef, BooleanArray, RecordBatch, RecordBatchOptions};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Field, Schema};
use arrow::error::ArrowError;

use crate::error::EngineError;
use crate::kernels::evaluate::Batch;
use crate::kernels::segments::Segments;
use crate::physical::PhysicalPlan;
use crate::tables::columns;
use crate::tables::table::{EpisodeTable, LabelColumn};
use mirrorstats_metric::columns::{Column, Columns, Level, Type};
use mirrorstats_metric::definitions::{Definitions, UnknownMetric};
use mirrorstats_metric::file::FileError;
use mirrorstats_parquet_pages::text_type;
use mirrorstats_toml_spec::Faults;
use mirrorstats_trace::beside::labels;

#[derive(Debug, thiserror::Error)]
pub enum SelectError {
    #[error(transparent)]
    Metric(#[from] UnknownMetric),
    #[error("{0}")]
    Condition(#[from] Faults),
    #[error(transparent)]
    Engine(#[from] EngineError),
    #[error("the scores cannot be laid out in columns: {0}")]
    Layout(#[from] ArrowError),
}

/// The metrics named (all if absent) of the episodes where `condition` holds (all if absent).
pub fn select(
    table: EpisodeTable,
    metrics: Option<&[String]>,
    condition: Option<&str>,
) -> Result<EpisodeTable, SelectError> {
    let mut table = match condition {
        Some(condition) => filtered(&table, condition)?,
        None => table,
    };
    if let Some(names) = metrics {
        let known: Vec<String> = table.metrics.iter().map(|metric| metric.name.clone()).collect();
        if let Some(name) = names.iter().find(|name| !known.contains(name)) {
            return Err(UnknownMetric::new(name, &known).into());
        }
        table.metrics.retain(|metric| names.contains(&metric.name));
    }
    Ok(table)
}

fn filtered(table: &EpisodeTable, condition: &str) -> Result<EpisodeTable, SelectError> {
    let values = typed_columns(table)?;
    let columns: Columns =
        values.iter().map(|(name, ty, _)| (name.as_str(), Column { ty: *ty, level: Level::Episode })).collect();
    let columns = columns.with_help("scores have their keys and metrics alone; a condition on steps needs the traces");
    let none = match Definitions::from_toml("scores", "", &columns) {
        Ok(none) => none,
        Err(FileError::Faults(faults)) => return Err(faults.into()),
        Err(FileError::Unreadable { .. }) => unreachable!("a text includes no file"),
    };
    let definitions = none.filtered("--where", condition, &columns)?;
    let offsets: Vec<usize> = (0..=table.len()).collect();
    let fields = values.iter().map(|(name, _, array)| Field::new(name, array.data_type().clone(), true));
    let schema = Arc::new(Schema::new(fields.collect::<Vec<_>>()));
    let episodes = RecordBatch::try_new(schema, values.into_iter().map(|(.., array)| array).collect())?;
    let steps = RecordBatch::try_new_with_options(
        Arc::new(Schema::empty()),
        vec![],
        &RecordBatchOptions::new().with_row_count(Some(table.len())),
    )?;
    let batch = Batch { segments: Segments::new(&offsets), steps: &steps, texts: &[], episodes: &episodes };
    let plan = PhysicalPlan::of(&[&definitions.plan]);
    let kept = plan.evaluate(&batch)?.scores(&plan.scores[0])?.kept;
    let kept: Vec<usize> = kept.iter().flat_map(|kept| kept.values().set_indices()).collect();
    Ok(table.taken(&kept))
}

pub fn is_of_coders(label: &LabelColumn) -> bool {
    label.name.starts_with(labels::PREFIX) && label.values.iter().flatten().all(|text| matches!(text, "true" | "false"))
}

pub fn truths_of(label: &LabelColumn) -> impl Iterator<Item = Option<bool>> + '_ {
    label.values.iter().map(|text| text.map(|text| text == "true"))
}

fn typed_columns(table: &EpisodeTable) -> Result<Vec<(String, Type, ArrayRef)>, ArrowError> {
    let schema = columns::schema(&table.header());
    let typed = |(at, field): (usize, &Arc<Field>)| {
        let label = table.labels.iter().find(|label| label.name == *field.name());
        if let Some(label) = label.filter(|label| is_of_coders(label)) {
            let truths = Arc::new(truths_of(label).collect::<BooleanArray>());
            return Ok((label.name.clone(), Type::Bool, truths as ArrayRef));
        }
        let values = columns::values(table, at, 0..table.len())?;
        let (ty, held) =
            if *field.data_type() == DataType::Utf8 { (Type::Text, text_type()) } else { (Type::Int, DataType::Int64) };
        Ok((field.name().clone(), ty, cast(&values, &held)?))
    };
    schema.fields().iter().enumerate().map(typed).collect()
}

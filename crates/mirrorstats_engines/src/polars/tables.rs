//! The tables of a query: steps as in the files, episodes and cells as the native engine computes them.

use polars::prelude::{Column, DataFrame, IntoLazy as _, LazyFrame};

use super::frame::{self, FrameColumn};
use super::run::PolarsError;
use mirrorstats_exact::moments::Moments;
use mirrorstats_score::cells::{Cell, Cells, KeyValue};
use mirrorstats_score::tables::select::{is_of_coders, truths_of};
use mirrorstats_score::tables::table::{EpisodeTable, KeyRef, MetricColumn};
use mirrorstats_score::vocabulary::kind_in;
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::schema::DeclaredColumn;

/// The steps of all files with all their columns; an absent column is null, and a column of nulls has its
/// declared type.
pub fn steps(traces: &TraceSet, declared: &[DeclaredColumn]) -> Result<LazyFrame, PolarsError> {
    let mut columns = Vec::new();
    for name in traces.column_names() {
        let Some(found) = traces.column(name) else { continue };
        if let Some([(first, a), (second, b)]) = found.conflict {
            let problem = format!("`{name}` is {} in `{first}` and {} in `{second}`", a.name(), b.name());
            return Err(PolarsError::Failed(format!("{problem}; write it with one type in all traces")));
        }
        let kind = kind_in(traces, declared, name).unwrap_or(found.kind);
        columns.push(FrameColumn::natural(traces, name, kind));
    }
    frame::steps(traces, &columns)
}

pub fn episodes(table: &EpisodeTable) -> Result<LazyFrame, PolarsError> {
    let text = |name: &str, of: fn(KeyRef<'_>) -> &str| {
        Column::new(name.into(), table.keys.iter().map(of).collect::<Vec<_>>())
    };
    let int =
        |name: &str, of: fn(KeyRef<'_>) -> i32| Column::new(name.into(), table.keys.iter().map(of).collect::<Vec<_>>());
    let mut columns = vec![
        text("episode_id", |key| key.episode_id),
        text("model", |key| key.model),
        text("experiment", |key| key.experiment),
        int("seed", |key| key.seed),
        int("run", |key| key.run),
    ];
    let of_coders = table.labels.iter().filter(|label| is_of_coders(label));
    columns
        .extend(of_coders.map(|label| Column::new(label.name.as_str().into(), truths_of(label).collect::<Vec<_>>())));
    let values = |metric: &MetricColumn| metric.iter().collect::<Vec<Option<i64>>>();
    columns.extend(table.metrics.iter().map(|metric| Column::new(metric.name.as_str().into(), values(metric))));
    Ok(DataFrame::new(table.len(), columns)?.lazy())
}

/// The cells: the keys, then `metric, n, sum, sum_sq, mean, se, ci_low, ci_high`, one row per group and metric.
pub fn cells(cells: &Cells) -> Result<LazyFrame, PolarsError> {
    let rows: Vec<Cell> = cells.all().collect();
    let mut columns = Vec::new();
    for (at, name) in cells.by.iter().enumerate() {
        let texts: Vec<Option<String>> = rows.iter().map(|row| text_of(&row.key[at])).collect();
        columns.push(Column::new(name.as_str().into(), texts));
    }
    let int = |name: &str, of: fn(&Moments) -> i128| {
        let values: Result<Vec<i64>, _> = rows.iter().map(|row| i64::try_from(of(row.moments))).collect();
        let values =
            values.map_err(|_| PolarsError::Failed(format!("the column `{name}` of cells overflows 64 bits")))?;
        Ok::<_, PolarsError>(Column::new(name.into(), values))
    };
    let float =
        |name: &str, of: fn(&Cell) -> Option<f64>| Column::new(name.into(), rows.iter().map(of).collect::<Vec<_>>());
    columns.push(Column::new("metric".into(), rows.iter().map(|row| row.name).collect::<Vec<_>>()));
    columns.push(int("n", |moments| moments.n.into())?);
    columns.push(int("sum", |moments| moments.sum)?);
    columns.push(int("sum_sq", |moments| moments.sum_sq)?);
    columns.push(float("mean", |row| row.moments.mean()));
    columns.push(float("se", |row| row.moments.se(row.metric.se)));
    columns.push(float("ci_low", |row| row.interval.map(|interval| interval.low)));
    columns.push(float("ci_high", |row| row.interval.map(|interval| interval.high)));
    Ok(DataFrame::new(rows.len(), columns)?.lazy())
}

fn text_of(key: &KeyValue) -> Option<String> {
    match key {
        KeyValue::Missing => None,
        other => Some(other.to_string()),
    }
}

//! The tables of a query: steps as in the files, episodes and cells as the native engine computes them.

use std::fs;

use polars::prelude::{
    Column, DataFrame, DataType, Expr, HiveOptions, IntoLazy as _, LazyFrame, NULL, NamedFrom, PlRefPath,
    ScanArgsParquet, ScanSources, Series, UnionArgs, col, concat, lit, when,
};

use super::run::{PolarsError, collect};
use mirrorstats_exact::moments::Moments;
use mirrorstats_score::cells::{Cell, Cells};
use mirrorstats_score::tables::select::{is_of_coders, truths_of};
use mirrorstats_score::tables::table::{EpisodeTable, KeyRef, MetricColumn};
use mirrorstats_score::vocabulary::kind_in;
use mirrorstats_trace::beside::labels::Labels;
use mirrorstats_trace::error::TraceError;
use mirrorstats_trace::read::open::{TraceFile, TraceSet};
use mirrorstats_trace::read::verify::verify_pages;
use mirrorstats_trace::schema::{DeclaredColumn, Kind, Stored};

/// The type of columns that queries do not read: their values are not loaded.
const UNREAD: DataType = DataType::Binary;

/// The steps of all files with all their columns, in order; an absent column is null, and a column of nulls has its
/// declared type. Rows are read when the frame is collected. Polars does not verify page checksums, so they are verified
/// here.
pub fn steps(traces: &TraceSet, declared: &[DeclaredColumn]) -> Result<LazyFrame, PolarsError> {
    let mut columns = Vec::new();
    for name in traces.column_names() {
        let Some(found) = traces.column(name) else { continue };
        if let Some([(first, a), (second, b)]) = found.conflict {
            let problem = format!("`{name}` is {} in `{first}` and {} in `{second}`", a.name(), b.name());
            return Err(PolarsError::Failed(format!("{problem}; write it with one type in all traces")));
        }
        let kind = kind_in(traces, declared, name).unwrap_or(found.kind);
        columns.push((name, type_of(traces, name, kind)));
    }
    verify_pages(traces)?;
    traces.files().iter().try_for_each(check_folders)?;
    let (labels, read): (Vec<_>, Vec<_>) = columns.into_iter().partition(|(name, _)| traces.is_label_column(name));
    let scan = |file: &TraceFile| {
        Ok::<_, PolarsError>(
            whole(file)?.select(read.iter().map(|(name, ty)| of_file(file, name, ty)).collect::<Vec<_>>()),
        )
    };
    let frames = traces.files().iter().map(scan).collect::<Result<Vec<_>, _>>()?;
    let frame = concat(frames, UnionArgs { rechunk: false, ..UnionArgs::default() })?;
    let labels: Vec<Expr> = labels.into_iter().map(|(name, _)| label(traces.labels(), name)).collect();
    Ok(if labels.is_empty() { frame } else { frame.with_columns(labels) })
}

/// The schema's type of a column; for an unknown column, the widest type of its kind in the files.
fn type_of(traces: &TraceSet, name: &str, kind: Kind) -> DataType {
    let is_single = || traces.files().iter().filter_map(|file| file.column(name)).all(|column| column.is_single);
    match (traces.schema_column(name).map(|known| known.stored), kind) {
        (Some(Stored::Bool), _) | (None, Kind::Bool) => DataType::Boolean,
        (Some(Stored::Int8), _) => DataType::Int8,
        (Some(Stored::Int32), _) => DataType::Int32,
        (Some(Stored::Int64), _) | (None, Kind::Int) => DataType::Int64,
        (Some(Stored::Float32), _) => DataType::Float32,
        (None, Kind::Float) if is_single() => DataType::Float32,
        (Some(Stored::Float64), _) | (None, Kind::Float) => DataType::Float64,
        (Some(Stored::String), _) | (None, Kind::String) => DataType::String,
        (None, Kind::Unsupported) => UNREAD,
    }
}

fn of_file(file: &TraceFile, name: &str, ty: &DataType) -> Expr {
    let is_read = *ty != UNREAD && file.column(name).is_some_and(|column| column.kind.is_some());
    let values = match file.folder(name).map(|folder| folder.value()) {
        Some(value) => value.map_or(lit(NULL), lit),
        None if is_read => col(name),
        None => lit(NULL),
    };
    values.strict_cast(ty.clone()).alias(name)
}

fn label(labels: &Labels, name: &str) -> Expr {
    let ids = |wanted: bool| {
        let ids: Vec<&str> = labels.episodes().filter(|id| labels.value(name, id) == Some(wanted)).collect();
        let list = lit(Series::new("ids".into(), ids)).implode(false);
        col("episode_id").cast(DataType::String).is_in(list, false)
    };
    when(ids(true)).then(lit(true)).when(ids(false)).then(lit(false)).otherwise(lit(NULL)).alias(name)
}

/// Refuses a column of the file whose values differ from the name of a folder.
fn check_folders(file: &TraceFile) -> Result<(), PolarsError> {
    for folder in file.folders().iter().filter(|folder| file.folder(&folder.column.name).is_none()) {
        let (name, Some(value)) = (folder.column.name.as_str(), folder.value()) else { continue };
        let own = col(name).cast(DataType::String);
        let others = collect(whole(file)?.select([own.clone().filter(own.neq(lit(value)))]).limit(1))?;
        if let Some(found) = others.columns()[0].str()?.iter().flatten().next() {
            return Err(TraceError::from(folder.contradicted(file.name(), found)).into());
        }
    }
    Ok(())
}

fn whole(file: &TraceFile) -> Result<LazyFrame, PolarsError> {
    let gone = |source| PolarsError::Unreadable { file: file.name().to_owned(), source };
    // An absolute path cannot be mistaken for a network address.
    let path = fs::canonicalize(file.path()).map_err(gone)?;
    let hive_options = HiveOptions::new_disabled();
    let options = ScanArgsParquet { glob: false, cache: false, hive_options, ..ScanArgsParquet::default() };
    Ok(if path.to_str().is_some() {
        LazyFrame::scan_parquet(PlRefPath::try_from_path(&path)?, options)?
    } else {
        // Polars takes paths as text; a path that is not valid text is opened here.
        let opened = file.reader().map_err(gone)?;
        LazyFrame::scan_parquet_sources(ScanSources::Files([opened].into()), options)?
    })
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
        let texts: Vec<Option<String>> = rows.iter().map(|row| row.key[at].text()).collect();
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

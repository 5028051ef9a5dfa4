//! Traces as one lazy frame: every file has the same columns and types, with nulls for absent columns.

use std::fs;

use polars::prelude::{
    DataType, Expr, HiveOptions, LazyFrame, NULL, NamedFrom, PlRefPath, ScanArgsParquet, ScanSources, Series,
    UnionArgs, col, concat, lit, when,
};

use super::run::{PolarsError, collect};
use mirrorstats_trace::beside::labels::Labels;
use mirrorstats_trace::error::TraceError;
use mirrorstats_trace::read::open::{TraceFile, TraceSet};
use mirrorstats_trace::read::verify::verify_pages;
use mirrorstats_trace::schema::{Kind, Stored};

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameColumn {
    pub name: String,
    /// `None` for a type that queries do not read: its values are not loaded.
    pub stored: Option<Stored>,
}

impl FrameColumn {
    /// A column of the schema's type; for an unknown column, the widest type of its kind in the files.
    pub fn natural(traces: &TraceSet, name: &str, kind: Kind) -> Self {
        let is_single = || traces.files().iter().filter_map(|file| file.column(name)).all(|column| column.is_single);
        let stored = match (traces.schema_column(name), kind) {
            (Some(known), _) => Some(known.stored),
            (None, Kind::Bool) => Some(Stored::Bool),
            (None, Kind::Int) => Some(Stored::Int64),
            (None, Kind::Float) => Some(if is_single() { Stored::Float32 } else { Stored::Float64 }),
            (None, Kind::String) => Some(Stored::String),
            (None, Kind::Unsupported) => None,
        };
        Self { name: name.to_owned(), stored }
    }

    fn data_type(&self) -> DataType {
        let Some(stored) = self.stored else { return DataType::Binary };
        match stored {
            Stored::Bool => DataType::Boolean,
            Stored::Int8 => DataType::Int8,
            Stored::Int32 => DataType::Int32,
            Stored::Int64 => DataType::Int64,
            Stored::Float32 => DataType::Float32,
            Stored::Float64 => DataType::Float64,
            Stored::String => DataType::String,
        }
    }

    fn of(&self, file: &TraceFile) -> Expr {
        let is_read = self.stored.is_some() && file.column(&self.name).is_some_and(|column| column.kind.is_some());
        let values = match file.folder(&self.name).map(|folder| folder.value()) {
            Some(value) => value.map_or(lit(NULL), lit),
            None if is_read => col(self.name.as_str()),
            None => lit(NULL),
        };
        values.strict_cast(self.data_type()).alias(self.name.as_str())
    }
}

/// The steps of all files, in order; rows are read when the frame is collected. Polars does not verify page checksums,
/// so they are verified here.
pub fn steps(traces: &TraceSet, columns: &[FrameColumn]) -> Result<LazyFrame, PolarsError> {
    verify_pages(traces)?;
    let (labels, read): (Vec<&FrameColumn>, Vec<&FrameColumn>) =
        columns.iter().partition(|column| traces.is_label_column(&column.name));
    traces.files().iter().try_for_each(check_folders)?;
    let frames = traces.files().iter().map(|file| scan(file, &read)).collect::<Result<Vec<_>, _>>()?;
    let frame = concat(frames, UnionArgs { rechunk: false, ..UnionArgs::default() })?;
    let labels: Vec<Expr> = labels.into_iter().map(|column| label(traces.labels(), &column.name)).collect();
    Ok(if labels.is_empty() { frame } else { frame.with_columns(labels) })
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

fn scan(file: &TraceFile, columns: &[&FrameColumn]) -> Result<LazyFrame, PolarsError> {
    Ok(whole(file)?.select(columns.iter().map(|column| column.of(file)).collect::<Vec<_>>()))
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

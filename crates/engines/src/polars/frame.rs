//! Traces as one lazy frame: every file has the same columns and types, with nulls for absent columns.

use std::fs;

use polars::prelude::{
    DataType, Expr, HiveOptions, LazyFrame, NULL, NamedFrom, PlRefPath, ScanArgsParquet, ScanSources, Series,
    UnionArgs, col, concat, lit, when,
};

use super::run::PolarsError;
use trace::labels::Labels;
use trace::open::{TraceFile, TraceSet};
use trace::schema::{Kind, Stored};
use trace::verify::verify_pages;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameColumn {
    pub name: String,
    pub stored: Stored,
}

impl FrameColumn {
    pub fn wide(name: &str, kind: Kind) -> Option<Self> {
        let stored = match kind {
            Kind::Bool => Stored::Bool,
            Kind::Int => Stored::Int64,
            Kind::Float => Stored::Float64,
            Kind::String => Stored::String,
            Kind::Unsupported => return None,
        };
        Some(Self { name: name.to_owned(), stored })
    }

    /// A column of the schema's type; for an unknown column, the widest type of its kind.
    pub fn natural(traces: &TraceSet, name: &str, kind: Kind) -> Option<Self> {
        match traces.schema_column(name) {
            Some(known) => Some(Self { name: name.to_owned(), stored: known.stored }),
            None => Self::wide(name, kind),
        }
    }

    fn data_type(&self) -> DataType {
        match self.stored {
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
        let present = file.column(&self.name).is_some_and(|column| column.kind.is_some());
        let values = if present { col(self.name.as_str()) } else { lit(NULL) };
        values.strict_cast(self.data_type()).alias(self.name.as_str())
    }
}

/// The steps of all files, in order; rows are read when the frame is collected. Polars does not verify page checksums,
/// so they are verified here.
pub fn steps(traces: &TraceSet, columns: &[FrameColumn]) -> Result<LazyFrame, PolarsError> {
    verify_pages(traces)?;
    let (labels, read): (Vec<&FrameColumn>, Vec<&FrameColumn>) =
        columns.iter().partition(|column| traces.is_label_column(&column.name));
    for file in traces.files() {
        if let Some(column) = read.iter().find(|column| file.folder(&column.name).is_some()) {
            let expected = format!("{}: expected the column `{}` in the file", file.name(), column.name);
            let help = "`mirrorstats import` the files first";
            return Err(PolarsError::Failed(format!("{expected}, found it in the name of a folder\n  help: {help}")));
        }
    }
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

fn scan(file: &TraceFile, columns: &[&FrameColumn]) -> Result<LazyFrame, PolarsError> {
    let gone = |source| PolarsError::Unreadable { file: file.name().to_owned(), source };
    // An absolute path cannot be mistaken for a network address.
    let path = fs::canonicalize(file.path()).map_err(gone)?;
    let options = ScanArgsParquet { glob: false, cache: false, ..ScanArgsParquet::default() };
    let frame = if path.to_str().is_some() {
        LazyFrame::scan_parquet(PlRefPath::try_from_path(&path)?, options)?
    } else {
        // Polars takes paths as text; a path that is not valid text is opened here.
        let opened = file.reader().map_err(gone)?;
        let options = ScanArgsParquet { hive_options: HiveOptions::new_disabled(), ..options };
        LazyFrame::scan_parquet_sources(ScanSources::Files([opened].into()), options)?
    };
    Ok(frame.select(columns.iter().map(|column| column.of(file)).collect::<Vec<_>>()))
}

//! Gathers rows by column for the row groups of a file; an episode is never in two row groups.
//!
//! Rule: every trace gets its checksums here or in `seal`.

use std::io::Write;
use std::sync::Arc;

use arrow::array::{ArrayRef, BooleanBuilder, Float64Builder, Int64Builder, NullArray, RecordBatch, StringBuilder};
use arrow::compute::cast;
use arrow::datatypes::{Field, Schema, SchemaRef};
use arrow::error::ArrowError;
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_writer::ArrowWriterOptions;
use parquet::basic::{Compression, ZstdLevel};
use parquet::errors::Result;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;

use crate::schema::{self, Column, Kind, Value};
use mirrorstats_parquet_pages::checksums::{self, CREATED_BY, Held};

/// The number of rows after which a row group is closed, at the next end of an episode.
const ROW_GROUP_ROWS: usize = 128 * 1024;
const GATHERED_ROWS: usize = 8 * 1024;

pub struct RowGroups<W: Write + Send> {
    parquet: ArrowWriter<Held<W>>,
    filling: Filling,
}

/// The rows of the row group that is being filled.
#[derive(Clone, Copy, Debug, Default)]
pub struct Filling {
    rows: usize,
}

impl Filling {
    /// Returns true if this many gathered rows are written at the end of an episode.
    pub const fn is_due(self, gathered: usize) -> bool {
        self.rows + gathered >= ROW_GROUP_ROWS || gathered >= GATHERED_ROWS
    }

    /// Adds written rows; returns true if the row group is then closed.
    pub const fn add(&mut self, rows: usize) -> bool {
        self.rows += rows;
        let is_full = self.rows >= ROW_GROUP_ROWS;
        if is_full {
            self.rows = 0;
        }
        is_full
    }
}

pub struct Gathered {
    pub layout: SchemaRef,
    pub columns: Vec<Values>,
    pub rows: usize,
}

pub enum Values {
    Bool(BooleanBuilder),
    Int(Int64Builder),
    Float(Float64Builder),
    Text(StringBuilder),
    Null(usize),
}

impl<W: Write + Send> RowGroups<W> {
    pub fn new(out: W, layout: &SchemaRef, recording: Option<&serde_json::Value>) -> Result<Self> {
        // Parquet's logical types are complete; an embedded Arrow schema would only pin one library's view.
        let options = ArrowWriterOptions::new().with_properties(properties(recording)).with_skip_arrow_metadata(true);
        let parquet = ArrowWriter::try_new_with_options(Held::new(out), Arc::clone(layout), options)?;
        Ok(Self { parquet, filling: Filling::default() })
    }

    pub fn end_episode(&mut self, gathered: &mut Gathered) -> Result<()> {
        if self.filling.is_due(gathered.rows) { self.write(&gathered.take()?) } else { Ok(()) }
    }

    pub fn write(&mut self, rows: &RecordBatch) -> Result<()> {
        self.parquet.write(rows)?;
        if self.filling.add(rows.num_rows()) {
            self.parquet.flush()?;
            self.parquet.sync()?;
            let closed = self.parquet.flushed_row_groups()[self.parquet.inner().row_groups()..].to_vec();
            self.parquet.inner_mut().pass_on(&closed)?;
        }
        Ok(())
    }

    pub fn finish(mut self, gathered: Option<Gathered>) -> Result<W> {
        if let Some(mut gathered) = gathered.filter(|gathered| gathered.rows > 0) {
            self.parquet.write(&gathered.take()?)?;
        }
        checksums::finish(self.parquet.into_serialized_writer()?.0)
    }
}

fn properties(recording: Option<&serde_json::Value>) -> WriterProperties {
    let pair = |key: &str, value: String| KeyValue::new(key.to_owned(), value);
    let mut pairs = vec![
        pair(schema::VERSION_KEY, schema::SCHEMA_VERSION.to_string()),
        pair(schema::WRITER_KEY, concat!("mirrorstats ", env!("CARGO_PKG_VERSION")).to_owned()),
    ];
    pairs.extend(recording.map(|json| pair(schema::RECORDING_KEY, json.to_string())));
    WriterProperties::builder()
        .set_key_value_metadata(Some(pairs))
        .set_created_by(CREATED_BY.to_owned())
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        // Row groups end with an episode, never at a number of rows.
        .set_max_row_group_row_count(None)
        .build()
}

impl Gathered {
    pub fn new(columns: impl IntoIterator<Item = (Field, Option<Kind>)>) -> Self {
        let (fields, kinds): (Vec<Field>, Vec<Option<Kind>>) = columns.into_iter().unzip();
        let columns = kinds.into_iter().map(Values::new).collect();
        Self { layout: Arc::new(Schema::new(fields)), columns, rows: 0 }
    }

    pub fn of_columns<'a>(columns: impl IntoIterator<Item = &'a Column>) -> Self {
        Self::new(columns.into_iter().map(|column| (field(column), Some(column.stored.kind()))))
    }

    pub fn take(&mut self) -> Result<RecordBatch, ArrowError> {
        self.rows = 0;
        let columns = self.columns.iter_mut().zip(self.layout.fields());
        let columns = columns.map(|(values, field)| cast(&values.take(), field.data_type()));
        RecordBatch::try_new(Arc::clone(&self.layout), columns.collect::<Result<_, _>>()?)
    }
}

impl Values {
    fn new(kind: Option<Kind>) -> Self {
        match kind {
            Some(Kind::Bool) => Self::Bool(BooleanBuilder::new()),
            Some(Kind::Int) => Self::Int(Int64Builder::new()),
            Some(Kind::Float) => Self::Float(Float64Builder::new()),
            Some(Kind::String) => Self::Text(StringBuilder::new()),
            Some(Kind::Unsupported) | None => Self::Null(0),
        }
    }

    #[must_use]
    pub fn push(&mut self, value: Option<Value<'_>>) -> Option<()> {
        match (self, value) {
            (Self::Bool(values), None) => values.append_null(),
            (Self::Int(values), None) => values.append_null(),
            (Self::Float(values), None) => values.append_null(),
            (Self::Text(values), None) => values.append_null(),
            (Self::Null(count), None) => *count += 1,
            (Self::Bool(values), Some(Value::Bool(value))) => values.append_value(value),
            (Self::Int(values), Some(Value::Int(value))) => values.append_value(value),
            (Self::Float(values), Some(Value::Float(value))) => values.append_value(value),
            (Self::Text(values), Some(Value::Text(text))) => values.append_value(text),
            _ => return None,
        }
        Some(())
    }

    fn take(&mut self) -> ArrayRef {
        match self {
            Self::Bool(values) => Arc::new(values.finish()),
            Self::Int(values) => Arc::new(values.finish()),
            Self::Float(values) => Arc::new(values.finish()),
            Self::Text(values) => Arc::new(values.finish()),
            Self::Null(count) => Arc::new(NullArray::new(std::mem::take(count))),
        }
    }
}

pub fn field(column: &Column) -> Field {
    Field::new(column.name, column.stored.data_type(), column.nullable)
}

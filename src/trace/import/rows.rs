//! The second pass's rows: values into columns, columns into a trace, an episode never in two row groups.

use std::io::Write;
use std::sync::Arc;

use arrow::array::{ArrayRef, BooleanBuilder, Float64Builder, Int64Builder, NullArray, RecordBatch, StringBuilder};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_writer::ArrowWriterOptions;

use super::super::finding::TraceError;
use super::super::schema::Kind;
use super::super::source::field;
use super::super::write::{GATHERED_ROWS, ROW_GROUP_ROWS, properties};
use super::columns::Columns;
use super::line::{Members, Value};

/// Rows on their way into a trace.
pub(super) struct Rows<W: Write + Send> {
    parquet: ArrowWriter<W>,
    layout: SchemaRef,
    columns: Vec<Gathered>,
    gathered: usize,
    in_row_group: usize,
}

/// The values of one column since the last batch.
enum Gathered {
    Bool(BooleanBuilder),
    Int(Int64Builder),
    Float(Float64Builder),
    Text(StringBuilder),
    Null(usize),
}

impl<W: Write + Send> Rows<W> {
    /// Starts a trace with these columns.
    pub(super) fn new(out: W, columns: &Columns, recording: &serde_json::Value) -> Result<Self, TraceError> {
        let known = columns.known().map(|column| (field(column), Some(column.stored.kind())));
        let own = columns.own().into_iter().map(|own| (Field::new(&own.name, stored(own.kind), true), own.kind));
        let (fields, kinds): (Vec<Field>, Vec<Option<Kind>>) = known.chain(own).unzip();
        let layout = Arc::new(Schema::new(fields));
        let options =
            ArrowWriterOptions::new().with_properties(properties(Some(recording))).with_skip_arrow_metadata(true);
        let parquet = ArrowWriter::try_new_with_options(out, Arc::clone(&layout), options).map_err(failed)?;
        let columns = kinds.into_iter().map(Gathered::new).collect();
        Ok(Self { parquet, layout, columns, gathered: 0, in_row_group: 0 })
    }

    /// Adds a step; an error if a value is not of its column's type.
    pub(super) fn add(&mut self, members: &Members) -> Result<(), ()> {
        let layout = Arc::clone(&self.layout);
        for (field, gathered) in layout.fields().iter().zip(&mut self.columns) {
            let value = members.iter().find(|(key, _)| key == field.name()).map(|(_, value)| value);
            gathered.push(value.unwrap_or(&Value::Null))?;
        }
        self.gathered += 1;
        Ok(())
    }

    /// Says that the next step is another episode's.
    pub(super) fn end_episode(&mut self) -> Result<(), TraceError> {
        if self.in_row_group + self.gathered >= ROW_GROUP_ROWS {
            self.encode()?;
            self.parquet.flush().map_err(failed)?;
            self.in_row_group = 0;
        } else if self.gathered >= GATHERED_ROWS {
            self.encode()?;
        }
        Ok(())
    }

    /// Writes what is left and the footer.
    pub(super) fn finish(mut self) -> Result<W, TraceError> {
        self.encode()?;
        self.parquet.into_inner().map_err(failed)
    }

    fn encode(&mut self) -> Result<(), TraceError> {
        if self.gathered == 0 {
            return Ok(());
        }
        let fields = self.layout.fields().iter();
        let arrays = self.columns.iter_mut().zip(fields).map(|(column, field)| cast(&column.take(), field.data_type()));
        let arrays = arrays.collect::<Result<Vec<_>, _>>();
        let batch = arrays.and_then(|arrays| RecordBatch::try_new(Arc::clone(&self.layout), arrays));
        self.parquet.write(&batch.map_err(|error| failed(error.into()))?).map_err(failed)?;
        self.in_row_group += self.gathered;
        self.gathered = 0;
        Ok(())
    }
}

/// The type of an own column in the file. One that is null in every line goes with any type in other files.
fn stored(kind: Option<Kind>) -> DataType {
    match kind {
        Some(Kind::Bool) => DataType::Boolean,
        Some(Kind::Int) => DataType::Int64,
        Some(Kind::Float) => DataType::Float64,
        Some(Kind::String) => DataType::Utf8,
        Some(Kind::Unsupported) | None => DataType::Null,
    }
}

impl Gathered {
    fn new(kind: Option<Kind>) -> Self {
        match kind {
            Some(Kind::Bool) => Self::Bool(BooleanBuilder::new()),
            Some(Kind::Int) => Self::Int(Int64Builder::new()),
            Some(Kind::Float) => Self::Float(Float64Builder::new()),
            Some(Kind::String) => Self::Text(StringBuilder::new()),
            Some(Kind::Unsupported) | None => Self::Null(0),
        }
    }

    #[expect(clippy::cast_precision_loss, reason = "the first pass refused what would lose anything in an own column")]
    fn push(&mut self, value: &Value) -> Result<(), ()> {
        match (self, value) {
            (Self::Bool(values), Value::Null) => values.append_null(),
            (Self::Bool(values), Value::Bool(value)) => values.append_value(*value),
            (Self::Int(values), Value::Null) => values.append_null(),
            (Self::Int(values), Value::Int(value)) => values.append_value(*value),
            (Self::Float(values), Value::Null) => values.append_null(),
            (Self::Float(values), Value::Int(value)) => values.append_value(*value as f64),
            (Self::Float(values), Value::LargeInt(value)) => values.append_value(*value as f64),
            (Self::Float(values), Value::Float(value)) => values.append_value(*value),
            (Self::Text(values), Value::Null) => values.append_null(),
            (Self::Text(values), Value::Text(text)) => values.append_value(text),
            (Self::Null(count), Value::Null) => *count += 1,
            _ => return Err(()),
        }
        Ok(())
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

fn failed(error: parquet::errors::ParquetError) -> TraceError {
    TraceError::Write { file: "stream".into(), source: Box::new(error) }
}

//! Columns in capsules of Arrow's C interface: libraries that support it read them without a copy.

use std::collections::HashMap;
use std::io::Cursor;
use std::sync::Arc;

use arrow::array::{
    Array as _, ArrayRef, AsArray, Float64Array, RecordBatch, RecordBatchIterator, RecordBatchReader, StringArray,
};
use arrow::compute::{cast, concat_batches};
use arrow::datatypes::{DataType, Field, Float64Type, Schema, SchemaRef};
use arrow::error::ArrowError;
use arrow::ffi::FFI_ArrowSchema;
use arrow::ffi_stream::{FFI_ArrowArrayStream, RecordBatchStreamReader};
use arrow::json::writer::LineDelimited;
use arrow::json::{ReaderBuilder, WriterBuilder};
use arrow::util::display::{ArrayFormatter, FormatOptions};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyCapsule};

use crate::error;

/// The rows that a notebook shows, from the start and the end.
const SHOWN: usize = 20;

/// Rows in memory, through Arrow's PyCapsule interface: `polars.DataFrame(table)`, `pyarrow.table(table)`,
/// `pandas.DataFrame.from_arrow(table)`, or as a table in a query of DuckDB. No copy is made. It can be pickled, and a
/// notebook shows its first and last rows.
///
/// Example:
///     >>> import mirrorstats as ms
///     >>> cells = ms.open(ms.example_runs(), metrics="TSA", by="model").cells
///     >>> cells.to_polars().height
///     8
#[pyclass(frozen, module = "mirrorstats", name = "ArrowTable")]
pub struct Table {
    batch: RecordBatch,
}

/// Steps, through Arrow's PyCapsule interface; the traces are read again each time, some rows at a time.
///
/// Example:
///     >>> import mirrorstats as ms
///     >>> steps = ms.open(ms.example_runs(), where="experiment = 'E1' and seed = 1").steps(["episode_id", "t"])
///     >>> steps.to_polars().columns
///     ['episode_id', 't']
#[pyclass(frozen, module = "mirrorstats", name = "ArrowSteps")]
pub struct Steps {
    study: Arc<mirrorstats::Study>,
    columns: Option<Vec<String>>,
    schema: SchemaRef,
    /// True for Polars, which takes views of texts without a copy and converts other texts.
    has_views: bool,
}

impl Table {
    pub fn new(batch: RecordBatch) -> Self {
        Self { batch }
    }

    /// A table with the rows of a Parquet file in memory.
    pub fn from_parquet(file: Vec<u8>) -> PyResult<Self> {
        let read = || {
            let reader = ParquetRecordBatchReaderBuilder::try_new(bytes::Bytes::from(file))?;
            let schema = Arc::clone(reader.schema());
            let batches = reader.build()?.collect::<Result<Vec<_>, _>>()?;
            Ok::<_, parquet::errors::ParquetError>(counted(&concat_batches(&schema, &batches)?)?)
        };
        read().map(Self::new).map_err(error::of_input)
    }

    /// The cells of studies by name, one study after another, with the change of each mean from the first study.
    pub fn below_each_other(studies: &[(String, Self)]) -> PyResult<Self> {
        let mut first: HashMap<Vec<String>, f64> = HashMap::new();
        let mut parts = Vec::new();
        for (at, (name, Self { batch })) in studies.iter().enumerate() {
            let (schema, rows) = (batch.schema(), batch.num_rows());
            let until = schema.index_of("metric").map_err(error::of_input)?;
            let means = batch.column_by_name("mean").map(AsArray::as_primitive::<Float64Type>);
            let mean = |row: usize| means.filter(|means| means.is_valid(row)).map(|means| means.value(row));
            let key = |row: usize| -> Vec<String> {
                let keys = batch.columns()[..=until].iter().map(AsArray::as_string::<i32>);
                keys.map(|keys| if keys.is_null(row) { String::new() } else { keys.value(row).to_owned() }).collect()
            };
            if at == 0 {
                first = (0..rows).filter_map(|row| Some((key(row), mean(row)?))).collect();
            }
            let change = |row: usize| (at > 0).then(|| Some(mean(row)? - first.get(&key(row))?)).flatten();
            let change: Float64Array = (0..rows).map(change).collect();
            let named: ArrayRef = Arc::new(StringArray::from_iter_values((0..rows).map(|_| name)));
            let columns = [vec![named], batch.columns().to_vec(), vec![Arc::new(change)]].concat();
            let fields = schema.fields().iter().map(|field| field.as_ref().clone());
            let study = Field::new("study", DataType::Utf8, false);
            let fields = [vec![study], fields.collect(), vec![Field::new("change", DataType::Float64, true)]].concat();
            parts.push(RecordBatch::try_new(Arc::new(Schema::new(fields)), columns).map_err(error::of_input)?);
        }
        let Some(schema) = parts.first().map(RecordBatch::schema) else {
            return Err(error::of_argument("studies: expected two or more, found none"));
        };
        if let Some(other) = parts.iter().position(|part| part.schema() != schema) {
            let (one, other) = (&studies[0].0, &studies[other].0);
            let words = format!("studies: expected the same key columns, found others in `{other}` than in `{one}`");
            return Err(error::of_argument(format!("{words}\n  help: open both with the same `by`")));
        }
        concat_batches(&schema, &parts).map(Self::new).map_err(error::of_input)
    }

    fn to_parquet(&self) -> Result<Vec<u8>, parquet::errors::ParquetError> {
        let mut writer = ArrowWriter::try_new(Vec::new(), self.batch.schema(), None)?;
        writer.write(&self.batch)?;
        writer.into_inner()
    }

    fn to_html(&self) -> Result<String, ArrowError> {
        let (rows, schema) = (self.batch.num_rows(), self.batch.schema());
        let options = FormatOptions::default();
        let columns = self.batch.columns().iter().map(|column| ArrayFormatter::try_new(column.as_ref(), &options));
        let columns = columns.collect::<Result<Vec<_>, _>>()?;
        let mut table = mirrorstats_tables::Table::of_texts(schema.fields().iter().map(|field| field.name().as_str()));
        for row in (0..rows).filter(|row| *row < SHOWN / 2 || row + SHOWN / 2 >= rows) {
            let cells = columns.iter().zip(self.batch.columns());
            let cell = |(values, array): (&ArrayFormatter, &ArrayRef)| {
                if array.is_null(row) { String::new() } else { values.value(row).to_string() }
            };
            table.push(cells.map(cell).collect::<Vec<_>>());
        }
        let left_out = if rows > SHOWN { format!(", the first and last {}", SHOWN / 2) } else { String::new() };
        Ok(table.titled(format!("{rows} rows{left_out}")).html())
    }
}

impl Steps {
    /// Checks that the columns exist, without reading rows.
    pub fn new(study: Arc<mirrorstats::Study>, columns: Option<Vec<String>>) -> PyResult<Self> {
        let schema = study.steps(columns.as_deref()).map_err(error::of_study)?.schema();
        Ok(Self { study, columns, schema, has_views: false })
    }

    fn with_views(&self) -> Self {
        let (study, schema) = (Arc::clone(&self.study), Arc::clone(&self.schema));
        Self { study, columns: self.columns.clone(), schema, has_views: true }
    }
}

#[pymethods]
impl Table {
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        // A caller that requests other types may cast: the interface leaves it to the producer.
        drop(requested_schema);
        let schema = self.batch.schema();
        stream(py, Box::new(RecordBatchIterator::new([Ok(self.batch.clone())], schema)))
    }

    fn __arrow_c_schema__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyCapsule>> {
        schema(py, &self.batch.schema())
    }

    fn __len__(&self) -> usize {
        self.batch.num_rows()
    }

    /// The names of the columns, in their order.
    #[getter]
    fn column_names(&self) -> Vec<String> {
        names(&self.batch.schema())
    }

    /// A `polars.DataFrame`, which shares the memory where it can.
    fn to_polars<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        to_polars(slf)
    }

    /// A `pandas.DataFrame`; integers beside nulls stay integers (`Int64`).
    fn to_pandas<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        to_pandas(slf)
    }

    #[staticmethod]
    fn _from_parquet(file: Vec<u8>) -> PyResult<Self> {
        Self::from_parquet(file)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let file = self.to_parquet().map_err(error::of_input)?;
        Ok((py.get_type::<Self>().getattr("_from_parquet")?, (PyBytes::new(py, &file),)))
    }

    fn _repr_html_(&self) -> PyResult<String> {
        self.to_html().map_err(error::of_input)
    }

    fn __repr__(&self) -> String {
        format!("<mirrorstats.ArrowTable: {} rows; {}>", self.batch.num_rows(), names(&self.batch.schema()).join(", "))
    }
}

#[pymethods]
impl Steps {
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        drop(requested_schema);
        let steps = py.detach(|| self.study.steps(self.columns.as_deref()).map_err(error::of_study))?;
        let steps = if self.has_views { steps.with_views() } else { steps };
        let schema = steps.schema();
        let rows = steps.map(|rows| rows.map_err(|fault| ArrowError::ExternalError(Box::new(fault))));
        stream(py, Box::new(RecordBatchIterator::new(rows, schema)))
    }

    fn __arrow_c_schema__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyCapsule>> {
        schema(py, &self.schema)
    }

    /// The names of the columns, in their order.
    #[getter]
    fn column_names(&self) -> Vec<String> {
        names(&self.schema)
    }

    /// A `polars.DataFrame`, which shares the memory where it can.
    fn to_polars<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        to_polars(&Bound::new(slf.py(), slf.get().with_views())?)
    }

    /// A `pandas.DataFrame`; integers beside nulls stay integers (`Int64`).
    fn to_pandas<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        to_pandas(slf)
    }

    // Pickle's own words are of Python's machinery.
    #[expect(clippy::unused_self, reason = "a method of Python")]
    fn __reduce__(&self) -> PyResult<()> {
        let words = "steps are read from their files and cannot be pickled: pickle the study, or `steps.to_polars()`";
        Err(PyTypeError::new_err(words))
    }

    fn __repr__(&self) -> String {
        format!("<mirrorstats.ArrowSteps: {}>", names(&self.schema).join(", "))
    }
}

/// A table of rows that are lines of JSON; `columns` are names with `int`, `float`, `bool` or `text`.
#[pyfunction]
pub fn table_of(columns: Vec<(String, String)>, lines: &[u8]) -> PyResult<Table> {
    let field = |(name, kind): (String, String)| {
        let kind = match kind.as_str() {
            "int" => DataType::Int64,
            "float" => DataType::Float64,
            "bool" => DataType::Boolean,
            _ => DataType::Utf8,
        };
        Field::new(name, kind, true)
    };
    let schema = Arc::new(Schema::new(columns.into_iter().map(field).collect::<Vec<_>>()));
    let read = || {
        let reader = ReaderBuilder::new(Arc::clone(&schema)).build(Cursor::new(lines))?;
        concat_batches(&schema, &reader.collect::<Result<Vec<_>, _>>()?)
    };
    read().map(Table::new).map_err(error::of_input)
}

/// The rows of an Arrow stream as lines of JSON, and its columns; what is null says so, and a NaN is null.
#[pyfunction]
pub fn lines_of(py: Python<'_>, stream: &Bound<'_, PyCapsule>) -> PyResult<(Vec<String>, Vec<u8>)> {
    let pointer = stream.pointer_checked(Some(c"arrow_array_stream"))?.cast::<FFI_ArrowArrayStream>();
    // SAFETY: a capsule of this name holds a stream of Arrow's C interface, and it lives until this function returns. The
    // stream is moved out of it and marked as released there, as the interface has it.
    #[expect(unsafe_code, reason = "Arrow's C interface passes a pointer")]
    let reader = unsafe { RecordBatchStreamReader::from_raw(pointer.as_ptr()) };
    let reader = reader.map_err(error::of_input)?;
    let columns = names(&reader.schema());
    let written = py.detach(|| {
        let mut lines = Vec::new();
        let mut writer = WriterBuilder::new().with_explicit_nulls(true).build::<_, LineDelimited>(&mut lines);
        let mut before = 0;
        for batch in reader {
            let batch = batch?;
            check_finite(&batch, before)?;
            before += batch.num_rows();
            writer.write(&batch)?;
        }
        writer.finish()?;
        drop(writer);
        Ok::<_, ArrowError>(lines)
    });
    Ok((columns, written.map_err(error::of_input)?))
}

/// Converts counts to signed 64-bit integers, like all other integers.
fn counted(batch: &RecordBatch) -> Result<RecordBatch, ArrowError> {
    let counts = |kind: &DataType| kind.is_unsigned_integer();
    let schema = batch.schema();
    let columns = schema.fields().iter().zip(batch.columns()).map(|(field, column)| {
        let column = if counts(column.data_type()) { cast(column, &DataType::Int64)? } else { Arc::clone(column) };
        Ok((field.as_ref().clone().with_data_type(column.data_type().clone()), column))
    });
    let (fields, columns): (Vec<Field>, Vec<ArrayRef>) =
        columns.collect::<Result<Vec<_>, ArrowError>>()?.into_iter().unzip();
    RecordBatch::try_new(Arc::new(Schema::new(fields)), columns)
}

/// Refuses infinity, which JSON would write as null.
fn check_finite(batch: &RecordBatch, before: usize) -> Result<(), ArrowError> {
    for (field, column) in
        batch.schema().fields().iter().zip(batch.columns()).filter(|(_, c)| c.data_type().is_floating())
    {
        let values = cast(column, &DataType::Float64)?;
        let values = values.as_primitive::<Float64Type>();
        if let Some(row) = values.iter().position(|value| value.is_some_and(f64::is_infinite)) {
            let (row, name) = (before + row, field.name());
            let words = format!("row {row} (from 0), column `{name}`: expected a finite number, found an infinite one");
            return Err(ArrowError::ExternalError(words.into()));
        }
    }
    Ok(())
}

fn to_polars<'py>(columns: &Bound<'py, impl pyo3::PyClass>) -> PyResult<Bound<'py, PyAny>> {
    columns.py().import("polars")?.getattr("DataFrame")?.call1((columns,))
}

/// Converts to pandas; integers beside nulls stay integers.
fn to_pandas<'py>(columns: &Bound<'py, impl pyo3::PyClass>) -> PyResult<Bound<'py, PyAny>> {
    let frame = columns.py().import("pandas")?.getattr("DataFrame")?;
    frame.call_method1("from_arrow", (columns,))?.call_method0("convert_dtypes")
}

fn names(schema: &SchemaRef) -> Vec<String> {
    schema.fields().iter().map(|field| field.name().clone()).collect()
}

fn stream(py: Python<'_>, rows: Box<dyn RecordBatchReader + Send>) -> PyResult<Bound<'_, PyCapsule>> {
    PyCapsule::new_with_value(py, FFI_ArrowArrayStream::new(rows), c"arrow_array_stream")
}

fn schema<'py>(py: Python<'py>, schema: &SchemaRef) -> PyResult<Bound<'py, PyCapsule>> {
    let schema = FFI_ArrowSchema::try_from(schema.as_ref()).map_err(error::of_input)?;
    PyCapsule::new_with_value(py, schema, c"arrow_schema")
}

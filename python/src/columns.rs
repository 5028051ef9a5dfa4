//! Columns through Arrow's C interface in capsules: any library that knows it takes them without a copy.

use std::sync::Arc;

use arrow::array::{RecordBatch, RecordBatchIterator, RecordBatchReader};
use arrow::datatypes::SchemaRef;
use arrow::error::ArrowError;
use arrow::ffi::FFI_ArrowSchema;
use arrow::ffi_stream::FFI_ArrowArrayStream;
use pyo3::prelude::*;
use pyo3::types::PyCapsule;

use crate::error;

/// Rows that are in memory.
#[pyclass(frozen, module = "mirrorstats", name = "ArrowTable")]
pub struct Table {
    batch: RecordBatch,
}

/// Steps, which are read from the traces whenever somebody asks for them.
#[pyclass(frozen, module = "mirrorstats", name = "ArrowSteps")]
pub struct Steps {
    study: Arc<mirrorstats::Study>,
    columns: Option<Vec<String>>,
    schema: SchemaRef,
}

impl Table {
    pub fn new(batch: RecordBatch) -> Self {
        Self { batch }
    }
}

impl Steps {
    /// Looks whether there are such columns; reads no row.
    pub fn new(study: Arc<mirrorstats::Study>, columns: Option<Vec<String>>) -> PyResult<Self> {
        let schema = study.steps(columns.as_deref()).map_err(error::of_study)?.schema();
        Ok(Self { study, columns, schema })
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
        // Whoever asks for other types may cast: the interface leaves it to the producer.
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

    #[getter]
    fn column_names(&self) -> Vec<String> {
        names(&self.batch.schema())
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
        let rows = steps.map(|rows| rows.map_err(|fault| ArrowError::ExternalError(Box::new(fault))));
        stream(py, Box::new(RecordBatchIterator::new(rows, Arc::clone(&self.schema))))
    }

    fn __arrow_c_schema__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyCapsule>> {
        schema(py, &self.schema)
    }

    #[getter]
    fn column_names(&self) -> Vec<String> {
        names(&self.schema)
    }

    fn __repr__(&self) -> String {
        format!("<mirrorstats.ArrowSteps: {}>", names(&self.schema).join(", "))
    }
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

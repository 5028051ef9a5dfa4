//! What shows itself in a notebook: tables and figures.

use std::path::PathBuf;

use mirrorstats::FigureFormat;
use pyo3::prelude::*;
use report::tables::Terminal;

use crate::error;

/// A table of a report.
#[pyclass(frozen, module = "mirrorstats", name = "Table")]
pub struct ReportTable {
    table: mirrorstats::MetricTable,
}

/// A figure of a report.
#[pyclass(frozen, module = "mirrorstats")]
pub struct Figure {
    figure: mirrorstats::Figure,
    name: &'static str,
}

impl ReportTable {
    pub fn new(table: mirrorstats::MetricTable) -> Self {
        Self { table }
    }
}

impl Figure {
    pub fn new(figure: mirrorstats::Figure, name: &'static str) -> Self {
        Self { figure, name }
    }
}

#[pymethods]
impl ReportTable {
    #[getter]
    fn name(&self) -> &str {
        &self.table.name
    }

    #[getter]
    fn latex(&self) -> String {
        self.table.printed().latex()
    }

    #[getter]
    fn markdown(&self) -> String {
        self.table.printed().markdown()
    }

    #[getter]
    fn csv(&self) -> String {
        self.table.records().csv()
    }

    #[getter]
    fn html(&self) -> String {
        self.table.printed().html()
    }

    fn _repr_html_(&self) -> String {
        self.html()
    }

    fn _repr_markdown_(&self) -> String {
        self.markdown()
    }

    fn __str__(&self) -> String {
        self.table.printed().terminal(Terminal::default())
    }

    fn __repr__(&self) -> String {
        self.__str__()
    }
}

#[pymethods]
impl Figure {
    #[getter]
    fn name(&self) -> &'static str {
        self.name
    }

    #[getter]
    fn svg(&self, py: Python<'_>) -> PyResult<String> {
        let bytes = py.detach(|| FigureFormat::Svg.encode(&self.figure)).map_err(error::of_input)?;
        String::from_utf8(bytes).map_err(error::of_input)
    }

    fn _repr_svg_(&self, py: Python<'_>) -> PyResult<String> {
        self.svg(py)
    }

    fn save(&self, py: Python<'_>, path: &Bound<'_, PyAny>) -> PyResult<()> {
        let path = path.extract::<PathBuf>()?;
        py.detach(|| {
            let bytes = FigureFormat::of(&path).map_err(error::of_input)?.encode(&self.figure);
            let bytes = bytes.map_err(error::of_input)?;
            exact::replace::replace(&path, &bytes).map_err(|fault| error::of_writing(&path, &fault))
        })
    }

    fn __repr__(&self) -> String {
        format!("<mirrorstats.Figure: {}>", self.name)
    }
}

//! Tables and figures for display in notebooks.

use std::path::PathBuf;

use mirrorstats::{FigureFormat, MetricTable};
use mirrorstats_tables::Terminal;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::error;

/// A table of a report, rounded as the style says. It shows itself in a notebook; `print` shows it as text. It can be pickled.
///
/// Example:
///     >>> import mirrorstats as ms
///     >>> table = ms.open(ms.example_runs()).table("main")
///     >>> table.csv.splitlines()[0].split(",")[:3]
///     ['experiment', 'model', 'metric']
#[pyclass(frozen, module = "mirrorstats", name = "Table")]
pub struct ReportTable {
    /// The name that the style gives it.
    #[pyo3(get)]
    name: String,
    /// The table for LaTeX, with `booktabs`.
    #[pyo3(get)]
    latex: String,
    /// The table as Markdown.
    #[pyo3(get)]
    markdown: String,
    /// One row per cell with every digit, as CSV.
    #[pyo3(get)]
    csv: String,
    /// The table as HTML, without a style sheet.
    #[pyo3(get)]
    html: String,
    text: String,
}

/// A figure. It shows itself in a notebook, and can be pickled.
///
/// Example:
///     >>> import mirrorstats as ms
///     >>> figure = ms.open(ms.example_runs()).figure("heatmap")
///     >>> figure.svg[:4]
///     '<svg'
#[pyclass(frozen, module = "mirrorstats")]
pub struct Figure {
    drawn: Drawn,
    /// The name of the figure.
    #[pyo3(get)]
    name: String,
}

/// A figure, or the files of a pickled one.
enum Drawn {
    Figure(mirrorstats::Figure),
    Files(Vec<Vec<u8>>),
}

impl ReportTable {
    pub fn new(table: &MetricTable) -> Self {
        let printed = table.printed();
        Self {
            name: table.name.clone(),
            latex: printed.latex(),
            markdown: printed.markdown(),
            csv: table.records().csv(),
            html: printed.html(),
            text: printed.terminal(Terminal::default()),
        }
    }
}

impl Figure {
    pub fn new(figure: mirrorstats::Figure, name: &str) -> Self {
        Self { drawn: Drawn::Figure(figure), name: name.to_owned() }
    }

    fn encode(&self, format: FigureFormat) -> PyResult<Vec<u8>> {
        match &self.drawn {
            Drawn::Figure(figure) => format.encode(figure).map_err(error::of_input),
            Drawn::Files(files) => {
                let at = FigureFormat::ALL.iter().position(|other| *other == format);
                Ok(at.and_then(|at| files.get(at)).cloned().unwrap_or_default())
            }
        }
    }
}

/// The parts of a pickled figure: its name, and its file in each format.
type Files<'py> = (String, Vec<Bound<'py, PyBytes>>);

/// The parts of a pickled table.
type Parts<'t> = (&'t str, &'t str, &'t str, &'t str, &'t str, &'t str);

#[pymethods]
impl ReportTable {
    #[new]
    fn made(name: String, latex: String, markdown: String, csv: String, html: String, text: String) -> Self {
        Self { name, latex, markdown, csv, html, text }
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> (Bound<'py, PyAny>, Parts<'_>) {
        let Self { name, latex, markdown, csv, html, text } = self;
        (py.get_type::<Self>().into_any(), (name, latex, markdown, csv, html, text))
    }

    fn _repr_html_(&self) -> &str {
        &self.html
    }

    fn _repr_markdown_(&self) -> &str {
        &self.markdown
    }

    fn __str__(&self) -> &str {
        &self.text
    }

    fn __repr__(&self) -> &str {
        &self.text
    }
}

#[pymethods]
impl Figure {
    #[new]
    fn made(name: String, files: Vec<Vec<u8>>) -> Self {
        Self { drawn: Drawn::Files(files), name }
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Files<'py>)> {
        let files = FigureFormat::ALL.iter().map(|format| Ok(PyBytes::new(py, &self.encode(*format)?)));
        Ok((py.get_type::<Self>().into_any(), (self.name.clone(), files.collect::<PyResult<_>>()?)))
    }

    /// The figure as an SVG document with its font inside.
    #[getter]
    fn svg(&self, py: Python<'_>) -> PyResult<String> {
        String::from_utf8(py.detach(|| self.encode(FigureFormat::Svg))?).map_err(error::of_input)
    }

    fn _repr_svg_(&self, py: Python<'_>) -> PyResult<String> {
        self.svg(py)
    }

    /// Writes it to a file that ends in .svg, .png or .pdf.
    ///
    /// Raises:
    ///     ArgumentError: another ending.
    ///     OutputError: a file that cannot be written.
    #[expect(clippy::needless_pass_by_value, reason = "Python's values become owned ones")]
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| {
            let bytes = self.encode(FigureFormat::from_path(&path).map_err(error::of_argument)?)?;
            mirrorstats_exact::replace::replace(&path, &bytes).map_err(|fault| error::of_writing(&path, &fault))
        })
    }

    fn __repr__(&self) -> String {
        format!("<mirrorstats.Figure: {}>", self.name)
    }
}

//! A study for Python: opened once; each answer is one call of the library.

use std::path::Path;
use std::str::FromStr as _;
use std::sync::{Arc, OnceLock};

use arrow::array::RecordBatch;
use mirrorstats::{FigureName, FigureOptions, ReportOptions, StatisticsOptions};
use mirrorstats_analysis::gate::{GateFormat, GateOptions};
use mirrorstats_analysis::statistics::text::Length;
use mirrorstats_figures::InvalidWidth;
use mirrorstats_study::diff::diff_studies;
use mirrorstats_study::gate::leading_metric;
use mirrorstats_study::losses::LostAs;
use mirrorstats_study::query::query_parquet;
use mirrorstats_study::question::Question;
use mirrorstats_study::report;
use pyo3::prelude::*;

use crate::answer::{self, Answer};
use crate::columns::{Steps, Table};
use crate::error;
use crate::shown::{Figure, ReportTable};

/// The lines of each list in the text of a difference, the same as on the command line.
const LISTED: usize = 20;

/// A study: inputs, definitions and a filter.
#[pyclass(frozen, module = "mirrorstats._native")]
pub struct Study {
    inner: Arc<mirrorstats::Study>,
    pool: bool,
    episodes: OnceLock<RecordBatch>,
    cells: OnceLock<RecordBatch>,
}

/// The question to a study, with the defaults of the command line.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Asked {
    paths: Vec<String>,
    definitions: Option<String>,
    r#where: Option<String>,
    metrics: Option<Vec<String>>,
    by: Option<Vec<String>>,
    pool: bool,
    lost_as_failure: bool,
    threads: Option<std::num::NonZeroUsize>,
}

impl Asked {
    fn open(self) -> PyResult<mirrorstats::Study> {
        let lost = if self.lost_as_failure { LostAs::Failure } else { LostAs::Nothing };
        let (definitions, filter) = (self.definitions.map(Into::into), self.r#where);
        let (metrics, by, pool) = (self.metrics, self.by, self.pool);
        let question = Question { definitions, filter, metrics, by, pool, lost, ..Question::default() };
        let paths: Vec<_> = self.paths.into_iter().map(Into::into).collect();
        let inputs = mirrorstats::resolve(&paths, std::io::empty()).map_err(error::of_study)?;
        let study = mirrorstats::Study::with_logs(inputs, question.definitions.as_deref()).map_err(error::of_study)?;
        let study = study.asked(question).map_err(error::of_study)?;
        Ok(match self.threads {
            Some(threads) => study.threads(threads),
            None => study,
        })
    }
}

impl Study {
    fn tables_of(&self, style: String) -> PyResult<mirrorstats::Report> {
        report::report(&self.inner, &ReportOptions { style: style.into(), figures: false, png: false })
            .map_err(error::of_study)
    }
}

#[pymethods]
impl Study {
    #[new]
    fn new(py: Python<'_>, asked: Asked) -> PyResult<Self> {
        let pool = asked.pool;
        let inner = Arc::new(py.detach(|| asked.open())?);
        Ok(Self { inner, pool, episodes: OnceLock::new(), cells: OnceLock::new() })
    }

    #[getter]
    fn definitions(&self) -> String {
        self.inner.question.definitions_name().to_string_lossy().into_owned()
    }

    #[getter]
    fn episodes(&self, py: Python<'_>) -> PyResult<Table> {
        py.detach(|| {
            once(&self.episodes, || {
                mirrorstats::episode_batch(&self.inner.score().map_err(error::of_study)?.episodes)
                    .map_err(error::of_input)
            })
        })
    }

    #[getter]
    fn cells(&self, py: Python<'_>) -> PyResult<Table> {
        py.detach(|| {
            once(&self.cells, || {
                mirrorstats::record_batch(&self.inner.cells().map_err(error::of_study)?).map_err(error::of_input)
            })
        })
    }

    #[pyo3(signature = (columns=None))]
    fn steps(&self, py: Python<'_>, columns: Option<Vec<String>>) -> PyResult<Steps> {
        py.detach(|| Steps::new(Arc::clone(&self.inner), columns))
    }

    fn table(&self, py: Python<'_>, name: &str, style: String) -> PyResult<ReportTable> {
        py.detach(|| {
            let report = self.tables_of(style)?;
            Ok(ReportTable::new(report.table(name).map_err(error::of_study)?))
        })
    }

    fn tables(&self, py: Python<'_>, style: String) -> PyResult<Vec<ReportTable>> {
        py.detach(|| Ok(self.tables_of(style)?.tables.iter().map(ReportTable::new).collect()))
    }

    #[pyo3(signature = (name, style, metrics, width))]
    fn figure(
        &self,
        py: Python<'_>,
        name: &str,
        style: String,
        metrics: Option<Vec<String>>,
        width: Option<&str>,
    ) -> PyResult<Figure> {
        let name = FigureName::from_str(name).map_err(error::of_argument)?;
        let width = width.map(str::parse).transpose();
        let width = width.map_err(|fault: InvalidWidth| error::of_argument(format!("width: {fault}")))?;
        let options = FigureOptions { style: style.into(), metrics, width, top: None };
        let figure = py.detach(|| mirrorstats::figure(&self.inner, name, &options).map_err(error::of_study))?;
        Ok(Figure::new(figure, name.name()))
    }

    fn report(&self, py: Python<'_>, out: &str, style: String, figures: bool) -> PyResult<Answer> {
        let (written, notes) = py.detach(|| {
            let options = ReportOptions { style: style.into(), figures, png: false };
            let out = Path::new(out);
            report::check_folder(&self.inner, out, &options).map_err(error::of_study)?;
            let report = report::report(&self.inner, &options).map_err(error::of_study)?;
            Ok::<_, PyErr>((report.write(out).map_err(error::of_study)?, report.notes))
        })?;
        answer::of(&written.manifest, [written.files, notes].concat().join("\n"))
    }

    #[pyo3(signature = (confidence, margin, tables, full))]
    fn stats(
        &self,
        py: Python<'_>,
        confidence: f64,
        margin: Option<f64>,
        tables: bool,
        full: bool,
    ) -> PyResult<Answer> {
        let options = StatisticsOptions { confidence, margin, improvements: true, ..StatisticsOptions::default() };
        let length = match (full, tables) {
            (true, _) => Length::Full,
            (_, true) => Length::Tables,
            _ => Length::Screen,
        };
        let found = py.detach(|| {
            let grouped = self.inner.grouped().map_err(error::of_study)?;
            mirrorstats::statistics(&grouped, &options).map_err(error::of_study)
        })?;
        answer::of(&found, found.render(&found.headline, length, None))
    }

    fn query(&self, py: Python<'_>, sql: &str) -> PyResult<Table> {
        let file = py.detach(|| query_parquet(&self.inner, sql).map_err(error::of_study))?;
        Table::from_parquet(file)
    }

    fn diff(&self, py: Python<'_>, other: &Self) -> PyResult<Answer> {
        let found = py.detach(|| diff_studies(&self.inner, &other.inner).map_err(error::of_study))?;
        let shown = found.changes.render(LISTED, None);
        let notes = found.notes.iter().map(|note| format!("note: {note}"));
        answer::of(&found.changes, notes.chain([shown]).collect::<Vec<_>>().join("\n"))
    }

    /// The verdicts on this study against an earlier one. Settings that differ do not matter where either was opened so.
    #[pyo3(signature = (base, metric, margin, confidence))]
    fn gate(
        &self,
        py: Python<'_>,
        base: &Self,
        metric: Option<String>,
        margin: f64,
        confidence: f64,
    ) -> PyResult<Answer> {
        let gate = py.detach(|| {
            let metric = match metric {
                Some(metric) => metric,
                None => leading_metric(&self.inner).map_err(error::of_study)?,
            };
            let options = GateOptions { metric, margin, confidence, pool: self.pool || base.pool };
            mirrorstats::gate(&base.inner, &self.inner, &options).map_err(error::of_study)
        })?;
        answer::of(&gate, gate.render(GateFormat::Text(None)))
    }

    fn explain(&self, py: Python<'_>, episode_id: &str) -> PyResult<Answer> {
        let found = py.detach(|| mirrorstats::explain(&self.inner, episode_id).map_err(error::of_study))?;
        answer::of(&found, found.to_string())
    }
}

fn once(kept: &OnceLock<RecordBatch>, compute: impl FnOnce() -> PyResult<RecordBatch>) -> PyResult<Table> {
    if let Some(batch) = kept.get() {
        return Ok(Table::new(batch.clone()));
    }
    // Two threads may compute this at the same time.
    let batch = compute()?;
    Ok(Table::new(kept.get_or_init(|| batch).clone()))
}

/// The cells of studies below each other: `study`, the columns of cells, and the change of the mean from the first study.
#[pyfunction]
pub fn compare(py: Python<'_>, studies: Vec<(String, Py<Study>)>) -> PyResult<Table> {
    let cells = studies.into_iter().map(|(name, study)| Ok((name, study.get().cells(py)?)));
    let cells = cells.collect::<PyResult<Vec<_>>>()?;
    Table::below_each_other(&cells)
}

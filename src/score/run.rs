//! From traces to the episode table: the columns that the plan needs, one scan, one sorted table.

use std::num::NonZeroUsize;

use arrow::array::{Array, ArrayRef, AsArray as _, RecordBatch};
use arrow::datatypes::{DataType, Float64Type, Int32Type, Int64Type};

use super::engine::{Batch, Engine, EngineError, Scores};
use super::segments::Segments;
use super::table::{EpisodeKey, EpisodeTable, LabelColumn, MetricColumn};
use crate::base::near::nearest;
use crate::metric::catalog::Catalog;
use crate::metric::columns::{Column, Columns, Level, Type};
use crate::metric::definitions::{Definitions, UnknownMetric};
use crate::metric::fault::Faults;
use crate::metric::file::FileError;
use crate::metric::restore::RestoreError;
use crate::trace::finding::TraceError;
use crate::trace::open::TraceSet;
use crate::trace::scan::{EPISODE_COLUMNS, EpisodeBatch, Projection};
use crate::trace::schema::{COLUMNS, Kind};

/// What to score.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Request {
    /// A built-in definition file by name, or any other by path.
    pub definitions: String,
    /// The metrics wanted, by name; all if absent.
    pub metrics: Option<Vec<String>>,
    /// A condition on episodes in the language of definitions; all episodes if absent.
    pub condition: Option<String>,
}

impl Request {
    /// All metrics of a definition file, over all episodes.
    pub fn of(definitions: &str) -> Self {
        Self { definitions: definitions.to_owned(), metrics: None, condition: None }
    }
}

/// Why traces were not scored.
#[derive(Debug, thiserror::Error)]
pub enum ScoreError {
    /// The traces are not as they must be.
    #[error(transparent)]
    Trace(#[from] TraceError),
    /// The definition file is not.
    #[error(transparent)]
    Definitions(#[from] FileError),
    /// The definitions that scores carry are not.
    #[error(transparent)]
    Carried(#[from] RestoreError),
    /// The condition on episodes is not.
    #[error(transparent)]
    Condition(#[from] Faults),
    /// A metric was asked for that the definitions do not have.
    #[error(transparent)]
    Metric(#[from] UnknownMetric),
    /// A column that a metric reads is not in every trace.
    #[error("`{wanted_by}` reads the column `{column}`: {problem}; {help}")]
    Column {
        /// The metric, or `--where`.
        wanted_by: String,
        /// The column.
        column: String,
        /// What is the matter with it, and in which file.
        problem: String,
        /// What to do.
        help: String,
    },
    /// A column to group by is not constant in an episode, or not there.
    #[error("cannot group by `{name}`: expected a column that is constant in an episode, one of {}; {help}", .known.join(", "))]
    Label {
        /// The name given.
        name: String,
        /// The columns that can be grouped by.
        known: Vec<String>,
        /// What to do.
        help: String,
    },
    /// A number could not be computed.
    #[error("{file}: {source}")]
    Engine {
        /// The file of the batch.
        file: String,
        /// What went wrong.
        source: EngineError,
    },
}

/// The columns that definitions may name: those of the schema, whether the traces have them or not.
pub fn schema_columns() -> Columns {
    let column = |column: &crate::trace::schema::Column| {
        let level = if column.constant { Level::Episode } else { Level::Step };
        type_of(column.stored.kind()).map(|ty| (column.name, Column { ty, level }))
    };
    COLUMNS.iter().filter(|column| column.name != "t").filter_map(column).collect()
}

/// The columns that definitions may name over these traces: those of the schema, and the traces' own.
pub fn trace_columns(traces: &TraceSet) -> Columns {
    let mut columns = schema_columns().with_help("`mirrorstats schema` and `mirrorstats info` list the columns");
    for name in traces.column_names().into_iter().filter(|name| *name != "t") {
        if let Some(ty) = traces.column(name).and_then(|column| type_of(column.kind)) {
            columns.set_own(name, Column { ty, level: Level::Step });
        }
    }
    columns
}

fn type_of(kind: Kind) -> Option<Type> {
    match kind {
        Kind::Bool => Some(Type::Bool),
        Kind::Int => Some(Type::Int),
        Kind::Float => Some(Type::Float),
        Kind::String => Some(Type::Text),
        Kind::Unsupported => None,
    }
}

/// The definitions of a request, checked against the traces.
///
/// # Errors
/// Every fault of the definitions or of the condition, an unknown metric, a column that a metric needs and the traces lack.
pub fn definitions(traces: &TraceSet, request: &Request) -> Result<Definitions, ScoreError> {
    let columns = trace_columns(traces);
    let mut definitions = Definitions::load(&request.definitions, &columns)?;
    if let Some(condition) = &request.condition {
        definitions = definitions.filtered("--where", condition, &columns)?;
    }
    if let Some(metrics) = &request.metrics {
        definitions.select(metrics)?;
    }
    check_columns(traces, &definitions)?;
    Ok(definitions)
}

/// These metrics of the definitions that scores carry, checked against the traces that they were computed from.
///
/// # Errors
/// A catalog that is not what its hash says, an unknown metric, a column that a metric needs and the traces lack.
pub fn restored(traces: &TraceSet, catalog: &Catalog, metrics: &[String]) -> Result<Definitions, ScoreError> {
    let mut definitions = Definitions::of_catalog(catalog, &trace_columns(traces))?;
    definitions.select(metrics)?;
    check_columns(traces, &definitions)?;
    Ok(definitions)
}

/// Every column that is read must be in every file, with one type.
fn check_columns(traces: &TraceSet, definitions: &Definitions) -> Result<(), ScoreError> {
    let plan = &definitions.plan;
    let outputs = plan.outputs.iter().map(|output| (output.name.as_str(), output.node));
    for (wanted_by, node) in outputs.chain(plan.filter.map(|node| ("--where", node))) {
        for (column, _) in plan.columns(&plan.needed_by([node])) {
            if let Some((problem, help)) = column_problem(traces, column) {
                let (wanted_by, column) = (wanted_by.to_owned(), column.to_owned());
                return Err(ScoreError::Column { wanted_by, column, problem, help });
            }
        }
    }
    Ok(())
}

fn column_problem(traces: &TraceSet, column: &str) -> Option<(String, String)> {
    let absent = || "record it, or choose other metrics with --metrics".to_owned();
    let Some(found) = traces.column(column) else { return Some(("no trace has it".to_owned(), absent())) };
    if let Some([(first, a), (second, b)]) = found.conflict {
        let problem = format!("it is {} in `{first}` and {} in `{second}`", a.name(), b.name());
        return Some((problem, "write it with one type in all traces".to_owned()));
    }
    found.missing_from.map(|file| (format!("`{file}` has no such column"), absent()))
}

/// Scores all episodes of some traces.
///
/// The table is the same for any number of threads, any order of files and any division into row groups.
///
/// # Errors
/// The first fault of the traces by file, row group and row; columns to group by that are not constant; numbers beyond 64 bits.
pub fn score(
    traces: &TraceSet,
    definitions: &Definitions,
    labels: &[String],
    threads: NonZeroUsize,
) -> Result<EpisodeTable, ScoreError> {
    let engine = Engine::new(&definitions.plan);
    let projection = projection(traces, definitions, &engine, labels)?;
    let mut rows = Rows::new(definitions, labels);
    traces.scan(
        &projection,
        threads,
        |batch| -> Result<Part, ScoreError> {
            let scores = engine.score(&view(&batch)).map_err(|source| ScoreError::Engine {
                file: traces.files()[batch.origin.file].name().to_owned(),
                source,
            })?;
            Ok(Part::of(&batch.episodes, scores, labels))
        },
        |part: Part| {
            rows.append(part);
            Ok(())
        },
    )?;
    Ok(rows.sorted(definitions))
}

/// The episodes of some traces without a metric: keys and labels, the traces checked as [`score`] checks them.
///
/// For engines that read the traces by themselves and check nothing.
///
/// # Errors
/// As [`score`], save that no number is computed.
pub fn unscored(
    traces: &TraceSet,
    definitions: &Definitions,
    labels: &[String],
    threads: NonZeroUsize,
) -> Result<EpisodeTable, ScoreError> {
    let projection = projection(traces, definitions, &Engine::new(&definitions.plan), labels)?;
    let mut rows = Rows { metrics: Vec::new(), ..Rows::new(definitions, labels) };
    traces.scan(
        &projection,
        threads,
        |batch| -> Result<Part, ScoreError> {
            let kept = (0..batch.episodes.num_rows()).collect();
            Ok(Part::of(&batch.episodes, Scores { kept, metrics: Vec::new() }, labels))
        },
        |part: Part| {
            rows.append(part);
            Ok(())
        },
    )?;
    Ok(rows.sorted(definitions))
}

/// A batch as the engine takes it.
pub(super) fn view(batch: &EpisodeBatch) -> Batch<'_> {
    Batch { segments: Segments::new(&batch.offsets), steps: &batch.steps, episodes: &batch.episodes }
}

/// The columns to read.
pub(super) fn projection(
    traces: &TraceSet,
    definitions: &Definitions,
    engine: &Engine,
    labels: &[String],
) -> Result<Projection, ScoreError> {
    let (steps, mut constants) = engine.columns();
    for label in labels {
        check_label(traces, label)?;
        constants.push(label.clone());
    }
    let mut seen = Vec::new();
    constants.retain(|name| {
        let new = !EPISODE_COLUMNS.contains(&name.as_str()) && !seen.contains(name);
        seen.push(name.clone());
        new
    });
    let known = &definitions.catalog;
    let experiments = (!known.open).then(|| known.experiment.keys().cloned().collect());
    Ok(Projection { steps, constants, experiments })
}

/// Refuses a column to group by that is not constant in an episode, or not in every trace.
///
/// # Errors
/// [`ScoreError::Label`].
pub fn check_label(traces: &TraceSet, label: &str) -> Result<(), ScoreError> {
    let constant = |name: &str| COLUMNS.iter().any(|column| column.name == name && column.constant);
    let problem = column_problem(traces, label);
    if constant(label) && problem.is_none() {
        return Ok(());
    }
    let known: Vec<String> =
        traces.column_names().into_iter().filter(|name| constant(name)).map(str::to_owned).collect();
    let near = nearest(label, known.iter().map(String::as_str)).filter(|near| *near != label);
    let help = match (near, problem) {
        (Some(near), _) => format!("did you mean `{near}`?"),
        (None, Some((problem, _))) => problem,
        (None, None) => "its value changes from step to step".to_owned(),
    };
    Err(ScoreError::Label { name: label.to_owned(), known, help })
}

/// The rows of the table that one batch gives.
struct Part {
    keys: Vec<EpisodeKey>,
    labels: Vec<Vec<Option<String>>>,
    metrics: Vec<Vec<Option<i64>>>,
}

impl Part {
    fn of(episodes: &RecordBatch, scores: Scores, labels: &[String]) -> Self {
        let column = |name: &str| episodes.column_by_name(name).expect("the projection asks for this column");
        let label = |name: &String| scores.kept.iter().map(|&row| text_at(column(name), row)).collect();
        Self {
            keys: keys(episodes, scores.kept.iter().copied()),
            labels: labels.iter().map(label).collect(),
            metrics: scores.metrics,
        }
    }
}

/// The keys of some rows of [`EpisodeBatch::episodes`].
pub(super) fn keys(episodes: &RecordBatch, rows: impl IntoIterator<Item = usize>) -> Vec<EpisodeKey> {
    let column = |name: &str| episodes.column_by_name(name).expect("every batch has the key columns");
    let [episode_id, model, experiment, seed, run] = EPISODE_COLUMNS.map(column);
    let key = |row: usize| EpisodeKey {
        experiment: text_at(experiment, row).unwrap_or_default(),
        model: text_at(model, row).unwrap_or_default(),
        seed: int_at(seed, row),
        run: int_at(run, row),
        episode_id: text_at(episode_id, row).unwrap_or_default(),
    };
    rows.into_iter().map(key).collect()
}

/// The value at a row as text; `None` for null.
fn text_at(column: &ArrayRef, row: usize) -> Option<String> {
    if column.is_null(row) {
        return None;
    }
    match column.data_type() {
        DataType::Boolean => Some(column.as_boolean().value(row).to_string()),
        DataType::Int64 => Some(column.as_primitive::<Int64Type>().value(row).to_string()),
        DataType::Float64 => Some(column.as_primitive::<Float64Type>().value(row).to_string()),
        _ => {
            let dictionary = column.as_dictionary::<Int32Type>();
            let texts = dictionary.values().as_string::<i32>();
            let key = dictionary.key(row).filter(|&key| texts.is_valid(key))?;
            Some(texts.value(key).to_owned())
        }
    }
}

/// A seed or a run; the scan has checked that it fits.
fn int_at(column: &ArrayRef, row: usize) -> i32 {
    i32::try_from(column.as_primitive::<Int64Type>().value(row)).unwrap_or_default()
}

/// The table while it grows.
struct Rows {
    keys: Vec<EpisodeKey>,
    labels: Vec<LabelColumn>,
    metrics: Vec<MetricColumn>,
}

impl Rows {
    fn new(definitions: &Definitions, labels: &[String]) -> Self {
        let outputs = definitions.plan.outputs.iter();
        Self {
            keys: Vec::new(),
            labels: labels.iter().map(|name| LabelColumn { name: name.clone(), values: Vec::new() }).collect(),
            metrics: outputs.map(|output| MetricColumn { name: output.name.clone(), values: Vec::new() }).collect(),
        }
    }

    fn append(&mut self, part: Part) {
        self.keys.extend(part.keys);
        for (column, values) in self.labels.iter_mut().zip(part.labels) {
            column.values.extend(values);
        }
        for (column, values) in self.metrics.iter_mut().zip(part.metrics) {
            column.values.extend(values);
        }
    }

    fn sorted(self, definitions: &Definitions) -> EpisodeTable {
        let table = EpisodeTable {
            catalog: definitions.catalog.clone(),
            keys: self.keys,
            labels: self.labels,
            metrics: self.metrics,
        };
        table.sorted()
    }
}

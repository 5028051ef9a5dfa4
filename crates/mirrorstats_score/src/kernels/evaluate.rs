//! Runs a physical plan over one batch of whole episodes: every step gives one vector.
//!
//! It deliberately does not know the source, order or thread of batches.

use arrow::array::{Array, ArrayRef, AsArray as _, BooleanArray, Datum, RecordBatch, UInt32Array};
use arrow::compute::kernels::window::shift;
use arrow::compute::kernels::{boolean, cmp, numeric};
use arrow::compute::{cast, filter as select, nullif};
use arrow::datatypes::{DataType, Int64Type};
use arrow::error::ArrowError;

use crate::error::{EngineError, StepError};
use crate::kernels::elementwise::{arithmetic, case, coalesce, compare, divide, numbers, scale};
use crate::kernels::segments::{Segments, repeat, repeat_bool, test_symbols, truths};
use crate::kernels::vectors::{Symbols, Vector};
use crate::physical::{Kernel, Metric, PhysicalPlan, Scores, Shape, Step, StepId};
use mirrorstats_metric::catalogs::catalog::Kind;
use mirrorstats_metric::columns::Type;
use mirrorstats_metric::logical_plan::plan::{Aggregate, Comparison};
use mirrorstats_trace::scan::Texts;

/// Whole episodes as columns: one batch with a row per timestep, one with a row per episode.
#[derive(Clone, Copy, Debug)]
pub struct Batch<'a> {
    pub segments: Segments<'a>,
    /// Columns per timestep, by name: booleans, 64-bit integers, doubles, dictionaries of text with 32-bit keys.
    pub steps: &'a RecordBatch,
    /// Text columns per timestep that are not in `steps`.
    pub texts: &'a [Texts],
    pub episodes: &'a RecordBatch,
}

#[derive(Clone, Debug, PartialEq)]
pub struct BatchScores {
    /// The episodes that the filter keeps; all if absent.
    pub kept: Option<BooleanArray>,
    /// One column per metric, of truth values or 64-bit integers, with a value for each episode kept; null if
    /// undefined.
    pub metrics: Vec<ArrayRef>,
}

impl PhysicalPlan {
    pub fn evaluate(&self, batch: &Batch) -> Result<Evaluated, EngineError> {
        self.check_batch(batch.segments.rows(), batch.segments.len())?;
        let vectors = Vec::with_capacity(self.steps.len());
        let mut evaluation = Evaluation { plan: self, batch, symbols: Symbols::default(), vectors };
        for (at, step) in self.steps.iter().enumerate() {
            let vector = evaluation.step(StepId(at), step).map_err(|error| self.error(StepId(at), error))?;
            evaluation.vectors.push(vector);
        }
        Ok(Evaluated { vectors: evaluation.vectors, symbols: evaluation.symbols })
    }

    fn error(&self, at: StepId, error: StepError) -> EngineError {
        match error {
            StepError::Engine(error) => error,
            StepError::Kernel(reason) => {
                let metric = self.metrics.get(&at).map_or("the filter", String::as_str).to_owned();
                match (reason, &self.steps[at.0].kernel) {
                    (ArrowError::CastError(value), Kernel::Scale(_, decimals)) => {
                        EngineError::NotADecimal { metric, value, decimals: *decimals }
                    }
                    (reason, _) => EngineError::Overflow { metric, reason: reason.to_string() },
                }
            }
        }
    }
}

#[derive(Debug)]
pub struct Evaluated {
    vectors: Vec<Vector>,
    symbols: Symbols,
}

impl Evaluated {
    pub fn scores(&self, scores: &Scores) -> Result<BatchScores, EngineError> {
        let kept = scores.filter.map(|step| BooleanArray::new(truths(self.of(step).bools()), None));
        let metrics = scores.metrics.iter().map(|metric| self.metric(metric, kept.as_ref()));
        Ok(BatchScores { metrics: metrics.collect::<Result<_, _>>()?, kept })
    }

    fn metric(&self, metric: &Metric, kept: Option<&BooleanArray>) -> Result<ArrayRef, EngineError> {
        let column = self.of(metric.step).array();
        let column = match kept {
            Some(kept) => select(column, kept).expect("a filter has a value for each episode"),
            None => column.clone(),
        };
        let ints = column.as_primitive_opt::<Int64Type>();
        let mut values = ints.into_iter().flat_map(|ints| ints.iter().flatten());
        match values.find(|value| metric.kind == Kind::Rate && !matches!(value, 0 | 1)) {
            Some(value) => Err(EngineError::NotARate { metric: metric.name.clone(), value }),
            None => Ok(column),
        }
    }

    pub(crate) fn of(&self, id: StepId) -> &Vector {
        &self.vectors[id.0]
    }

    pub(crate) fn text(&self, symbol: u32) -> &str {
        self.symbols.text(symbol)
    }
}

struct Evaluation<'e> {
    plan: &'e PhysicalPlan,
    batch: &'e Batch<'e>,
    symbols: Symbols,
    vectors: Vec<Vector>,
}

struct Operand<'a> {
    array: &'a dyn Array,
    is_one: bool,
}

impl Datum for Operand<'_> {
    fn get(&self) -> (&dyn Array, bool) {
        (self.array, self.is_one)
    }
}

impl Evaluation<'_> {
    fn of(&self, id: StepId) -> &Vector {
        &self.vectors[id.0]
    }

    fn operand(&self, id: StepId) -> Operand<'_> {
        Operand { array: self.of(id).array(), is_one: self.plan.step(id).shape == Shape::One }
    }

    fn step(&mut self, id: StepId, step: &Step) -> Result<Vector, StepError> {
        let segments = self.batch.segments;
        match &step.kernel {
            Kernel::Column(name) => Ok(self.column(name, step.shape)?),
            Kernel::Constant(constant) => Ok(Vector::constant(constant, step.ty, &mut self.symbols)),
            Kernel::Times => Ok(segments.times().into()),
            Kernel::Lengths => Ok(segments.lengths().into()),
            Kernel::Repeat(x) => Ok(self.repeat(*x, step)),
            Kernel::Spread(x) => Ok(self.spread(*x, step.ty)),
            Kernel::Within(windows) => Ok(self.within(windows)),
            Kernel::Search { aggregate, condition, within } => Ok(self.search(*aggregate, *condition, *within)),
            Kernel::Fold(aggregate, x) => Ok(self.fold(*aggregate, *x)?),
            Kernel::At { values, moments } => Ok(self.at(*values, *moments, step.ty)),
            Kernel::Lag(x) => {
                let shifted = shift(self.of(*x).array(), 1)?;
                Ok(Vector::Array(nullif(&shifted, &segments.first_rows())?))
            }
            Kernel::NullWhereAbsent { values, moments } => {
                let absent = BooleanArray::new(!&segments.exist(self.of(*moments).ints()), None);
                Ok(Vector::Array(nullif(self.of(*values).array(), &absent)?))
            }
            kernel => Ok(self.elementwise(id, kernel, step.ty)?),
        }
    }

    fn column(&mut self, name: &str, shape: Shape) -> Result<Vector, EngineError> {
        let timesteps = shape == Shape::Timesteps;
        if timesteps && let Some(texts) = self.batch.texts.iter().find(|texts| texts.name == name) {
            return Ok(self.symbols.of_texts(texts));
        }
        let table = if timesteps { self.batch.steps } else { self.batch.episodes };
        let column = table.column_by_name(name).ok_or_else(|| EngineError::MissingColumn(name.to_owned()))?;
        match column.data_type() {
            DataType::Boolean | DataType::Int64 => Ok(Vector::Array(column.clone())),
            DataType::Float64 => Ok(numbers(column.clone(), Type::Float)),
            DataType::Dictionary(key, value) if **key == DataType::Int32 && **value == DataType::Utf8 => {
                Ok(self.symbols.of_column(column.as_dictionary()))
            }
            other => Err(EngineError::ColumnType { column: name.to_owned(), found: other.to_string() }),
        }
    }

    fn repeat(&self, x: StepId, step: &Step) -> Vector {
        let segments = self.batch.segments;
        let rows = if step.shape == Shape::Timesteps { segments.rows() } else { segments.len() };
        let value = self.of(x);
        match step.ty {
            Type::Bool => repeat_bool(value.bools(), rows).into(),
            Type::Int => repeat(value.ints(), rows).into(),
            Type::Float => repeat(value.floats(), rows).into(),
            Type::Text => repeat(value.symbols(), rows).into(),
        }
    }

    fn spread(&self, x: StepId, ty: Type) -> Vector {
        let (segments, values) = (self.batch.segments, self.of(x));
        match ty {
            Type::Bool => segments.spread_bools(values.bools()).into(),
            Type::Int => segments.spread(values.ints()).into(),
            Type::Float => segments.spread(values.floats()).into(),
            Type::Text => segments.spread(values.symbols()).into(),
        }
    }

    fn within(&self, windows: &[(Comparison, StepId)]) -> Vector {
        let windows: Vec<_> =
            windows.iter().map(|(comparison, moments)| (*comparison, self.of(*moments).ints())).collect();
        Vector::Rows(self.batch.segments.within(&windows).into())
    }

    fn search(&self, aggregate: Aggregate, condition: StepId, within: Option<StepId>) -> Vector {
        let condition = self.of(condition).bools();
        Vector::Array(match within {
            Some(rows) => Segments::search(aggregate, condition, self.of(rows).rows().iter().cloned()),
            None => Segments::search(aggregate, condition, self.batch.segments.whole()),
        })
    }

    fn fold(&self, aggregate: Aggregate, x: StepId) -> Result<Vector, ArrowError> {
        let (segments, values) = (self.batch.segments, self.of(x));
        Ok(match (aggregate, self.plan.step(x).ty) {
            (Aggregate::All, _) => segments.all(values.bools()).into(),
            (Aggregate::Sum, _) => segments.sums(values.ints())?.into(),
            (Aggregate::Min, Type::Float) => {
                segments.fold(values.floats(), |a, b| if b.total_cmp(&a).is_lt() { b } else { a }).into()
            }
            (_, Type::Float) => {
                segments.fold(values.floats(), |a, b| if b.total_cmp(&a).is_gt() { b } else { a }).into()
            }
            (Aggregate::Min, _) => segments.fold(values.ints(), i64::min).into(),
            (_, _) => segments.fold(values.ints(), i64::max).into(),
        })
    }

    fn at(&self, values: StepId, moments: StepId, ty: Type) -> Vector {
        let (segments, values, moments) = (self.batch.segments, self.of(values), self.of(moments).ints());
        match (values, ty) {
            (Vector::Keyed(keyed), _) => keyed.at(segments, moments).into(),
            (values, Type::Bool) => segments.bools_at(values.bools(), moments).into(),
            (values, Type::Int) => segments.at(values.ints(), moments).into(),
            (values, Type::Float) => segments.at(values.floats(), moments).into(),
            (values, Type::Text) => segments.at(values.symbols(), moments).into(),
        }
    }

    fn elementwise(&self, id: StepId, kernel: &Kernel, ty: Type) -> Result<Vector, ArrowError> {
        let segments = self.batch.segments;
        let bools = |id: StepId| self.of(id).bools();
        let matches = |symbol| self.plan.patterns[&id].is_match(self.symbols.text(symbol));
        Ok(match kernel {
            Kernel::Symbols(keys) => self.of(*keys).keyed().symbols().into(),
            Kernel::KeysEqualText { keys, text, equal } => {
                self.of(*keys).keyed().compare_with(self.of(*text).symbols(), *equal).into()
            }
            Kernel::KeysEqualEpisode { keys, texts, equal } => {
                self.of(*keys).keyed().compare(segments, self.of(*texts).symbols(), *equal).into()
            }
            Kernel::CompareTexts(comparison, x, y) => {
                let ranks = self.symbols.ranks();
                let ranked = |id: StepId| -> UInt32Array {
                    self.of(id).symbols().unary(|symbol| ranks.get(symbol as usize).copied().unwrap_or(0))
                };
                let (left, right) = (ranked(*x), ranked(*y));
                let operand = |id: StepId, array| Operand { array, is_one: self.plan.step(id).shape == Shape::One };
                compare(*comparison, &operand(*x, &left), &operand(*y, &right))?.into()
            }
            Kernel::KeysMatch(keys, _) => self.of(*keys).keyed().test(matches).into(),
            Kernel::SymbolsMatch(symbols, _) => test_symbols(self.of(*symbols).symbols(), matches).into(),
            Kernel::Not(x) => boolean::not(bools(*x))?.into(),
            Kernel::And(x, y) => boolean::and_kleene(bools(*x), bools(*y))?.into(),
            Kernel::Or(x, y) => boolean::or_kleene(bools(*x), bools(*y))?.into(),
            Kernel::Compare(comparison, x, y) => compare(*comparison, &self.operand(*x), &self.operand(*y))?.into(),
            Kernel::Window(comparison, moments) => segments.window(*comparison, self.of(*moments).ints()).into(),
            Kernel::Distinct(x, y) => cmp::distinct(&self.operand(*x), &self.operand(*y))?.into(),
            Kernel::IsNull(x) => boolean::is_null(self.of(*x).validity())?.into(),
            Kernel::IsTrue(x) => BooleanArray::new(truths(bools(*x)), None).into(),
            Kernel::IsFalse(x) => BooleanArray::new(truths(&boolean::not(bools(*x))?), None).into(),
            Kernel::Arithmetic(op, x, y) => numbers(arithmetic(*op, &self.operand(*x), &self.operand(*y))?, ty),
            Kernel::Divide(op, x, y) => divide(*op, self.of(*x).ints(), self.of(*y).ints())?.into(),
            Kernel::Negate(x) => numbers(numeric::neg(self.of(*x).array())?, ty),
            Kernel::Case { branches, otherwise } => {
                let branches: Vec<_> = branches.iter().map(|(when, then)| (self.of(*when), self.of(*then))).collect();
                case(&branches, self.of(*otherwise), ty)
            }
            Kernel::Coalesce(values) => coalesce(&values.iter().map(|id| self.of(*id)).collect::<Vec<_>>(), ty)?,
            Kernel::IntFromBool(x) => Vector::Array(cast(self.of(*x).array(), &DataType::Int64)?),
            Kernel::FloatFromInt(x) => Vector::Array(cast(self.of(*x).array(), &DataType::Float64)?),
            Kernel::Scale(x, decimals) => scale(self.of(*x).floats(), *decimals)?.into(),
            _ => unreachable!("`step` evaluates the other kernels"),
        })
    }
}

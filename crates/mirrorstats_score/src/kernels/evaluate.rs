//! Runs a physical plan over one batch of whole episodes: every step gives one vector.
//!
//! It deliberately does not know the source, order or thread of batches.

use std::sync::Arc;

use arrow::array::{Array, ArrayRef, AsArray as _, BooleanArray, Datum, RecordBatch, Scalar};
use arrow::compute::kernels::window::shift;
use arrow::compute::kernels::{boolean, cmp, numeric};
use arrow::compute::{cast, filter as select, nullif, take};
use arrow::datatypes::{DataType, Int64Type, UInt32Type};
use arrow::error::ArrowError;

use crate::error::EngineError;
use crate::kernels::elementwise::{arithmetic, case, coalesce, compare, divide, numbers, scale};
use crate::kernels::segments::{Segments, repeat, repeat_bool, test_symbols, truths};
use crate::kernels::vectors::{Coded, Symbols, Vector};
use crate::physical::{Kernel, Metric, PhysicalPlan, Scores, Shape, Step, StepId};
use mirrorstats_metric::catalogs::catalog::Kind;
use mirrorstats_metric::columns::Type;
use mirrorstats_metric::logical_plan::plan::{Aggregate, Arithmetic, Comparison, Op};
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
            let vector = evaluation.step(StepId(at), step)?;
            evaluation.vectors.push(vector);
        }
        Ok(Evaluated { vectors: evaluation.vectors, symbols: evaluation.symbols })
    }

    fn error(&self, at: StepId, reason: ArrowError) -> EngineError {
        let metric = self.metrics.get(&at).map_or("the filter", String::as_str).to_owned();
        match (reason, &self.step(at).kernel) {
            (ArrowError::CastError(value), Kernel::Op(Op::Scale(_, decimals))) => {
                EngineError::NotADecimal { metric, value, decimals: *decimals }
            }
            (reason, _) => EngineError::Overflow { metric, reason: reason.to_string() },
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

impl Evaluation<'_> {
    fn of(&self, id: StepId) -> &Vector {
        &self.vectors[id.0]
    }

    fn operand(&self, id: StepId) -> Box<dyn Datum> {
        self.as_operand(id, self.of(id).array().clone())
    }

    /// Values of a step; one that represents all is a scalar.
    fn as_operand(&self, id: StepId, values: ArrayRef) -> Box<dyn Datum> {
        if self.plan.step(id).shape == Shape::One { Box::new(Scalar::new(values)) } else { Box::new(values) }
    }

    fn step(&mut self, id: StepId, step: &Step) -> Result<Vector, EngineError> {
        match &step.kernel {
            Kernel::Op(Op::Column(name)) => self.column(name, step.shape),
            Kernel::Op(Op::Constant(constant)) => Ok(Vector::constant(constant, step.ty, &mut self.symbols)),
            kernel => self.kernel(id, kernel, step).map_err(|reason| self.plan.error(id, reason)),
        }
    }

    fn kernel(&self, id: StepId, kernel: &Kernel, step: &Step) -> Result<Vector, ArrowError> {
        let segments = self.batch.segments;
        Ok(match kernel {
            Kernel::Op(Op::Spread(x)) if self.plan.step(*x).shape == Shape::One => self.repeat(*x, step),
            Kernel::Op(op) => self.operation(id, op, step.ty)?,
            Kernel::Symbols(keys) => self.of(*keys).keyed().symbols().into(),
            Kernel::CompareTexts(comparison, x, y) => {
                let ranks = self.symbols.ranks();
                let ranked = |id: StepId| {
                    let rank = |symbol| ranks.get(symbol as usize).copied().unwrap_or(0);
                    self.as_operand(id, Arc::new(self.of(id).symbols().unary::<_, UInt32Type>(rank)))
                };
                compare(*comparison, &*ranked(*x), &*ranked(*y))?.into()
            }
            Kernel::KeysEqual { keys, text, equal } => {
                let (keys, texts) = (self.of(*keys).keyed(), self.of(*text).symbols());
                match self.plan.step(*text).shape {
                    Shape::One => keys.compare_with(texts, *equal).into(),
                    Shape::Episodes | Shape::Timesteps => keys.compare(segments, texts, *equal).into(),
                }
            }
            Kernel::Window(comparison, moments) => segments.window(*comparison, self.of(*moments).ints()).into(),
            Kernel::Within(windows) => self.within(windows),
            Kernel::Search { aggregate, condition, within } => self.search(*aggregate, *condition, *within),
            Kernel::NullWhereAbsent { values, moments } => {
                let absent = boolean::is_null(&segments.rows_at(self.of(*moments).ints()))?;
                Vector::Array(nullif(self.of(*values).array(), &absent)?)
            }
        })
    }

    fn column(&mut self, name: &str, shape: Shape) -> Result<Vector, EngineError> {
        let (texts, table) = match shape {
            Shape::Timesteps => (self.batch.texts, self.batch.steps),
            Shape::Episodes | Shape::One => (&[][..], self.batch.episodes),
        };
        if let Some(coded) = Coded::of(texts, table, name) {
            return Ok(Vector::Keyed(Arc::new(self.symbols.of_coded(coded))));
        }
        let column = table.column_by_name(name).ok_or_else(|| EngineError::MissingColumn(name.to_owned()))?;
        match column.data_type() {
            DataType::Boolean | DataType::Int64 => Ok(Vector::Array(column.clone())),
            DataType::Float64 => Ok(numbers(column.clone(), Type::Float)),
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

    fn operation(&self, id: StepId, op: &Op<StepId>, ty: Type) -> Result<Vector, ArrowError> {
        let segments = self.batch.segments;
        let bools = |id: StepId| self.of(id).bools();
        Ok(match op {
            Op::Time => segments.times().into(),
            Op::Length => segments.lengths().into(),
            Op::Spread(x) => self.spread(*x, ty),
            Op::Not(x) => boolean::not(bools(*x))?.into(),
            Op::And(x, y) => boolean::and_kleene(bools(*x), bools(*y))?.into(),
            Op::Or(x, y) => boolean::or_kleene(bools(*x), bools(*y))?.into(),
            Op::Compare(comparison, x, y) => compare(*comparison, &*self.operand(*x), &*self.operand(*y))?.into(),
            Op::Distinct(x, y) => cmp::distinct(&*self.operand(*x), &*self.operand(*y))?.into(),
            Op::IsNull(x) => boolean::is_null(self.of(*x).validity())?.into(),
            Op::IsTrue(x) => BooleanArray::new(truths(bools(*x)), None).into(),
            Op::IsFalse(x) => BooleanArray::new(truths(&boolean::not(bools(*x))?), None).into(),
            Op::Arithmetic(op @ (Arithmetic::Quotient | Arithmetic::Remainder), x, y) => {
                divide(*op, self.of(*x).ints(), self.of(*y).ints())?.into()
            }
            Op::Arithmetic(op, x, y) => numbers(arithmetic(*op, &*self.operand(*x), &*self.operand(*y))?, ty),
            Op::Negate(x) => numbers(numeric::neg(self.of(*x).array())?, ty),
            Op::Coalesce(values) => coalesce(&values.iter().map(|id| self.of(*id)).collect::<Vec<_>>(), ty)?,
            Op::Matches(x, _) => {
                let matches = |symbol| self.plan.patterns[&id].is_match(self.symbols.text(symbol));
                match self.of(*x) {
                    Vector::Keyed(keyed) => keyed.test(matches).into(),
                    texts => test_symbols(texts.symbols(), matches).into(),
                }
            }
            Op::IntFromBool(x) => Vector::Array(cast(self.of(*x).array(), &DataType::Int64)?),
            Op::FloatFromInt(x) => Vector::Array(cast(self.of(*x).array(), &DataType::Float64)?),
            Op::Scale(x, decimals) => scale(self.of(*x).floats(), *decimals)?.into(),
            Op::Aggregate(aggregate, x) => self.fold(*aggregate, *x)?,
            Op::At(values, moments) => {
                let rows = segments.rows_at(self.of(*moments).ints());
                match self.of(*values) {
                    Vector::Keyed(keyed) => keyed.at(&rows)?.into(),
                    values => Vector::Array(take(values.array(), &rows, None)?),
                }
            }
            Op::Lag(x) => Vector::Array(nullif(&shift(self.of(*x).array(), 1)?, &segments.first_rows())?),
            Op::Case { branches, otherwise: Some(otherwise) } => {
                let branches: Vec<_> = branches.iter().map(|(when, then)| (self.of(*when), self.of(*then))).collect();
                case(&branches, self.of(*otherwise), ty)
            }
            Op::Case { otherwise: None, .. } => unreachable!("the physical plan gives each case a last value"),
            Op::Column(_) | Op::Constant(_) => unreachable!("`step` reads these"),
        })
    }
}

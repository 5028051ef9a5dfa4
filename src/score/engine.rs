//! The native engine: a plan evaluated over one batch of whole episodes.
//!
//! Every node becomes one column, a value a step or a value an episode, by a kernel over all rows
//! of the batch at once; what several metrics share is evaluated once. Truth values are bits.
//!
//! It deliberately does not know where batches come from, in which order, or on which thread.

use arrow::array::{Array, ArrayRef, AsArray as _, BooleanArray, Datum, Int64Array, RecordBatch, UInt32Array};
use arrow::compute::kernels::{boolean, cmp, numeric, zip};
use arrow::compute::{cast, prep_null_mask_filter};
use arrow::datatypes::{DataType, Float64Type, Int32Type};
use arrow::error::ArrowError;
use regex::Regex;

use super::segments::{Segments, repeat, repeat_bool, test_symbols};
use super::values::{Symbols, Values, canonical, truths};
use crate::metric::catalog::Kind;
use crate::metric::columns::{Level, Type};
use crate::metric::plan::{Aggregate, Arithmetic, Comparison, Constant, NodeId, Op, Output, Plan};

/// Whole episodes in columns: one batch with a row a step, one with a row an episode.
#[derive(Clone, Copy, Debug)]
pub struct Batch<'a> {
    /// Where episodes begin and end among the steps.
    pub segments: Segments<'a>,
    /// Step-level columns by name: booleans, 64-bit integers, doubles, dictionaries of text with 32-bit keys.
    pub steps: &'a RecordBatch,
    /// Columns that are constant in an episode, a row an episode; the same types.
    pub episodes: &'a RecordBatch,
}

/// The scores of a batch.
#[derive(Clone, Debug, PartialEq)]
pub struct Scores {
    /// The positions of the episodes that the filter keeps, ascending.
    pub kept: Vec<usize>,
    /// A column a metric of the plan, a value for each episode kept; `None` where the metric is undefined.
    pub metrics: Vec<Vec<Option<i64>>>,
}

/// What keeps a batch from being scored.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    /// A column of the plan is not in the batch.
    #[error("the column `{0}` is not in the batch; project every column of the plan")]
    MissingColumn(String),
    /// A column has a type that the engine does not take.
    #[error(
        "the column `{column}` has the type {found}; expected booleans, 64-bit integers, doubles or a dictionary of text"
    )]
    ColumnType {
        /// The column.
        column: String,
        /// Its Arrow type.
        found: String,
    },
    /// A result beyond 64 bits.
    #[error("`{metric}` leaves 64-bit integers: {reason}; use smaller numbers in its definition")]
    Overflow {
        /// The first metric that needs the number.
        metric: String,
        /// The engine's words.
        reason: String,
    },
    /// A metric that declares itself a rate has another value than 0 or 1.
    #[error("`{metric}` declares the unit `rate`, but an episode has {value}; a rate is 0 or 1 an episode")]
    NotARate {
        /// The metric.
        metric: String,
        /// The value found.
        value: i64,
    },
}

/// A plan made ready: what to evaluate, in which order, patterns compiled.
#[derive(Clone, Debug)]
pub struct Engine<'p> {
    plan: &'p Plan,
    order: Vec<NodeId>,
    patterns: Vec<Option<Regex>>,
}

impl<'p> Engine<'p> {
    /// An engine for the outputs and the filter of a plan.
    pub fn new(plan: &'p Plan) -> Self {
        Self::for_nodes(plan, plan.outputs.iter().map(|output| output.node).chain(plan.filter))
    }

    /// An engine for some nodes of a plan.
    pub(super) fn for_nodes(plan: &'p Plan, roots: impl IntoIterator<Item = NodeId>) -> Self {
        let order = evaluation_order(plan, roots);
        let mut patterns = vec![None; plan.nodes().len()];
        for &id in &order {
            if let Op::Matches(_, pattern) = &plan.node(id).op {
                patterns[id.index()] = Some(Regex::new(pattern).expect("the binder has compiled this pattern"));
            }
        }
        Self { plan, order, patterns }
    }

    /// The step-level and the episode-level columns that a batch must have.
    pub fn columns(&self) -> (Vec<String>, Vec<String>) {
        let (mut steps, mut episodes) = (Vec::new(), Vec::new());
        for (name, level) in self.plan.columns(&self.order) {
            if level == Level::Step { steps.push(name.to_owned()) } else { episodes.push(name.to_owned()) }
        }
        (steps, episodes)
    }

    /// The scores of one batch.
    ///
    /// # Errors
    /// When a column is missing or of another type, when a number leaves 64 bits, when a rate is not 0 or 1.
    pub fn score(&self, batch: &Batch) -> Result<Scores, EngineError> {
        let values = self.evaluate(batch)?;
        let kept = match self.plan.filter {
            Some(node) => truths(values.of(node).bools()).set_indices().collect(),
            None => (0..batch.segments.len()).collect::<Vec<_>>(),
        };
        let metric = |output: &Output| {
            let column = integers(values.of(output.node), &kept);
            let strange = column.iter().flatten().find(|&&value| output.kind == Kind::Rate && !matches!(value, 0 | 1));
            match strange {
                Some(&value) => Err(EngineError::NotARate { metric: output.name.clone(), value }),
                None => Ok(column),
            }
        };
        let metrics = self.plan.outputs.iter().map(metric).collect::<Result<_, _>>()?;
        Ok(Scores { kept, metrics })
    }

    /// Every node that is needed, evaluated.
    pub(super) fn evaluate(&self, batch: &Batch) -> Result<Evaluated, EngineError> {
        let mut evaluation = Evaluation {
            engine: self,
            batch,
            symbols: Symbols::default(),
            values: vec![None; self.plan.nodes().len()],
        };
        for &id in &self.order {
            let value = evaluation.node(id)?;
            evaluation.values[id.index()] = Some(value);
        }
        Ok(Evaluated { values: evaluation.values, symbols: evaluation.symbols })
    }

    fn overflow(&self, at: NodeId, reason: &ArrowError) -> EngineError {
        let needs = |root: NodeId| self.plan.needed_by([root]).contains(&at);
        let metric = self.plan.outputs.iter().find(|output| needs(output.node));
        let metric = metric.map_or("the filter", |output| output.name.as_str()).to_owned();
        EngineError::Overflow { metric, reason: reason.to_string() }
    }
}

/// A window, `t` compared with an episode's moment, is evaluated from the moment alone.
fn window(plan: &Plan, op: &Op) -> Option<(Comparison, NodeId)> {
    match op {
        Op::Compare(comparison, left, right) if plan.node(*left).op == Op::Time => match &plan.node(*right).op {
            Op::Spread(moment) => Some((*comparison, *moment)),
            Op::Constant(_) => Some((*comparison, *right)),
            _ => None,
        },
        _ => None,
    }
}

/// What must be evaluated for some nodes, operands first.
fn evaluation_order(plan: &Plan, roots: impl IntoIterator<Item = NodeId>) -> Vec<NodeId> {
    let mut needed = vec![false; plan.nodes().len()];
    roots.into_iter().for_each(|root| needed[root.index()] = true);
    let ids: Vec<NodeId> = plan.ids().collect();
    for &id in ids.iter().rev() {
        if needed[id.index()] {
            let op = &plan.node(id).op;
            let operands = window(plan, op).map_or_else(|| op.operands(), |(_, moment)| vec![moment]);
            for operand in operands {
                needed[operand.index()] = true;
            }
        }
    }
    ids.into_iter().filter(|id| needed[id.index()]).collect()
}

/// The columns of the nodes of a plan.
#[derive(Debug)]
pub(super) struct Evaluated {
    values: Vec<Option<Values>>,
    symbols: Symbols,
}

impl Evaluated {
    /// The column of a node that was asked for.
    pub(super) fn of(&self, id: NodeId) -> &Values {
        known(&self.values, id)
    }

    /// The text of a symbol among the values.
    pub(super) fn text(&self, symbol: u32) -> &str {
        self.symbols.text(symbol)
    }
}

fn known(values: &[Option<Values>], id: NodeId) -> &Values {
    values[id.index()].as_ref().expect("operands come before their users in the order of evaluation")
}

/// An episode-level column as integers, the episodes kept alone.
fn integers(values: &Values, kept: &[usize]) -> Vec<Option<i64>> {
    let valid = |row: &usize| values.array().is_valid(*row);
    if values.ty() == Type::Bool {
        let bools = values.bools();
        return kept.iter().map(|row| valid(row).then(|| i64::from(bools.value(*row)))).collect();
    }
    let ints = values.ints();
    kept.iter().map(|row| valid(row).then(|| ints.value(*row))).collect()
}

/// One batch underway.
struct Evaluation<'e, 'p> {
    engine: &'e Engine<'p>,
    batch: &'e Batch<'e>,
    symbols: Symbols,
    values: Vec<Option<Values>>,
}

impl Evaluation<'_, '_> {
    fn of(&self, id: NodeId) -> &Values {
        known(&self.values, id)
    }

    fn node(&mut self, id: NodeId) -> Result<Values, EngineError> {
        let node = self.engine.plan.node(id);
        let overflow = |error: ArrowError| self.engine.overflow(id, &error);
        let of = |id: NodeId| known(&self.values, id);
        let truth = |array: BooleanArray| Values::new(array, Type::Bool);
        let segments = self.batch.segments;
        Ok(match &node.op {
            Op::Column(name) => self.column(name, node.level)?,
            Op::Constant(constant) => Values::constant(constant, node.ty, &mut self.symbols),
            Op::Time => Values::new(segments.times(), Type::Int),
            Op::Length => Values::new(segments.lengths(), Type::Int),
            Op::Spread(x) => self.spread(of(*x), node.level),
            Op::Not(x) => truth(boolean::not(of(*x).bools()).map_err(overflow)?),
            Op::And(x, y) => {
                let (x, y) = (self.full_bools(*x, node.level), self.full_bools(*y, node.level));
                truth(boolean::and_kleene(&x, &y).map_err(overflow)?)
            }
            Op::Or(x, y) => {
                let (x, y) = (self.full_bools(*x, node.level), self.full_bools(*y, node.level));
                truth(boolean::or_kleene(&x, &y).map_err(overflow)?)
            }
            Op::Compare(comparison, x, y) => truth(self.compare(&node.op, *comparison, *x, *y).map_err(overflow)?),
            Op::Distinct(x, y) => truth(cmp::distinct(of(*x), of(*y)).map_err(overflow)?),
            Op::IsNull(x) => truth(boolean::is_null(of(*x).array()).map_err(overflow)?),
            Op::IsTrue(x) => truth(BooleanArray::new(truths(of(*x).bools()), None)),
            Op::IsFalse(x) => truth(BooleanArray::new(truths(&boolean::not(of(*x).bools()).map_err(overflow)?), None)),
            Op::Arithmetic(op, x, y) => self.arithmetic(*op, node.ty, node.level, *x, *y).map_err(overflow)?,
            Op::Negate(x) => numbers(numeric::neg(of(*x).array()).map_err(overflow)?, node.ty),
            Op::Case { branches, otherwise } => {
                self.case(branches, *otherwise, node.ty, node.level).map_err(overflow)?
            }
            Op::Coalesce(values) => self.coalesce(values, node.ty, node.level).map_err(overflow)?,
            Op::Matches(x, _) => {
                let pattern = self.engine.patterns[id.index()].as_ref().expect("compiled with the engine");
                truth(test_symbols(of(*x).symbols(), |symbol| pattern.is_match(self.symbols.text(symbol))))
            }
            Op::IntFromBool(x) => Values::shared(cast(of(*x).array(), &DataType::Int64).map_err(overflow)?, Type::Int),
            Op::FloatFromInt(x) => {
                Values::shared(cast(of(*x).array(), &DataType::Float64).map_err(overflow)?, Type::Float)
            }
            Op::Aggregate(aggregate, x) => self.aggregate(*aggregate, *x).map_err(overflow)?,
            Op::At(x, moment) => self.at(of(*x), of(*moment).ints()),
        })
    }

    fn column(&mut self, name: &str, level: Level) -> Result<Values, EngineError> {
        let table = if level == Level::Step { self.batch.steps } else { self.batch.episodes };
        let column = table.column_by_name(name).ok_or_else(|| EngineError::MissingColumn(name.to_owned()))?;
        match column.data_type() {
            DataType::Boolean => Ok(Values::shared(column.clone(), Type::Bool)),
            DataType::Int64 => Ok(Values::shared(column.clone(), Type::Int)),
            DataType::Float64 => Ok(numbers(column.clone(), Type::Float)),
            DataType::Dictionary(key, value) if **key == DataType::Int32 && **value == DataType::Utf8 => {
                Ok(Values::new(self.symbols.of_column(column.as_dictionary::<Int32Type>()), Type::Text))
            }
            other => Err(EngineError::ColumnType { column: name.to_owned(), found: other.to_string() }),
        }
    }

    fn rows(&self, level: Level) -> usize {
        if level == Level::Step { self.batch.segments.rows() } else { self.batch.segments.len() }
    }

    fn spread(&self, values: &Values, level: Level) -> Values {
        let (segments, ty) = (self.batch.segments, values.ty());
        if values.is_single() {
            let rows = self.rows(level);
            return match ty {
                Type::Bool => Values::new(repeat_bool(values.bools(), rows), ty),
                Type::Int => Values::new(repeat(values.ints(), rows), ty),
                Type::Float => Values::new(repeat(values.floats(), rows), ty),
                Type::Text => Values::new(repeat(values.symbols(), rows), ty),
            };
        }
        match ty {
            Type::Bool => Values::new(segments.spread_bools(values.bools()), ty),
            Type::Int => Values::new(segments.spread(values.ints()), ty),
            Type::Float => Values::new(segments.spread(values.floats()), ty),
            Type::Text => Values::new(segments.spread(values.symbols()), ty),
        }
    }

    /// The values of a node, a constant written out.
    fn full(&self, id: NodeId, level: Level) -> Values {
        let values = self.of(id);
        if values.is_single() { self.spread(values, level) } else { values.clone() }
    }

    fn full_bools(&self, id: NodeId, level: Level) -> BooleanArray {
        self.full(id, level).bools().clone()
    }

    fn compare(&self, op: &Op, comparison: Comparison, x: NodeId, y: NodeId) -> Result<BooleanArray, ArrowError> {
        if let Some((comparison, moment)) = window(self.engine.plan, op) {
            return Ok(self.batch.segments.window(comparison, self.full(moment, Level::Episode).ints()));
        }
        let (x, y) = (self.of(x), self.of(y));
        match (x.ty(), comparison) {
            (Type::Text, Comparison::Less | Comparison::LessEqual | Comparison::Greater | Comparison::GreaterEqual) => {
                let ranks = self.symbols.ranks();
                let ranked = |values: &Values| Ranked {
                    array: values.symbols().unary(|symbol| ranks.get(symbol as usize).copied().unwrap_or(0)),
                    single: values.is_single(),
                };
                compare(comparison, &ranked(x), &ranked(y))
            }
            _ => compare(comparison, x, y),
        }
    }

    fn arithmetic(&self, op: Arithmetic, ty: Type, level: Level, x: NodeId, y: NodeId) -> Result<Values, ArrowError> {
        let (a, b) = (self.of(x), self.of(y));
        let result = match op {
            Arithmetic::Add => numeric::add(a, b)?,
            Arithmetic::Subtract => numeric::sub(a, b)?,
            Arithmetic::Multiply => numeric::mul(a, b)?,
            Arithmetic::Quotient | Arithmetic::Remainder => {
                let (a, b) = (self.full(x, level), self.full(y, level));
                return Ok(Values::new(divide(op, a.ints(), b.ints())?, ty));
            }
        };
        Ok(numbers(result, ty))
    }

    fn case(
        &self,
        branches: &[(NodeId, NodeId)],
        otherwise: Option<NodeId>,
        ty: Type,
        level: Level,
    ) -> Result<Values, ArrowError> {
        let mut result = match otherwise {
            Some(id) => self.full(id, level),
            None => self.spread(&Values::constant(&Constant::Null, ty, &mut Symbols::default()), level),
        };
        for (when, then) in branches.iter().rev() {
            let mask = self.full_bools(*when, level);
            let mask = if mask.null_count() > 0 { prep_null_mask_filter(&mask) } else { mask };
            result = Values::shared(zip::zip(&mask, self.of(*then), &result)?, ty);
        }
        Ok(result)
    }

    fn coalesce(&self, ids: &[NodeId], ty: Type, level: Level) -> Result<Values, ArrowError> {
        let (last, before) = ids.split_last().expect("the binder has seen an argument at least");
        let mut result = self.full(*last, level);
        for id in before.iter().rev() {
            let values = self.full(*id, level);
            let mask = boolean::is_not_null(values.array())?;
            result = Values::shared(zip::zip(&mask, &values, &result)?, ty);
        }
        Ok(result)
    }

    fn aggregate(&self, aggregate: Aggregate, x: NodeId) -> Result<Values, ArrowError> {
        let (segments, values) = (self.batch.segments, self.of(x));
        Ok(match (aggregate, values.ty()) {
            (Aggregate::Any, _) => Values::new(segments.any(values.bools()), Type::Bool),
            (Aggregate::All, _) => Values::new(segments.all(values.bools()), Type::Bool),
            (Aggregate::First | Aggregate::Last | Aggregate::Count, _) => {
                Values::new(segments.count_or_time(aggregate, values.bools()), Type::Int)
            }
            (Aggregate::Min, Type::Float) => Values::new(segments.fold(values.floats(), floor)?, Type::Float),
            (Aggregate::Max, Type::Float) => Values::new(segments.fold(values.floats(), ceiling)?, Type::Float),
            (Aggregate::Min, _) => {
                Values::new(segments.fold(values.ints(), |a, b| Ok::<_, ArrowError>(a.min(b)))?, Type::Int)
            }
            (Aggregate::Max, _) => {
                Values::new(segments.fold(values.ints(), |a, b| Ok::<_, ArrowError>(a.max(b)))?, Type::Int)
            }
            (Aggregate::Sum, _) => Values::new(segments.sums(values.ints())?, Type::Int),
        })
    }

    fn at(&self, values: &Values, moments: &Int64Array) -> Values {
        let (segments, ty) = (self.batch.segments, values.ty());
        match ty {
            Type::Bool => Values::new(segments.bools_at(values.bools(), moments), ty),
            Type::Int => Values::new(segments.at(values.ints(), moments), ty),
            Type::Float => Values::new(segments.at(values.floats(), moments), ty),
            Type::Text => Values::new(segments.at(values.symbols(), moments), ty),
        }
    }
}

/// Symbols by their place in the order of texts.
struct Ranked {
    array: UInt32Array,
    single: bool,
}

impl Datum for Ranked {
    fn get(&self) -> (&dyn Array, bool) {
        (&self.array, self.single)
    }
}

fn compare(comparison: Comparison, x: &dyn Datum, y: &dyn Datum) -> Result<BooleanArray, ArrowError> {
    match comparison {
        Comparison::Equal => cmp::eq(x, y),
        Comparison::NotEqual => cmp::neq(x, y),
        Comparison::Less => cmp::lt(x, y),
        Comparison::LessEqual => cmp::lt_eq(x, y),
        Comparison::Greater => cmp::gt(x, y),
        Comparison::GreaterEqual => cmp::gt_eq(x, y),
    }
}

/// Numbers as a kernel gave them; floats in their one form.
fn numbers(array: ArrayRef, ty: Type) -> Values {
    match ty {
        Type::Float => Values::new(array.as_primitive::<Float64Type>().unary::<_, Float64Type>(canonical), ty),
        _ => Values::shared(array, ty),
    }
}

#[expect(clippy::unnecessary_wraps, reason = "a fold of the kernels")]
fn floor(a: f64, b: f64) -> Result<f64, ArrowError> {
    Ok(if b.total_cmp(&a).is_lt() { b } else { a })
}

#[expect(clippy::unnecessary_wraps, reason = "a fold of the kernels")]
fn ceiling(a: f64, b: f64) -> Result<f64, ArrowError> {
    Ok(if b.total_cmp(&a).is_gt() { b } else { a })
}

/// Quotient or remainder towards zero; null where the divisor is 0.
fn divide(op: Arithmetic, a: &Int64Array, b: &Int64Array) -> Result<Int64Array, ArrowError> {
    let one = |pair: (Option<i64>, Option<i64>)| {
        let (Some(a), Some(b)) = pair else { return Ok(None) };
        if b == 0 {
            return Ok(None);
        }
        // The remainder of the smallest integer by -1 is 0, though its quotient overflows.
        let result = if op == Arithmetic::Quotient { a.checked_div(b) } else { Some(a.wrapping_rem(b)) };
        result.map(Some).ok_or_else(|| ArrowError::ArithmeticOverflow(format!("overflow happened on: div({a}, {b})")))
    };
    a.iter().zip(b.iter()).map(one).collect::<Result<Vec<Option<i64>>, _>>().map(Int64Array::from_iter)
}

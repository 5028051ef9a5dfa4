//! The native engine: a plan evaluated over one batch of whole episodes.
//!
//! Every node becomes one column, a value a step or a value an episode, by a kernel over all rows
//! of the batch at once; what several metrics share is evaluated once. Truth values are bits.
//!
//! It deliberately does not know where batches come from, in which order, or on which thread.

use std::collections::BTreeSet;
use std::rc::Rc;

use arrow::array::{
    Array, ArrayRef, ArrowPrimitiveType, AsArray as _, BooleanArray, Datum, Int64Array, PrimitiveArray, RecordBatch,
    UInt32Array,
};
use arrow::buffer::{BooleanBuffer, NullBuffer};
use arrow::compute::kernels::{boolean, cmp, numeric};
use arrow::compute::{cast, filter as select, nullif, prep_null_mask_filter};
use arrow::datatypes::{DataType, Float64Type, Int64Type};
use arrow::error::ArrowError;
use regex::Regex;

use super::segments::{Segments, Stretch, repeat, repeat_bool, test_symbols};
use super::values::{Coded, Symbols, Values, canonical, truths};
use crate::metric::catalog::Kind;
use crate::metric::columns::{Level, Type};
use crate::metric::plan::{Aggregate, Arithmetic, Comparison, Constant, NodeId, Op, Output, Plan};
use crate::trace::scan::Texts;

/// Whole episodes in columns: one batch with a row a step, one with a row an episode.
#[derive(Clone, Copy, Debug)]
pub struct Batch<'a> {
    /// Where episodes begin and end among the steps.
    pub segments: Segments<'a>,
    /// Step-level columns by name: booleans, 64-bit integers, doubles, dictionaries of text with 32-bit keys.
    pub steps: &'a RecordBatch,
    /// Step-level columns of text that are not among those.
    pub texts: &'a [Texts],
    /// Columns that are constant in an episode, a row an episode; the same types.
    pub episodes: &'a RecordBatch,
}

/// The scores of a batch.
#[derive(Clone, Debug, PartialEq)]
pub struct Scores {
    /// The positions of the episodes that the filter keeps, ascending.
    pub kept: Vec<usize>,
    /// A column a metric of the plan, a value for each episode kept; null where the metric is undefined.
    pub metrics: Vec<Int64Array>,
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
    /// The constants, but for texts: their symbols are those of a batch.
    constants: Vec<Option<Values>>,
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
        // Lookups evaluate nodes that are not in the order by themselves.
        for id in plan.needed_by(order.iter().copied()) {
            if let Op::Matches(_, pattern) = &plan.node(id).op {
                patterns[id.index()] = Some(Regex::new(pattern).expect("the binder has compiled this pattern"));
            }
        }
        let constant = |id: NodeId| match &plan.node(id).op {
            Op::Constant(Constant::Text(_)) => None,
            Op::Constant(constant) => Some(Values::constant(constant, plan.node(id).ty, &mut Symbols::default())),
            _ => None,
        };
        Self { plan, order, patterns, constants: plan.ids().map(constant).collect() }
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
        let filter = self.plan.filter.map(|node| BooleanArray::new(truths(values.of(node).bools()), None));
        let kept = match &filter {
            Some(kept) => kept.values().set_indices().collect(),
            None => (0..batch.segments.len()).collect(),
        };
        let metric = |output: &Output| {
            let overflow = |error| self.overflow(output.node, &error);
            let values = values.of(output.node);
            let column = cast(values.array(), &DataType::Int64).map_err(overflow)?;
            let column = filter.as_ref().map_or(Ok(column.clone()), |kept| select(&column, kept)).map_err(overflow)?;
            let column = column.as_primitive::<Int64Type>();
            if output.kind == Kind::Rate
                && values.ty() != Type::Bool
                && let Some(value) = column.iter().flatten().find(|value| !matches!(value, 0 | 1))
            {
                return Err(EngineError::NotARate { metric: output.name.clone(), value });
            }
            Ok(column.clone())
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
            moments: None,
            stretches: Vec::new(),
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

/// Whether a column of texts is equal to a text of the episode, or is not: the column and that text, which is not written
/// out for each step.
fn beside_its_episode(plan: &Plan, op: &Op) -> Option<(NodeId, NodeId)> {
    let Op::Compare(Comparison::Equal | Comparison::NotEqual, x, y) = op else { return None };
    let pair = |column: NodeId, text: NodeId| match (&plan.node(column).op, &plan.node(text).op) {
        (Op::Column(_), Op::Spread(text)) if plan.node(column).ty == Type::Text => Some((column, *text)),
        _ => None,
    };
    pair(*x, *y).or_else(|| pair(*y, *x))
}

/// A condition on steps of which parts are windows: any other part, if there is one, and the windows.
///
/// `first`, `last`, `any` and `count` look for the other part between the ends of the windows, so that no window is
/// written out. Null where an end is null, a window holds nowhere then, as it is for these aggregates.
fn windowed(plan: &Plan, condition: NodeId) -> (NodeId, Windows) {
    let part =
        |id: NodeId| window(plan, &plan.node(id).op).filter(|(comparison, _)| *comparison != Comparison::NotEqual);
    let (mut rest, mut windows) = (condition, Vec::new());
    while let Op::And(x, y) = plan.node(rest).op {
        match (part(x), part(y)) {
            (_, Some(window)) => {
                windows.push(window);
                rest = x;
            }
            (Some(window), None) => {
                windows.push(window);
                rest = y;
            }
            (None, None) => break,
        }
    }
    (rest, windows)
}

/// Whether a lookup of this value looks its columns up and computes from what they hold there, a value an episode
/// instead of a value a step. Not where a step that is not looked at could leave 64 bits.
fn looks_up_leaves(plan: &Plan, value: NodeId) -> bool {
    let node = plan.node(value);
    let alone = matches!(node.op, Op::Column(_)) || node.level == Level::Episode;
    !alone && inner_nodes(plan, value).iter().all(|id| !matches!(plan.node(*id).op, Op::Arithmetic(..) | Op::Negate(_)))
}

/// The nodes between a step-level value and its columns and episode-level parts, in order; the value is the last.
fn inner_nodes(plan: &Plan, value: NodeId) -> Vec<NodeId> {
    let (mut inner, mut open) = (BTreeSet::new(), vec![value]);
    while let Some(id) = open.pop() {
        if !is_leaf(plan, id) && inner.insert(id) {
            open.extend(plan.node(id).op.operands());
        }
    }
    inner.into_iter().collect()
}

fn is_leaf(plan: &Plan, id: NodeId) -> bool {
    let node = plan.node(id);
    node.level == Level::Episode || matches!(node.op, Op::Column(_) | Op::Constant(_))
}

/// What a node needs evaluated before it.
fn needs(plan: &Plan, id: NodeId) -> Vec<NodeId> {
    let op = &plan.node(id).op;
    match op {
        Op::Aggregate(aggregate, x) if aggregate.searches() => {
            let (rest, windows) = windowed(plan, *x);
            windows.into_iter().map(|(_, moment)| moment).chain([rest]).collect()
        }
        Op::At(x, moment) if looks_up_leaves(plan, *x) => {
            let inner = inner_nodes(plan, *x);
            let operands = inner.iter().flat_map(|id| plan.node(*id).op.operands());
            operands.filter(|id| is_leaf(plan, *id)).chain([*moment]).collect()
        }
        _ => match (window(plan, op), beside_its_episode(plan, op)) {
            (Some((_, moment)), _) => vec![moment],
            (None, Some((column, text))) => vec![column, text],
            (None, None) => op.operands(),
        },
    }
}

/// What must be evaluated for some nodes, operands first.
fn evaluation_order(plan: &Plan, roots: impl IntoIterator<Item = NodeId>) -> Vec<NodeId> {
    let mut needed = vec![false; plan.nodes().len()];
    roots.into_iter().for_each(|root| needed[root.index()] = true);
    let ids: Vec<NodeId> = plan.ids().collect();
    for &id in ids.iter().rev() {
        if needed[id.index()] {
            for operand in needs(plan, id) {
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

/// One batch underway.
struct Evaluation<'e, 'p> {
    engine: &'e Engine<'p>,
    batch: &'e Batch<'e>,
    symbols: Symbols,
    values: Vec<Option<Values>>,
    /// The timesteps looked up, a value an episode, where a lookup is evaluated: step-level nodes have a value an
    /// episode then, that at its timestep.
    moments: Option<Int64Array>,
    /// The rows of each episode that lie in some windows, for all windows so far. No window: all rows.
    stretches: Vec<(Windows, Rc<Vec<Stretch>>)>,
}

/// Conditions on the timestep, each with the node of the moment that it is compared with.
type Windows = Vec<(Comparison, NodeId)>;

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
        let level = if self.moments.is_some() { Level::Episode } else { node.level };
        Ok(match &node.op {
            Op::Column(name) => self.column(name, level)?,
            Op::Constant(constant) => match &self.engine.constants[id.index()] {
                Some(known) => known.clone(),
                None => Values::constant(constant, node.ty, &mut self.symbols),
            },
            Op::Time => Values::new(self.moments.clone().unwrap_or_else(|| segments.times()), Type::Int),
            Op::Length => Values::new(segments.lengths(), Type::Int),
            Op::Spread(x) => self.spread(of(*x), level),
            Op::Not(x) => truth(boolean::not(of(*x).bools()).map_err(overflow)?),
            Op::And(x, y) => {
                let (x, y) = (self.full_bools(*x, level), self.full_bools(*y, level));
                truth(boolean::and_kleene(&x, &y).map_err(overflow)?)
            }
            Op::Or(x, y) => {
                let (x, y) = (self.full_bools(*x, level), self.full_bools(*y, level));
                truth(boolean::or_kleene(&x, &y).map_err(overflow)?)
            }
            Op::Compare(comparison, x, y) => truth(self.compare(&node.op, *comparison, *x, *y).map_err(overflow)?),
            Op::Distinct(x, y) => truth(cmp::distinct(of(*x), of(*y)).map_err(overflow)?),
            Op::IsNull(x) => truth(boolean::is_null(of(*x).validity()).map_err(overflow)?),
            Op::IsTrue(x) => truth(BooleanArray::new(truths(of(*x).bools()), None)),
            Op::IsFalse(x) => truth(BooleanArray::new(truths(&boolean::not(of(*x).bools()).map_err(overflow)?), None)),
            Op::Arithmetic(op, x, y) => self.arithmetic(*op, node.ty, level, *x, *y).map_err(overflow)?,
            Op::Negate(x) => numbers(numeric::neg(of(*x).array()).map_err(overflow)?, node.ty),
            Op::Case { branches, otherwise } => self.case(branches, *otherwise, node.ty, level),
            Op::Coalesce(values) => self.coalesce(values, level).map_err(overflow)?,
            Op::Matches(x, _) => {
                let pattern = self.engine.patterns[id.index()].as_ref().expect("compiled with the engine");
                let matches = |symbol| pattern.is_match(self.symbols.text(symbol));
                match of(*x).coded() {
                    Some(coded) => truth(coded.test(matches)),
                    None => truth(test_symbols(of(*x).symbols(), matches)),
                }
            }
            Op::IntFromBool(x) => Values::shared(cast(of(*x).array(), &DataType::Int64).map_err(overflow)?, Type::Int),
            Op::FloatFromInt(x) => {
                Values::shared(cast(of(*x).array(), &DataType::Float64).map_err(overflow)?, Type::Float)
            }
            Op::Aggregate(aggregate, x) => self.aggregate(*aggregate, *x).map_err(overflow)?,
            Op::At(x, moment) if looks_up_leaves(self.engine.plan, *x) => self.look_up(*x, *moment)?,
            Op::At(x, moment) => self.at(of(*x), of(*moment).ints()),
        })
    }

    fn column(&mut self, name: &str, level: Level) -> Result<Values, EngineError> {
        if level == Level::Step
            && let Some(texts) = self.batch.texts.iter().find(|texts| texts.name == name)
        {
            return Ok(self.symbols.of_texts(texts));
        }
        let table = if level == Level::Step { self.batch.steps } else { self.batch.episodes };
        let column = table.column_by_name(name).ok_or_else(|| EngineError::MissingColumn(name.to_owned()))?;
        match column.data_type() {
            DataType::Boolean => Ok(Values::shared(column.clone(), Type::Bool)),
            DataType::Int64 => Ok(Values::shared(column.clone(), Type::Int)),
            DataType::Float64 => Ok(numbers(column.clone(), Type::Float)),
            DataType::Dictionary(key, value) if **key == DataType::Int32 && **value == DataType::Utf8 => {
                Ok(self.symbols.of_column(column.as_dictionary()))
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
        if self.moments.is_some() {
            return values.clone();
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
        if self.moments.is_none()
            && let Some((comparison, moment)) = window(self.engine.plan, op)
        {
            return Ok(self.batch.segments.window(comparison, self.full(moment, Level::Episode).ints()));
        }
        if self.moments.is_none()
            && let Some((column, text)) = beside_its_episode(self.engine.plan, op)
        {
            let texts = self.full(text, Level::Episode);
            return match self.of(column).coded() {
                Some(coded) => Ok(coded.compare(self.batch.segments, texts.symbols(), comparison == Comparison::Equal)),
                None => compare(comparison, self.of(column), &self.spread(&texts, Level::Step)),
            };
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
            (Type::Text, _) => match (x.coded(), y.coded()) {
                (Some(coded), _) if y.is_single() => Ok(one_text(comparison, coded, y)),
                (_, Some(coded)) if x.is_single() => Ok(one_text(comparison, coded, x)),
                _ => compare(comparison, x, y),
            },
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

    fn case(&self, branches: &[(NodeId, NodeId)], otherwise: Option<NodeId>, ty: Type, level: Level) -> Values {
        let mut result = match otherwise {
            Some(id) => self.full(id, level),
            None => self.spread(&Values::constant(&Constant::Null, ty, &mut Symbols::default()), level),
        };
        for (when, then) in branches.iter().rev() {
            let mask = self.full_bools(*when, level);
            let mask = if mask.null_count() > 0 { prep_null_mask_filter(&mask) } else { mask };
            result = choose(&mask, self.of(*then), &result);
        }
        result
    }

    fn coalesce(&self, ids: &[NodeId], level: Level) -> Result<Values, ArrowError> {
        let (last, before) = ids.split_last().expect("the binder has seen an argument at least");
        let mut result = self.full(*last, level);
        for id in before.iter().rev() {
            let values = self.full(*id, level);
            let mask = boolean::is_not_null(values.array())?;
            result = choose(&mask, &values, &result);
        }
        Ok(result)
    }

    fn aggregate(&mut self, aggregate: Aggregate, x: NodeId) -> Result<Values, ArrowError> {
        let (segments, values) = (self.batch.segments, || self.of(x));
        Ok(match (aggregate, self.engine.plan.node(x).ty) {
            (Aggregate::Any | Aggregate::First | Aggregate::Last | Aggregate::Count, _) => self.search(aggregate, x),
            (Aggregate::All, _) => Values::new(segments.all(values().bools()), Type::Bool),
            (Aggregate::Min, Type::Float) => Values::new(segments.fold(values().floats(), floor)?, Type::Float),
            (Aggregate::Max, Type::Float) => Values::new(segments.fold(values().floats(), ceiling)?, Type::Float),
            (Aggregate::Min, _) => {
                Values::new(segments.fold(values().ints(), |a, b| Ok::<_, ArrowError>(a.min(b)))?, Type::Int)
            }
            (Aggregate::Max, _) => {
                Values::new(segments.fold(values().ints(), |a, b| Ok::<_, ArrowError>(a.max(b)))?, Type::Int)
            }
            (Aggregate::Sum, _) => Values::new(segments.sums(values().ints())?, Type::Int),
        })
    }

    /// The steps at which a condition holds, between the ends of its windows.
    fn search(&mut self, aggregate: Aggregate, condition: NodeId) -> Values {
        let (rest, windows) = windowed(self.engine.plan, condition);
        let stretches = self.within(windows);
        let ty = if aggregate == Aggregate::Any { Type::Bool } else { Type::Int };
        let predicate = self.full_bools(rest, Level::Step);
        Values::shared(Segments::aggregate(aggregate, &predicate, &stretches), ty)
    }

    /// The rows of each episode that lie in all these windows. Many aggregates have the same ones.
    fn within(&mut self, windows: Windows) -> Rc<Vec<Stretch>> {
        if let Some((_, known)) = self.stretches.iter().find(|(known, _)| *known == windows) {
            return Rc::clone(known);
        }
        let moments = |moment: NodeId| self.full(moment, Level::Episode).ints().clone();
        let bounds: Vec<_> = windows.iter().map(|(comparison, moment)| (*comparison, moments(*moment))).collect();
        let found = Rc::new(self.batch.segments.within(&bounds));
        self.stretches.push((windows, Rc::clone(&found)));
        found
    }

    /// A value at a timestep of each episode, computed from what its columns hold there.
    fn look_up(&mut self, value: NodeId, moment: NodeId) -> Result<Values, EngineError> {
        let (plan, moments) = (self.engine.plan, self.full(moment, Level::Episode).ints().clone());
        let inner = inner_nodes(plan, value);
        let mut there = Evaluation {
            engine: self.engine,
            batch: self.batch,
            symbols: std::mem::take(&mut self.symbols),
            values: vec![None; plan.nodes().len()],
            moments: Some(moments.clone()),
            stretches: Vec::new(),
        };
        for leaf in inner.iter().flat_map(|id| plan.node(*id).op.operands()).filter(|id| is_leaf(plan, *id)) {
            let values = self.of(leaf);
            let step = plan.node(leaf).level == Level::Step && !values.is_single();
            there.values[leaf.index()] = Some(if step { self.at(values, &moments) } else { values.clone() });
        }
        let evaluated = inner.iter().try_for_each(|id| {
            there.values[id.index()] = Some(there.node(*id)?);
            Ok(())
        });
        let found = evaluated.map(|()| there.full(value, Level::Episode));
        self.symbols = there.symbols;
        let found = found?;
        // There is no value where there is no such step, whatever the expression makes of nulls.
        let absent = BooleanArray::new(!&self.batch.segments.exist(&moments), None);
        let known = nullif(found.array(), &absent).map_err(|error| self.engine.overflow(value, &error))?;
        Ok(Values::shared(known, found.ty()))
    }

    fn at(&self, values: &Values, moments: &Int64Array) -> Values {
        let (segments, ty) = (self.batch.segments, values.ty());
        if let Some(coded) = values.coded() {
            return Values::new(coded.at(segments, moments), ty);
        }
        match ty {
            Type::Bool => Values::new(segments.bools_at(values.bools(), moments), ty),
            Type::Int => Values::new(segments.at(values.ints(), moments), ty),
            Type::Float => Values::new(segments.at(values.floats(), moments), ty),
            Type::Text => Values::new(segments.at(values.symbols(), moments), ty),
        }
    }
}

/// The values of `then` where the mask, which has no null, is set, and those of `otherwise` elsewhere.
fn choose(mask: &BooleanArray, then: &Values, otherwise: &Values) -> Values {
    let ty = otherwise.ty();
    match ty {
        Type::Bool => Values::new(choose_bools(mask.values(), then.bools(), otherwise.bools()), ty),
        Type::Int => Values::new(choose_numbers(mask, then.ints(), otherwise.ints()), ty),
        Type::Float => Values::new(choose_numbers(mask, then.floats(), otherwise.floats()), ty),
        Type::Text => Values::new(choose_numbers(mask, then.symbols(), otherwise.symbols()), ty),
    }
}

/// As `zip`, on whole words of bits. One value of `then` stands for all.
fn choose_bools(mask: &BooleanBuffer, then: &BooleanArray, otherwise: &BooleanArray) -> BooleanArray {
    let then = if then.len() == 1 { repeat_bool(then, mask.len()) } else { then.clone() };
    let others = !mask;
    let chosen = |a: &BooleanBuffer, b: &BooleanBuffer| &(a & mask) | &(b & &others);
    let nulls = (then.null_count() + otherwise.null_count() > 0).then(|| {
        let valid = |array: &BooleanArray| match array.nulls() {
            Some(nulls) => nulls.inner().clone(),
            None => BooleanBuffer::new_set(array.len()),
        };
        NullBuffer::new(chosen(&valid(&then), &valid(otherwise)))
    });
    BooleanArray::new(chosen(then.values(), otherwise.values()), nulls)
}

/// As `zip`, which copies run by run; here the mask changes from row to row. One value of `then` stands for all.
fn choose_numbers<T: ArrowPrimitiveType>(
    mask: &BooleanArray,
    then: &PrimitiveArray<T>,
    otherwise: &PrimitiveArray<T>,
) -> PrimitiveArray<T> {
    let bits = mask.values();
    let place = |row: usize| if then.len() == 1 { 0 } else { row };
    let value = |row: usize| if bits.value(row) { then.value(place(row)) } else { otherwise.value(row) };
    let nulls = (then.null_count() + otherwise.null_count() > 0).then(|| {
        let valid = |row| if bits.value(row) { then.is_valid(place(row)) } else { otherwise.is_valid(row) };
        NullBuffer::new(BooleanBuffer::collect_bool(mask.len(), valid))
    });
    PrimitiveArray::new((0..mask.len()).map(value).collect(), nulls)
}

/// Texts compared for equality with a single one.
fn one_text(comparison: Comparison, coded: &Coded, single: &Values) -> BooleanArray {
    let text = single.symbols();
    if text.is_null(0) {
        return BooleanArray::new_null(coded.len());
    }
    let (wanted, equal) = (text.value(0), comparison == Comparison::Equal);
    coded.test(|symbol| (symbol == wanted) == equal)
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

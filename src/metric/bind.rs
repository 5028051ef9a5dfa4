//! Names to columns, types and levels checked, one shared plan built.
//!
//! Every definition is bound once, on demand, so that definitions may stand in any order; a
//! definition that leads back to itself is refused with the way it went. A fault in one definition
//! does not hide the faults of another: whatever depends on a faulty one is passed over in silence.

use std::collections::HashMap;
use std::ops::Range;

use indexmap::IndexMap;

use super::columns::{Columns, Level, Type};
use super::fault::{Fault, Place};
use super::file::{Document, MetricEntry};
use super::functions::{self, Entry, FUNCTIONS, Function};
use super::origin::Written;
use super::plan::{Aggregate, Arithmetic, Builder, Comparison, Constant, NodeId, Op, Plan};
use super::syntax::{self, BinaryOp, Expr, ExprKind, Literal};
use crate::base::near::nearest;
use crate::base::visible::visible;
use crate::metric::catalog::Kind;

/// What an expression came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bound {
    pub(super) node: NodeId,
    /// `None`: the literal null, which has every type.
    pub(super) ty: Option<Type>,
    pub(super) level: Level,
    /// A metric whose value is a truth value: 0 or 1 where a number is wanted.
    pub(super) rate: bool,
}

/// The plan, and what each definition came to.
#[derive(Debug)]
pub(super) struct Binding {
    pub(super) plan: Plan,
    pub(super) metrics: IndexMap<String, (NodeId, Kind)>,
    pub(super) lets: Vec<(String, NodeId)>,
    pub(super) filter: Option<NodeId>,
}

/// Binds all definitions of a document, and a filter over episodes if there is one.
///
/// # Errors
/// Every fault of every definition.
pub(super) fn bind(document: &Document, columns: &Columns, filter: Option<&Written>) -> Result<Binding, Vec<Fault>> {
    let mut binder = Binder {
        document,
        columns,
        builder: Builder::default(),
        states: HashMap::new(),
        underway: Vec::new(),
        depth: 0,
        faults: Vec::new(),
    };
    binder.check_names();
    let lets = document.lets.keys().filter_map(|name| Some((name.clone(), binder.definition(name)?.node))).collect();
    let mut metrics = IndexMap::new();
    for name in document.metrics.keys() {
        if let Some(bound) = binder.definition(name) {
            let declared = document.metrics[name].unit.as_ref().is_some_and(|(unit, _)| unit == "rate");
            let kind = if bound.rate || declared { Kind::Rate } else { Kind::Quantity };
            metrics.insert(name.clone(), (bound.node, kind));
        }
    }
    let filter = filter.and_then(|written| binder.filter(written));
    if binder.faults.is_empty() {
        Ok(Binding { plan: binder.builder.finish(), metrics, lets, filter })
    } else {
        Err(binder.faults)
    }
}

enum State {
    Underway,
    Done(Bound),
    Faulty,
}

struct Binder<'a> {
    document: &'a Document,
    columns: &'a Columns,
    builder: Builder,
    states: HashMap<String, State>,
    underway: Vec<String>,
    /// How deep the expression being bound is nested, definitions within definitions included.
    depth: usize,
    faults: Vec<Fault>,
}

/// The deepest nesting, definitions within definitions included; keeps the stack bounded.
const DEEPEST: usize = 400;

impl Binder<'_> {
    /// One name has one meaning. A column that only some traces have gives way to a definition of its name, so that
    /// definitions say the same whatever else was recorded.
    fn check_names(&mut self) {
        let lets = self.document.lets.iter().map(|(name, (_, place))| (name, place, "`let`"));
        let metrics = self.document.metrics.iter().map(|(name, entry)| (name, &entry.place, "metric"));
        let mut faults = Vec::new();
        for (name, place, what) in lets.chain(metrics) {
            let is_column = self.columns.of_schema(name).is_some() || self.document.columns.contains_key(name);
            if name.is_empty() || name.contains(|c: char| c == ',' || c.is_control()) {
                let message = format!("`{}` is no name of a {}", visible(name), what.trim_matches('`'));
                faults.push(Fault::new(place.clone(), message).help("a name has visible characters and no comma"));
            } else if name == "t" || is_column {
                let message = format!("the {what} `{name}` has the name of a column");
                faults.push(Fault::new(place.clone(), message).help("choose another name"));
            } else if what == "metric" && self.document.lets.contains_key(name) {
                let message = format!("`{name}` is a `let` and a metric");
                faults.push(Fault::new(place.clone(), message).help("choose another name for one of them"));
            }
        }
        self.faults.append(&mut faults);
    }

    /// What a `let` or a metric came to; `None` once its faults have been told.
    fn definition(&mut self, name: &str) -> Option<Bound> {
        match self.states.get(name) {
            Some(State::Done(bound)) => return Some(*bound),
            Some(State::Faulty | State::Underway) => return None,
            None => {}
        }
        self.states.insert(name.to_owned(), State::Underway);
        self.underway.push(name.to_owned());
        let document = self.document;
        let bound = match (document.lets.get(name), document.metrics.get(name)) {
            (Some((written, _)), _) => self.written(written),
            (None, Some(entry)) => self.metric(entry),
            (None, None) => None,
        };
        self.underway.pop();
        self.states.insert(name.to_owned(), bound.map_or(State::Faulty, State::Done));
        bound
    }

    fn written(&mut self, written: &Written) -> Option<Bound> {
        match syntax::parse(&written.text) {
            Ok(expr) => Scope { binder: self, written }.bind(&expr),
            Err(faults) => {
                for fault in faults {
                    self.faults.push(Fault::new(written.place(fault.span), fault.message).help_if(fault.help));
                }
                None
            }
        }
    }

    fn metric(&mut self, entry: &MetricEntry) -> Option<Bound> {
        let when = entry.when.as_ref().map(|written| self.condition(written, "`when`"));
        let value = self.written(&entry.value).and_then(|bound| self.metric_value(bound, &entry.value));
        let (when, value) = (when.map_or(Some(None), |when| when.map(Some))?, value?);
        let Some(when) = when else { return Some(value) };
        let ty = value.ty?;
        let branches = vec![(when.node, self.spread(value.node, ty, value.level, Level::Episode))];
        let node = self.builder.add(Op::Case { branches, otherwise: None }, ty, Level::Episode);
        Some(Bound { node, level: Level::Episode, ..value })
    }

    /// A metric's value is an integer or a truth value, once an episode.
    fn metric_value(&mut self, bound: Bound, written: &Written) -> Option<Bound> {
        let place = written.everywhere();
        if bound.level == Level::Step {
            let fault = Fault::new(place, "a metric has one value an episode, this has one a step");
            let help =
                "lead down to the episode with any(), all(), count(), first(), last(), at(), min(), max() or sum()";
            return self.refuse(fault.label("one value a step").help(help));
        }
        match bound.ty {
            Some(Type::Bool) => {
                Some(Bound { rate: true, node: self.at_episode(bound), level: Level::Episode, ..bound })
            }
            Some(Type::Int) => Some(Bound { node: self.at_episode(bound), level: Level::Episode, ..bound }),
            Some(ty @ (Type::Float | Type::Text)) => {
                let fault =
                    Fault::new(place, format!("a metric is an integer or true or false, this is {}", ty.name()));
                let help = "sums of integers are exact in any order; compare, count, or scale to an integer column";
                self.refuse(fault.label(ty.name()).help(help))
            }
            None => self.refuse(Fault::new(place, "a metric that is always null is never defined")),
        }
    }

    fn filter(&mut self, written: &Written) -> Option<NodeId> {
        self.condition(written, "a filter of episodes").map(|bound| bound.node)
    }

    /// A truth value an episode.
    fn condition(&mut self, written: &Written, what: &str) -> Option<Bound> {
        let bound = self.written(written)?;
        let place = written.everywhere();
        if bound.level == Level::Step {
            let fault = Fault::new(place, format!("{what} is decided once an episode, this has one value a step"));
            return self.refuse(fault.label("one value a step").help("wrap it: any(...) or all(...)"));
        }
        match bound.ty {
            Some(Type::Bool) => Some(Bound { node: self.at_episode(bound), level: Level::Episode, ..bound }),
            ty => {
                let found = ty.map_or("null", Type::name);
                let fault = Fault::new(place, format!("{what} must be true or false, this is {found}"));
                self.refuse(fault.label(found))
            }
        }
    }

    fn at_episode(&mut self, bound: Bound) -> NodeId {
        match bound.ty {
            Some(ty) => self.spread(bound.node, ty, bound.level, Level::Episode),
            None => bound.node,
        }
    }

    fn spread(&mut self, node: NodeId, ty: Type, from: Level, to: Level) -> NodeId {
        if from >= to { node } else { self.builder.add(Op::Spread(node), ty, to) }
    }

    fn refuse<T>(&mut self, fault: Fault) -> Option<T> {
        self.faults.push(fault);
        None
    }
}

/// One expression being bound: the binder, and the text that faults point into.
struct Scope<'b, 'a> {
    binder: &'b mut Binder<'a>,
    written: &'b Written,
}

impl Scope<'_, '_> {
    fn bind(&mut self, expr: &Expr) -> Option<Bound> {
        if self.binder.depth == DEEPEST {
            let fault = Fault::new(self.place(expr), "definitions are nested too deeply");
            return self.binder.refuse(fault.help("refer to columns more directly"));
        }
        self.binder.depth += 1;
        let bound = self.bind_kind(expr);
        self.binder.depth -= 1;
        bound
    }

    fn bind_kind(&mut self, expr: &Expr) -> Option<Bound> {
        match &expr.kind {
            ExprKind::Name(name) => self.name(name, expr),
            ExprKind::Literal(literal) => Some(self.literal(literal)),
            ExprKind::Not(inner) => {
                let inner = self.truth(inner)?;
                Some(self.unary(Op::Not(inner.node), Type::Bool, inner.level))
            }
            ExprKind::Negate(inner) => self.negate(inner),
            ExprKind::Binary(op, left, right) => self.binary(*op, left, right, expr),
            ExprKind::IsNull { operand, negated } => {
                let operand = self.bind(operand)?;
                let (op, level) = match operand.ty {
                    Some(_) => (Op::IsNull(operand.node), operand.level),
                    None => (Op::Constant(Constant::Bool(true)), Level::Constant),
                };
                let is_null = self.unary(op, Type::Bool, level);
                Some(self.negated_if(*negated, is_null))
            }
            ExprKind::IsTruth { operand, truth, negated } => {
                let operand = self.truth(operand)?;
                let op = if *truth { Op::IsTrue(operand.node) } else { Op::IsFalse(operand.node) };
                let is = self.unary(op, Type::Bool, operand.level);
                Some(self.negated_if(*negated, is))
            }
            ExprKind::Distinct { left, right, negated } => {
                let (left, right) = self.pair(left, right, expr, "compared")?;
                let distinct = self.combine(&[left, right], Type::Bool, |nodes| Op::Distinct(nodes[0], nodes[1]));
                Some(self.negated_if(*negated, distinct))
            }
            ExprKind::Between { operand, low, high, negated } => {
                let (operand, low, high) = (self.bind(operand), self.bind(low), self.bind(high));
                let (operand, low, high) = (operand?, low?, high?);
                let above = self.compared(Comparison::GreaterEqual, operand, low, expr);
                let below = self.compared(Comparison::LessEqual, operand, high, expr);
                let between = self.combine(&[above?, below?], Type::Bool, |nodes| Op::And(nodes[0], nodes[1]));
                Some(self.negated_if(*negated, between))
            }
            ExprKind::InList { operand, list, negated } => {
                let operand = self.bind(operand);
                let items: Vec<_> = list.iter().map(|item| self.bind(item)).collect();
                let (operand, items) = (operand?, items.into_iter().collect::<Option<Vec<Bound>>>()?);
                let equal: Vec<_> =
                    items.into_iter().map(|item| self.compared(Comparison::Equal, operand, item, expr)).collect();
                let equal: Vec<Bound> = equal.into_iter().collect::<Option<_>>()?;
                let either =
                    |this: &mut Self, a: Bound, b: Bound| this.combine(&[a, b], Type::Bool, |n| Op::Or(n[0], n[1]));
                let found = equal.into_iter().reduce(|a, b| either(self, a, b))?;
                Some(self.negated_if(*negated, found))
            }
            ExprKind::Case { operand, branches, otherwise } => {
                self.case(operand.as_deref(), branches, otherwise.as_deref(), expr)
            }
            ExprKind::Call { name, arguments } => self.call(name, arguments, expr),
        }
    }

    fn name(&mut self, name: &str, expr: &Expr) -> Option<Bound> {
        let binder = &mut *self.binder;
        if binder.document.lets.contains_key(name) || binder.document.metrics.contains_key(name) {
            if matches!(binder.states.get(name), Some(State::Underway)) {
                return self.cycle(name, expr);
            }
            return binder.definition(name);
        }
        if name == "t" {
            return Some(self.unary(Op::Time, Type::Int, Level::Step));
        }
        match binder.columns.get(name) {
            Some(column) => Some(self.unary(Op::Column(name.to_owned()), column.ty, column.level)),
            None => self.unknown_name(name, expr),
        }
    }

    fn cycle<T>(&mut self, name: &str, expr: &Expr) -> Option<T> {
        let start = self.binder.underway.iter().position(|other| other == name).unwrap_or(0);
        let mut way = self.binder.underway[start..].to_vec();
        way.push(name.to_owned());
        let fault = Fault::new(self.place(expr), format!("the definition of `{name}` leads back to itself"));
        self.binder.refuse(fault.label("here the circle closes").help(format!("the way is {}", way.join(" -> "))))
    }

    fn unknown_name<T>(&mut self, name: &str, expr: &Expr) -> Option<T> {
        let fault = Fault::new(self.place(expr), format!("unknown name `{name}`"));
        let document = self.binder.document;
        let known = document.lets.keys().chain(document.metrics.keys()).map(String::as_str);
        let known = known.chain(self.binder.columns.names()).chain(["t"]);
        let is_quoted = self.written.text[expr.span.clone()].starts_with('"');
        let help = match (functions::find(&name.to_lowercase()), nearest(name, known)) {
            _ if is_quoted => format!("double quotes are for names; a text takes single ones: '{name}'"),
            (Some(entry), _) => format!("functions take parentheses: {}", entry.usage),
            (None, Some(near)) => format!("did you mean `{near}`?"),
            (None, None) => self.binder.columns.help().to_owned(),
        };
        self.binder.refuse(fault.label("not a column, a `let` or a metric").help(help))
    }

    fn literal(&mut self, literal: &Literal) -> Bound {
        let (constant, ty) = match literal {
            Literal::Null => (Constant::Null, None),
            Literal::Bool(value) => (Constant::Bool(*value), Some(Type::Bool)),
            Literal::Int(value) => (Constant::Int(*value), Some(Type::Int)),
            Literal::Float(value) => (Constant::Float(value.to_bits()), Some(Type::Float)),
            Literal::Text(value) => (Constant::Text(value.clone()), Some(Type::Text)),
        };
        let node = self.binder.builder.add(Op::Constant(constant), ty.unwrap_or(Type::Bool), Level::Constant);
        Bound { node, ty, level: Level::Constant, rate: false }
    }

    fn unary(&mut self, op: Op, ty: Type, level: Level) -> Bound {
        // An operation on constants alone is carried out once an episode.
        let (op, level) = match (level, op) {
            (Level::Constant, op @ Op::Constant(_)) => (op, level),
            (Level::Constant, op) => (self.with_spread_operands(op), Level::Episode),
            (level, op) => (op, level),
        };
        Bound { node: self.binder.builder.add(op, ty, level), ty: Some(ty), level, rate: false }
    }

    fn with_spread_operands(&mut self, op: Op) -> Op {
        let mut up = |node: NodeId| {
            let ty = self.binder.builder.node(node).ty;
            self.binder.spread(node, ty, Level::Constant, Level::Episode)
        };
        match op {
            Op::Not(x) => Op::Not(up(x)),
            Op::Negate(x) => Op::Negate(up(x)),
            Op::IsNull(x) => Op::IsNull(up(x)),
            Op::IsTrue(x) => Op::IsTrue(up(x)),
            Op::IsFalse(x) => Op::IsFalse(up(x)),
            Op::Matches(x, pattern) => Op::Matches(up(x), pattern),
            Op::IntFromBool(x) => Op::IntFromBool(up(x)),
            Op::FloatFromInt(x) => Op::FloatFromInt(up(x)),
            other => other,
        }
    }

    /// An operation over several operands of known types, brought to one level (constants stay as they are).
    fn combine(&mut self, operands: &[Bound], ty: Type, op: impl FnOnce(&[NodeId]) -> Op) -> Bound {
        let level = operands.iter().map(|operand| operand.level).max().unwrap_or(Level::Constant);
        let all_constant = level == Level::Constant;
        let level = level.max(Level::Episode);
        let nodes: Vec<NodeId> = operands
            .iter()
            .map(|operand| match operand.level {
                Level::Constant if !all_constant => operand.node,
                from => {
                    let ty = self.binder.builder.node(operand.node).ty;
                    self.binder.spread(operand.node, ty, from, level)
                }
            })
            .collect();
        Bound { node: self.binder.builder.add(op(&nodes), ty, level), ty: Some(ty), level, rate: false }
    }

    fn negated_if(&mut self, negated: bool, bound: Bound) -> Bound {
        if negated { self.unary(Op::Not(bound.node), Type::Bool, bound.level) } else { bound }
    }

    /// An operand that must be a truth value.
    fn truth(&mut self, expr: &Expr) -> Option<Bound> {
        let bound = self.bind(expr)?;
        match bound.ty {
            Some(Type::Bool) => Some(bound),
            None => Some(self.null_of(Type::Bool)),
            Some(ty) => {
                let fault = Fault::new(self.place(expr), format!("expected true or false, found {}", ty.name()));
                self.binder.refuse(fault.label(ty.name()).help("compare it: `x = 1`, `x is not null`, ..."))
            }
        }
    }

    /// An operand that must be a number.
    fn number(&mut self, expr: &Expr) -> Option<Bound> {
        let bound = self.bind(expr)?;
        self.as_number(bound, expr)
    }

    /// What `expr` came to, as a number.
    fn as_number(&mut self, bound: Bound, expr: &Expr) -> Option<Bound> {
        match bound.ty {
            Some(Type::Int | Type::Float) => Some(bound),
            Some(Type::Bool) if bound.rate => Some(self.as_int(bound)),
            None => Some(self.null_of(Type::Int)),
            Some(ty) => {
                let fault = Fault::new(self.place(expr), format!("expected a number, found {}", ty.name()));
                let help = (ty == Type::Bool).then(|| "write `case when p then 1 else 0 end`".to_owned());
                self.binder.refuse(fault.label(ty.name()).help_if(help))
            }
        }
    }

    fn null_of(&mut self, ty: Type) -> Bound {
        let node = self.binder.builder.add(Op::Constant(Constant::Null), ty, Level::Constant);
        Bound { node, ty: Some(ty), level: Level::Constant, rate: false }
    }

    fn as_int(&mut self, bound: Bound) -> Bound {
        self.unary(Op::IntFromBool(bound.node), Type::Int, bound.level)
    }

    /// The same value as another type, where that loses nothing.
    fn converted(&mut self, bound: Bound, ty: Type) -> Option<Bound> {
        match (bound.ty, ty) {
            (None, ty) => Some(self.null_of(ty)),
            (Some(from), to) if from == to => Some(bound),
            (Some(Type::Bool), Type::Int) if bound.rate => Some(self.as_int(bound)),
            (Some(Type::Bool), Type::Float) if bound.rate => {
                let int = self.as_int(bound);
                self.converted(int, Type::Float)
            }
            (Some(Type::Int), Type::Float) => Some(match self.constant_int(bound.node) {
                #[expect(clippy::cast_precision_loss, reason = "an integer literal beside a float is a float")]
                Some(value) => self.literal(&Literal::Float(value as f64)),
                None => self.unary(Op::FloatFromInt(bound.node), Type::Float, bound.level),
            }),
            _ => None,
        }
    }

    fn constant_int(&self, node: NodeId) -> Option<i64> {
        match self.binder.builder.node(node).op {
            Op::Constant(Constant::Int(value)) => Some(value),
            _ => None,
        }
    }

    /// The type that all of these can take: equal types, numbers widened, rates as 0 and 1 beside numbers.
    fn common_type(bounds: &[Bound]) -> Option<Type> {
        let typed = || bounds.iter().filter_map(|bound| Some((bound.ty?, bound.rate)));
        let first = typed().next().map_or(Type::Bool, |(ty, _)| ty);
        if typed().all(|(ty, _)| ty == first) {
            return Some(first);
        }
        let numeric = |(ty, rate): (Type, bool)| matches!(ty, Type::Int | Type::Float) || rate;
        if !typed().all(numeric) {
            return None;
        }
        Some(if typed().any(|(ty, _)| ty == Type::Float) { Type::Float } else { Type::Int })
    }

    /// Operands of one type; `what` happens to them, for the message.
    fn unified(&mut self, bounds: &[Bound], expr: &Expr, what: &str) -> Option<(Vec<Bound>, Type)> {
        let Some(ty) = Self::common_type(bounds) else {
            let mut names: Vec<&str> = bounds.iter().filter_map(|bound| bound.ty.map(Type::name)).collect();
            names.dedup();
            let fault = Fault::new(self.place(expr), format!("{} cannot be {what}", names.join(" and ")));
            let truth = bounds.iter().any(|bound| bound.ty == Some(Type::Bool));
            let help = truth.then(|| "a condition needs no comparison: write `p` or `not p`".to_owned());
            return self.binder.refuse(fault.label("different types").help_if(help));
        };
        let bounds: Option<Vec<Bound>> = bounds.iter().map(|bound| self.converted(*bound, ty)).collect();
        Some((bounds?, ty))
    }

    fn pair(&mut self, left: &Expr, right: &Expr, whole: &Expr, what: &str) -> Option<(Bound, Bound)> {
        let (left, right) = (self.bind(left), self.bind(right));
        let (both, _) = self.unified(&[left?, right?], whole, what)?;
        Some((both[0], both[1]))
    }

    fn negate(&mut self, inner: &Expr) -> Option<Bound> {
        if let ExprKind::Literal(Literal::Int(value)) = inner.kind {
            return Some(self.literal(&Literal::Int(-value)));
        }
        if let ExprKind::Literal(Literal::Float(value)) = inner.kind {
            return Some(self.literal(&Literal::Float(-value)));
        }
        let inner = self.number(inner)?;
        let ty = inner.ty?;
        Some(self.unary(Op::Negate(inner.node), ty, inner.level))
    }

    fn binary(&mut self, op: BinaryOp, left: &Expr, right: &Expr, whole: &Expr) -> Option<Bound> {
        let comparison = match op {
            BinaryOp::And | BinaryOp::Or => {
                let (left, right) = (self.truth(left), self.truth(right));
                let make = |n: &[NodeId]| {
                    if op == BinaryOp::And { Op::And(n[0], n[1]) } else { Op::Or(n[0], n[1]) }
                };
                return Some(self.combine(&[left?, right?], Type::Bool, make));
            }
            BinaryOp::Add => return self.arithmetic(Arithmetic::Add, left, right, whole),
            BinaryOp::Subtract => return self.arithmetic(Arithmetic::Subtract, left, right, whole),
            BinaryOp::Multiply => return self.arithmetic(Arithmetic::Multiply, left, right, whole),
            BinaryOp::Remainder => return self.arithmetic(Arithmetic::Remainder, left, right, whole),
            BinaryOp::Equal => Comparison::Equal,
            BinaryOp::NotEqual => Comparison::NotEqual,
            BinaryOp::Less => Comparison::Less,
            BinaryOp::LessEqual => Comparison::LessEqual,
            BinaryOp::Greater => Comparison::Greater,
            BinaryOp::GreaterEqual => Comparison::GreaterEqual,
        };
        self.comparison(comparison, left, right, whole)
    }

    fn comparison(&mut self, comparison: Comparison, left: &Expr, right: &Expr, whole: &Expr) -> Option<Bound> {
        let (left, right) = (self.bind(left), self.bind(right));
        self.compared(comparison, left?, right?, whole)
    }

    /// A comparison of two operands that have been bound, each once however often it is compared.
    fn compared(&mut self, mut comparison: Comparison, left: Bound, right: Bound, whole: &Expr) -> Option<Bound> {
        let (both, _) = self.unified(&[left, right], whole, "compared")?;
        let (mut left, mut right) = (both[0], both[1]);
        let is_time = |this: &Self, bound: Bound| this.binder.builder.node(bound.node).op == Op::Time;
        // Time to the left: the kernels know windows by that form.
        if is_time(self, right) && !is_time(self, left) {
            (left, right, comparison) = (right, left, comparison.flipped());
        }
        Some(self.combine(&[left, right], Type::Bool, |n| Op::Compare(comparison, n[0], n[1])))
    }

    fn arithmetic(&mut self, op: Arithmetic, left: &Expr, right: &Expr, whole: &Expr) -> Option<Bound> {
        let (a, b) = (self.number(left), self.number(right));
        let (both, ty) = self.unified(&[a?, b?], whole, "combined")?;
        if ty == Type::Float && matches!(op, Arithmetic::Quotient | Arithmetic::Remainder) {
            let fault = Fault::new(self.place(whole), "division is for integers");
            return self.binder.refuse(fault.label("a float"));
        }
        Some(self.combine(&both, ty, |n| Op::Arithmetic(op, n[0], n[1])))
    }

    fn case(
        &mut self,
        operand: Option<&Expr>,
        branches: &[(Expr, Expr)],
        otherwise: Option<&Expr>,
        whole: &Expr,
    ) -> Option<Bound> {
        let operand = operand.map(|operand| self.bind(operand));
        let whens: Vec<Option<Bound>> = branches
            .iter()
            .map(|(when, _)| match operand {
                Some(operand) => {
                    let bound = self.bind(when);
                    self.compared(Comparison::Equal, operand?, bound?, when)
                }
                None => self.truth(when),
            })
            .collect();
        let thens: Vec<Option<Bound>> = branches.iter().map(|(_, then)| self.bind(then)).collect();
        let otherwise = otherwise.map(|expr| self.bind(expr));
        let whens: Vec<Bound> = whens.into_iter().collect::<Option<_>>()?;
        let mut values: Vec<Bound> = thens.into_iter().collect::<Option<_>>()?;
        let has_otherwise = otherwise.is_some();
        values.extend(otherwise.unwrap_or(None).map_or_else(Vec::new, |bound| vec![bound]));
        if has_otherwise && values.len() == whens.len() {
            return None;
        }
        let all_rates = values.iter().all(|value| value.rate || value.ty.is_none());
        let (values, ty) = self.unified(&values, whole, "results of one `case`")?;
        let operands: Vec<Bound> = whens.iter().chain(&values).copied().collect();
        let branch_count = whens.len();
        let bound = self.combine(&operands, ty, |nodes| {
            let (whens, values) = nodes.split_at(branch_count);
            Op::Case {
                branches: whens.iter().copied().zip(values.iter().copied()).collect(),
                otherwise: values.get(branch_count).copied(),
            }
        });
        Some(Bound { rate: all_rates && ty == Type::Bool, ..bound })
    }

    fn call(&mut self, name: &str, arguments: &[Expr], whole: &Expr) -> Option<Bound> {
        let Some(entry) = functions::find(name) else {
            let fault = Fault::new(self.place(whole), format!("unknown function `{name}`"));
            let near =
                nearest(name, FUNCTIONS.iter().map(|entry| entry.name)).map(|near| format!("did you mean `{near}`?"));
            let all: Vec<&str> = FUNCTIONS.iter().map(|entry| entry.name).collect();
            let help = near.unwrap_or_else(|| format!("functions are {}", all.join(", ")));
            return self.binder.refuse(fault.label("not a function of definitions").help(help));
        };
        let (least, most) = entry.arity;
        if arguments.len() < least || arguments.len() > most {
            let message = format!("`{name}` takes {}, found {}", arguments_wanted(entry), arguments.len());
            return self.binder.refuse(Fault::new(self.place(whole), message).help(entry.usage));
        }
        let bound = self.apply(entry, arguments, whole)?;
        if matches!(self.binder.builder.node(bound.node).op, Op::Aggregate(..) | Op::At(..)) {
            self.binder.builder.remember(bound.node, &self.written.text[whole.span.clone()]);
        }
        Some(bound)
    }

    fn apply(&mut self, entry: &Entry, arguments: &[Expr], whole: &Expr) -> Option<Bound> {
        match entry.function {
            Function::First => self.predicate(Aggregate::First, Type::Int, &arguments[0], entry),
            Function::Last => self.predicate(Aggregate::Last, Type::Int, &arguments[0], entry),
            Function::Any => self.predicate(Aggregate::Any, Type::Bool, &arguments[0], entry),
            Function::All => self.predicate(Aggregate::All, Type::Bool, &arguments[0], entry),
            Function::Count => self.predicate(Aggregate::Count, Type::Int, &arguments[0], entry),
            Function::Min => self.extreme(Aggregate::Min, &arguments[0]),
            Function::Max => self.extreme(Aggregate::Max, &arguments[0]),
            Function::Sum => self.sum(&arguments[0]),
            Function::At => self.at(&arguments[0], &arguments[1]),
            Function::Length => Some(self.unary(Op::Length, Type::Int, Level::Episode)),
            Function::Coalesce => self.coalesce(arguments, whole),
            Function::NullIf => self.null_if(&arguments[0], &arguments[1], whole),
            Function::Div => self.arithmetic(Arithmetic::Quotient, &arguments[0], &arguments[1], whole),
            Function::RegexpLike => self.regexp_like(&arguments[0], &arguments[1]),
        }
    }

    /// An aggregate over a condition.
    fn predicate(&mut self, aggregate: Aggregate, ty: Type, argument: &Expr, entry: &Entry) -> Option<Bound> {
        let bound = self.bind(argument)?;
        match bound.ty {
            Some(Type::Bool) => Some(self.aggregate(aggregate, ty, bound)),
            None => {
                let null = self.null_of(Type::Bool);
                Some(self.aggregate(aggregate, ty, null))
            }
            Some(found) => {
                let message = format!("`{}` takes a condition, found {}", entry.name, found.name());
                let help = if entry.function == Function::Count {
                    "count(p) counts the steps where p holds: write `count(x is not null)`"
                } else {
                    entry.usage
                };
                self.binder.refuse(Fault::new(self.place(argument), message).label(found.name()).help(help))
            }
        }
    }

    fn aggregate(&mut self, aggregate: Aggregate, ty: Type, argument: Bound) -> Bound {
        let argument_ty = self.binder.builder.node(argument.node).ty;
        let node = self.binder.spread(argument.node, argument_ty, argument.level, Level::Step);
        self.unary(Op::Aggregate(aggregate, node), ty, Level::Episode)
    }

    fn extreme(&mut self, aggregate: Aggregate, argument: &Expr) -> Option<Bound> {
        let bound = self.number(argument)?;
        let ty = bound.ty?;
        Some(self.aggregate(aggregate, ty, bound))
    }

    fn sum(&mut self, argument: &Expr) -> Option<Bound> {
        let bound = self.bind(argument)?;
        let fault = match bound.ty {
            Some(Type::Bool) if !bound.rate => {
                Fault::new(self.place(argument), "`sum` takes integers, found true or false").help("write `count(p)`")
            }
            Some(Type::Float) => Fault::new(self.place(argument), "`sum` takes integers, found a float")
                .help("a sum of floats depends on its order; count steps, or scale to an integer column"),
            _ => {
                let number = self.as_number(bound, argument)?;
                return Some(self.aggregate(Aggregate::Sum, Type::Int, number));
            }
        };
        self.binder.refuse(fault)
    }

    fn at(&mut self, value: &Expr, time: &Expr) -> Option<Bound> {
        let (value, moment) = (self.bind(value), self.number(time));
        let (value, moment) = (value?, moment?);
        if moment.level == Level::Step || moment.ty != Some(Type::Int) {
            let fault = Fault::new(self.place(time), "the timestep of `at` is one integer an episode");
            return self
                .binder
                .refuse(fault.help("at(x, t0): t0 is a constant or comes from first(), last(), length(), ..."));
        }
        let ty = value.ty.unwrap_or(Type::Bool);
        let steps = self.binder.spread(value.node, ty, value.level, Level::Step);
        let moment = self.binder.spread(moment.node, Type::Int, moment.level, Level::Episode);
        let bound = self.unary(Op::At(steps, moment), ty, Level::Episode);
        Some(Bound { rate: value.rate, ..bound })
    }

    fn coalesce(&mut self, arguments: &[Expr], whole: &Expr) -> Option<Bound> {
        let values: Vec<Option<Bound>> = arguments.iter().map(|argument| self.bind(argument)).collect();
        let values: Vec<Bound> = values.into_iter().collect::<Option<_>>()?;
        let rate = values.iter().all(|value| value.rate || value.ty.is_none());
        let (values, ty) = self.unified(&values, whole, "alternatives of one `coalesce`")?;
        let bound = self.combine(&values, ty, |nodes| Op::Coalesce(nodes.to_vec()));
        Some(Bound { rate: rate && ty == Type::Bool, ..bound })
    }

    fn null_if(&mut self, value: &Expr, other: &Expr, whole: &Expr) -> Option<Bound> {
        let (value, other) = (self.bind(value), self.bind(other));
        let value = value?;
        let equal = self.compared(Comparison::Equal, value, other?, whole)?;
        let ty = value.ty.unwrap_or(Type::Bool);
        let null = self.null_of(ty);
        Some(
            self.combine(&[equal, null, value], ty, |n| Op::Case {
                branches: vec![(n[0], n[1])],
                otherwise: Some(n[2]),
            }),
        )
    }

    fn regexp_like(&mut self, text: &Expr, pattern: &Expr) -> Option<Bound> {
        let bound = self.bind(text)?;
        let bound = match bound.ty {
            Some(Type::Text) => bound,
            None => self.null_of(Type::Text),
            Some(ty) => {
                let fault = Fault::new(self.place(text), format!("`regexp_like` searches text, found {}", ty.name()));
                return self.binder.refuse(fault.label(ty.name()));
            }
        };
        let ExprKind::Literal(Literal::Text(pattern_text)) = &pattern.kind else {
            let fault = Fault::new(self.place(pattern), "the pattern of `regexp_like` must be a constant text");
            return self.binder.refuse(fault.help("regexp_like(text, 'pattern')"));
        };
        if let Err(error) = regex::Regex::new(pattern_text) {
            let words = error.to_string();
            let last = words.lines().last().unwrap_or_default().trim_start_matches("error: ").to_owned();
            let fault = Fault::new(self.place(pattern), "not a regular expression");
            return self.binder.refuse(fault.label(last).help("the syntax is that of the Rust `regex` crate"));
        }
        Some(self.unary(Op::Matches(bound.node, pattern_text.clone()), Type::Bool, bound.level))
    }

    fn place(&self, expr: &Expr) -> Place {
        self.place_of(expr.span.clone())
    }

    fn place_of(&self, span: Range<usize>) -> Place {
        self.written.place(span)
    }
}

fn arguments_wanted(entry: &Entry) -> String {
    match entry.arity {
        (0, 0) => "no argument".to_owned(),
        (1, 1) => "1 argument".to_owned(),
        (least, most) if least == most => format!("{least} arguments"),
        (1, _) => "at least 1 argument".to_owned(),
        (least, _) => format!("at least {least} arguments"),
    }
}

//! Binds names to columns, checks types and levels, and builds one shared plan.
//!
//! Every definition is bound once, on demand, so definitions may be in any order. A definition that refers to itself is
//! refused with the path of references. A fault in one definition does not hide faults of others: definitions that
//! depend on a faulty one are skipped without a message.

mod calls;
mod decimals;
mod scope;
mod types;
mod values;

use std::collections::{BTreeSet, HashMap, HashSet};

use indexmap::IndexMap;

use self::scope::Scope;
use super::columns::{Columns, KnownColumn, Level, Type};
use super::file::{Document, MetricEntry};
use super::logical_plan::plan::{Builder, Node, NodeId, Op, Output, Plan};
use super::syntax;
use crate::catalogs::catalog::Kind;
use mirrorstats_exact::escape::visible;
use mirrorstats_toml_spec::{Fault, Written};

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bound {
    pub(super) node: NodeId,
    /// `None` is the literal null, which has every type.
    pub(super) ty: Option<Type>,
    pub(super) level: Level,
    /// True for a metric with a truth value, which counts as 0 or 1 where a number is needed.
    pub(super) rate: bool,
    /// The digits after the point of a number that is stored as an integer; 0 for all other values.
    pub(super) decimals: u8,
}

#[derive(Debug)]
pub(super) struct Binding {
    pub(super) plan: Plan,
    /// For each metric, the unit of the columns that its values come from, if that is one unit.
    pub(super) units: IndexMap<String, Option<String>>,
}

impl Binding {
    pub(super) fn output(&self, metric: &str) -> Option<&Output> {
        self.plan.outputs.get(self.units.get_index_of(metric)?)
    }
}

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
    let (mut outputs, mut units) = (Vec::new(), IndexMap::new());
    for (name, entry) in &document.metrics {
        if let Some(Bound { node, rate, decimals, .. }) = binder.definition(name) {
            let is_rate = rate || entry.said.unit.as_deref() == Some("rate");
            let kind = if is_rate { Kind::Rate } else { Kind::Quantity };
            outputs.push(Output { name: name.clone(), kind, decimals, node });
            units.insert(name.clone(), binder.unit_of(node));
        }
    }
    let filter = filter.and_then(|written| binder.condition(written, "a filter of episodes"));
    if !binder.faults.is_empty() {
        return Err(binder.faults);
    }
    let mut plan = binder.builder.finish();
    (plan.outputs, plan.lets, plan.filter) = (outputs, lets, filter.map(|bound| bound.node));
    Ok(Binding { plan, units })
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
    depth: usize,
    faults: Vec<Fault>,
}

/// The deepest nesting across definitions; bounds the stack.
const DEEPEST: usize = 400;

impl Binder<'_> {
    /// Each name has one meaning. A column outside the schema gives way to a definition of its name, so that definitions
    /// mean the same whatever else was recorded.
    fn check_names(&mut self) {
        let document = self.document;
        let lets = document.lets.iter().map(|(name, (_, place))| (name, place, "`let`"));
        let metrics = document.metrics.iter().map(|(name, entry)| (name, &entry.place, "metric"));
        for (name, place, what) in lets.chain(metrics) {
            let is_column =
                self.columns.known(name).is_some_and(KnownColumn::is_of_schema) || document.columns.contains_key(name);
            if name.is_empty() || name.contains(|c: char| c == ',' || c.is_control()) {
                let message = format!("`{}` is no name of a {}", visible(name), what.trim_matches('`'));
                self.faults.push(Fault::new(place.clone(), message).help("a name has visible characters and no comma"));
            } else if name == "t" || is_column {
                let message = format!("the {what} `{name}` has the name of a column");
                self.faults.push(Fault::new(place.clone(), message).help("choose another name"));
            } else if what == "metric" && document.lets.contains_key(name) {
                let message = format!("`{name}` is a `let` and a metric");
                self.faults.push(Fault::new(place.clone(), message).help("choose another name for one of them"));
            }
        }
    }

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

    fn metric_value(&mut self, bound: Bound, written: &Written) -> Option<Bound> {
        let place = written.everywhere();
        if bound.level == Level::Step {
            let fault = Fault::new(place, "a metric has one value per episode, this has one per step");
            let help =
                "lead down to the episode with any(), all(), count(), first(), last(), at(), min(), max() or sum()";
            return self.refuse(fault.label("one value per step").help(help));
        }
        match bound.ty {
            Some(ty @ (Type::Bool | Type::Int)) => {
                Some(Bound { rate: bound.rate || ty == Type::Bool, ..self.at_episode(bound, ty) })
            }
            Some(ty @ (Type::Float | Type::Text)) => {
                let fault =
                    Fault::new(place, format!("a metric is an integer or true or false, this is {}", ty.name()));
                let help = if ty == Type::Float { decimals::WITHOUT_DECIMALS } else { "compare it, or count steps" };
                self.refuse(fault.label(ty.name()).help(help))
            }
            None => self.refuse(Fault::new(place, "a metric that is always null is never defined")),
        }
    }

    fn condition(&mut self, written: &Written, what: &str) -> Option<Bound> {
        let bound = self.written(written)?;
        let place = written.everywhere();
        if bound.level == Level::Step {
            let fault = Fault::new(place, format!("{what} is decided once per episode, this has one value per step"));
            return self.refuse(fault.label("one value per step").help("wrap it: any(...) or all(...)"));
        }
        match bound.ty {
            Some(Type::Bool) => Some(self.at_episode(bound, Type::Bool)),
            ty => {
                let found = ty.map_or("null", Type::name);
                let fault = Fault::new(place, format!("{what} must be true or false, this is {found}"));
                self.refuse(fault.label(found))
            }
        }
    }

    /// The unit that the columns declare whose values are in this node's value.
    fn unit_of(&self, node: NodeId) -> Option<String> {
        let mut units = BTreeSet::new();
        self.walk(node, |node, todo| {
            match &node.op {
                Op::Column(name) => units.extend(self.document.columns.get(name).map(|entry| entry.unit.as_str())),
                Op::Case { branches, otherwise } => {
                    todo.extend(branches.iter().map(|(_, value)| *value).chain(*otherwise));
                }
                Op::At(value, _) => todo.push(*value),
                op if node.ty == Type::Int && !op.counts() => todo.extend(op.operands()),
                _ => {}
            }
            Some(())
        })?;
        let mut units = units.into_iter().filter(|unit| !unit.is_empty());
        units.next().filter(|_| units.next().is_none()).map(str::to_owned)
    }

    /// Visits a node and those that each visit adds, each once; `None` as soon as a visit gives it.
    fn walk(&self, from: NodeId, mut visit: impl FnMut(&Node, &mut Vec<NodeId>) -> Option<()>) -> Option<()> {
        let (mut seen, mut todo) = (HashSet::new(), vec![from]);
        while let Some(node) = todo.pop() {
            if seen.insert(node) {
                visit(self.builder.node(node), &mut todo)?;
            }
        }
        Some(())
    }

    fn at_episode(&mut self, bound: Bound, ty: Type) -> Bound {
        Bound { node: self.spread(bound.node, ty, bound.level, Level::Episode), level: Level::Episode, ..bound }
    }

    fn spread(&mut self, node: NodeId, ty: Type, from: Level, to: Level) -> NodeId {
        if from >= to { node } else { self.builder.add(Op::Spread(node), ty, to) }
    }

    fn refuse<T>(&mut self, fault: Fault) -> Option<T> {
        self.faults.push(fault);
        None
    }
}

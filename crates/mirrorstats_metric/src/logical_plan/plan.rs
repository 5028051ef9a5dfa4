//! The checked plan: typed operations over columns, each shared by all its users.
//!
//! A plan is a list of nodes in which operands come before their users, so one pass from the front evaluates it. Equal
//! operations are one node, so shared parts of metrics are computed once. Lowerings such as the kernels in `score` need
//! only this file.

use std::collections::HashMap;

use crate::catalogs::catalog::Kind;
use crate::columns::{Level, Type};

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeId(pub(crate) usize);

impl NodeId {
    /// The position as an index into [`Plan::nodes`].
    pub const fn index(self) -> usize {
        self.0
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    pub op: Op,
    pub ty: Type,
    pub level: Level,
}

/// The operations. Unless said otherwise, a null operand gives null (SQL's three-valued logic). Operands have one type
/// and one level, except that any operand may be a constant. An operand is a node here, and a step in a physical plan.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Op<N = NodeId> {
    Column(String),
    /// The timestep t, 1-based.
    Time,
    Length,
    Constant(Constant),
    /// An episode's value repeated at each of its steps, or a constant repeated at each episode or step.
    Spread(N),
    Not(N),
    /// Kleene's conjunction: false if either is false.
    And(N, N),
    /// Kleene's disjunction: true if either is true.
    Or(N, N),
    Compare(Comparison, N, N),
    /// True if two values differ, with null as an ordinary value; never null.
    Distinct(N, N),
    /// True if the value is null; never null.
    IsNull(N),
    /// True if a truth value is true; never null.
    IsTrue(N),
    /// True if a truth value is false; never null.
    IsFalse(N),
    /// Sum, difference, product, quotient or remainder; a result beyond 64 bits is an error.
    Arithmetic(Arithmetic, N, N),
    Negate(N),
    /// The value after the first condition that is true, else the last value, else null.
    Case {
        branches: Vec<(N, N)>,
        otherwise: Option<N>,
    },
    /// The first value that is not null.
    Coalesce(Vec<N>),
    /// True if a text contains a match of a regular expression (syntax of the `regex` crate).
    Matches(N, String),
    /// 1 for true, 0 for false.
    IntFromBool(N),
    FloatFromInt(N),
    /// A float times this power of ten, rounded to an integer, halves away from zero. Other than finite values below
    /// 2^53 are errors.
    Scale(N, u8),
    Aggregate(Aggregate, N),
    /// The value of the first operand at the timestep in the second; null if that step does not exist.
    At(N, N),
    /// The value at step t - 1 of the same episode; null at the first step.
    Lag(N),
}

/// A constant; floats are stored as bits so that equal constants are one node.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Constant {
    /// Null of the node's type.
    Null,
    Bool(bool),
    Int(i64),
    Float(u64),
    Text(String),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Comparison {
    Equal,
    NotEqual,
    Less,
    LessEqual,
    Greater,
    GreaterEqual,
}

impl Comparison {
    #[must_use]
    pub const fn flipped(self) -> Self {
        match self {
            Self::Equal => Self::Equal,
            Self::NotEqual => Self::NotEqual,
            Self::Less => Self::Greater,
            Self::LessEqual => Self::GreaterEqual,
            Self::Greater => Self::Less,
            Self::GreaterEqual => Self::LessEqual,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Arithmetic {
    Add,
    Subtract,
    Multiply,
    /// `div(x, y)`: only integers; rounds towards zero; null if y is 0.
    Quotient,
    /// `x % y`: only integers; the sign of x; null if y is 0.
    Remainder,
}

/// A function from the steps of an episode to one value. A null predicate counts as false.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Aggregate {
    /// The t of the first step where the predicate holds, or null.
    First,
    /// The t of the last step where the predicate holds, or null.
    Last,
    /// True if the predicate is true at some step; never null.
    Any,
    /// True if the predicate is true at every step; never null.
    All,
    /// The number of steps where it holds; never null.
    Count,
    /// The smallest value, ignoring nulls; null without values.
    Min,
    /// The largest value, ignoring nulls; null without values.
    Max,
    /// The sum of the values, ignoring nulls; null without values.
    Sum,
}

impl Aggregate {
    /// Returns true if the result depends only on the steps where a predicate holds.
    pub const fn searches(self) -> bool {
        matches!(self, Self::First | Self::Last | Self::Any | Self::Count)
    }
}

mirrorstats_exact::names!(Comparison {
    Equal: "=",
    NotEqual: "<>",
    Less: "<",
    LessEqual: "<=",
    Greater: ">",
    GreaterEqual: ">="
});

mirrorstats_exact::names!(Arithmetic { Add: "+", Subtract: "-", Multiply: "*", Quotient: "div", Remainder: "%" });

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Output {
    pub name: String,
    pub kind: Kind,
    /// The digits after the point of its values, which are integers in units of the last digit.
    pub decimals: u8,
    /// Its value per episode: a truth value for most rates, else an integer.
    pub node: NodeId,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plan {
    nodes: Vec<Node>,
    /// The metrics, in the order of the catalog.
    pub outputs: Vec<Output>,
    /// The named expressions in the order of definition, for evidence.
    pub lets: Vec<(String, NodeId)>,
    /// Aggregates and lookups in the words of their first use, for evidence.
    pub sources: HashMap<NodeId, String>,
    /// The filter, an episode-level truth value; all episodes count if absent.
    pub filter: Option<NodeId>,
}

impl Plan {
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    pub fn node(&self, id: NodeId) -> &Node {
        &self.nodes[id.0]
    }

    pub fn select(&mut self, names: &[String]) {
        self.outputs.retain(|output| names.contains(&output.name));
    }

    /// The nodes that the metrics and the filter depend on, in order.
    pub fn needed(&self) -> Vec<NodeId> {
        self.needed_by(self.outputs.iter().map(|output| output.node).chain(self.filter))
    }

    /// These nodes and all that they depend on, in order.
    pub fn needed_by(&self, roots: impl IntoIterator<Item = NodeId>) -> Vec<NodeId> {
        let mut needed = vec![false; self.nodes.len()];
        roots.into_iter().for_each(|root| needed[root.0] = true);
        for at in (0..self.nodes.len()).rev() {
            if needed[at] {
                self.nodes[at].op.operands().into_iter().for_each(|operand| needed[operand.0] = true);
            }
        }
        (0..self.nodes.len()).filter(|&at| needed[at]).map(NodeId).collect()
    }

    /// The comparison of `t` with a moment of the episode that a condition is, if it is one.
    pub fn window(&self, condition: &Op) -> Option<(Comparison, NodeId)> {
        match condition {
            Op::Compare(comparison, left, right) if self.node(*left).op == Op::Time => match &self.node(*right).op {
                Op::Spread(moment) => Some((*comparison, *moment)),
                Op::Constant(_) => Some((*comparison, *right)),
                _ => None,
            },
            _ => None,
        }
    }

    pub fn columns(&self, nodes: &[NodeId]) -> Vec<(&str, Level)> {
        let column = |id: &NodeId| match &self.node(*id).op {
            Op::Column(name) => Some((name.as_str(), self.node(*id).level)),
            _ => None,
        };
        nodes.iter().filter_map(column).collect()
    }
}

impl<N: Copy> Op<N> {
    /// Returns true if the result is a number of steps or a timestep, not a value of steps.
    pub(crate) const fn counts(&self) -> bool {
        matches!(
            self,
            Self::Length | Self::Time | Self::Aggregate(Aggregate::First | Aggregate::Last | Aggregate::Count, _)
        )
    }

    pub fn operands(&self) -> Vec<N> {
        let mut operands = Vec::new();
        let _ = self.map(|operand| operands.push(operand));
        operands
    }

    /// The same operation with each operand replaced by `to`, in order.
    pub fn map<M>(&self, mut to: impl FnMut(N) -> M) -> Op<M> {
        match self {
            Self::Column(name) => Op::Column(name.clone()),
            Self::Time => Op::Time,
            Self::Length => Op::Length,
            Self::Constant(constant) => Op::Constant(constant.clone()),
            Self::Spread(x) => Op::Spread(to(*x)),
            Self::Not(x) => Op::Not(to(*x)),
            Self::And(x, y) => Op::And(to(*x), to(*y)),
            Self::Or(x, y) => Op::Or(to(*x), to(*y)),
            Self::Compare(comparison, x, y) => Op::Compare(*comparison, to(*x), to(*y)),
            Self::Distinct(x, y) => Op::Distinct(to(*x), to(*y)),
            Self::IsNull(x) => Op::IsNull(to(*x)),
            Self::IsTrue(x) => Op::IsTrue(to(*x)),
            Self::IsFalse(x) => Op::IsFalse(to(*x)),
            Self::Arithmetic(op, x, y) => Op::Arithmetic(*op, to(*x), to(*y)),
            Self::Negate(x) => Op::Negate(to(*x)),
            Self::Case { branches, otherwise } => Op::Case {
                branches: branches.iter().map(|(when, then)| (to(*when), to(*then))).collect(),
                otherwise: otherwise.map(&mut to),
            },
            Self::Coalesce(values) => Op::Coalesce(values.iter().map(|value| to(*value)).collect()),
            Self::Matches(x, pattern) => Op::Matches(to(*x), pattern.clone()),
            Self::IntFromBool(x) => Op::IntFromBool(to(*x)),
            Self::FloatFromInt(x) => Op::FloatFromInt(to(*x)),
            Self::Scale(x, decimals) => Op::Scale(to(*x), *decimals),
            Self::Aggregate(aggregate, x) => Op::Aggregate(*aggregate, to(*x)),
            Self::At(x, moment) => Op::At(to(*x), to(*moment)),
            Self::Lag(x) => Op::Lag(to(*x)),
        }
    }
}

#[derive(Debug, Default)]
pub(crate) struct Builder {
    plan: Plan,
    known: HashMap<(Op, Type, Level), NodeId>,
    lags: Vec<u8>,
}

impl Builder {
    pub(crate) fn add(&mut self, op: Op, ty: Type, level: Level) -> NodeId {
        *self.known.entry((op, ty, level)).or_insert_with_key(|(op, ty, level)| {
            let deepest = op.operands().iter().map(|operand| self.lags[operand.0]).max().unwrap_or(0);
            self.lags.push(match op {
                Op::Lag(_) => deepest.saturating_add(1),
                Op::Aggregate(..) | Op::At(..) => 0,
                _ => deepest,
            });
            self.plan.nodes.push(Node { op: op.clone(), ty: *ty, level: *level });
            NodeId(self.plan.nodes.len() - 1)
        })
    }

    pub(crate) fn lags(&self, id: NodeId) -> u8 {
        self.lags[id.0]
    }

    pub(crate) fn remember(&mut self, id: NodeId, text: &str) {
        self.plan.sources.entry(id).or_insert_with(|| text.to_owned());
    }

    pub(crate) fn node(&self, id: NodeId) -> &Node {
        self.plan.node(id)
    }

    pub(crate) fn plan(&self) -> &Plan {
        &self.plan
    }

    pub(crate) fn finish(self) -> Plan {
        self.plan
    }
}

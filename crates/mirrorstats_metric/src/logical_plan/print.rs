//! The logical plan as text: one line per node, then the outputs.

use std::fmt;

use crate::columns::Level;
use crate::logical_plan::plan::{Aggregate, Arithmetic, Comparison, Constant, NodeId, Op, Plan};

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for id in self.ids() {
            let node = self.node(id);
            let level = match node.level {
                Level::Constant => "constant",
                Level::Episode => "per episode",
                Level::Step => "per timestep",
            };
            writeln!(f, "{:<5}{level:<14}{}", id.to_string(), node.op)?;
        }
        if let Some(filter) = self.filter {
            writeln!(f, "where {filter}")?;
        }
        self.outputs.iter().try_for_each(|output| writeln!(f, "{} = {}", output.name, output.node))
    }
}

impl fmt::Display for NodeId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "#{}", self.0)
    }
}

impl fmt::Display for Op {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Column(name) => write!(f, "column {name}"),
            Self::Constant(constant) => write!(f, "constant {constant}"),
            Self::Compare(comparison, x, y) => write!(f, "{x} {comparison} {y}"),
            Self::Arithmetic(op, x, y) => write!(f, "{x} {op} {y}"),
            Self::Matches(x, pattern) => write!(f, "{x} matches {pattern:?}"),
            Self::Aggregate(aggregate, x) => write!(f, "{aggregate} {x}"),
            Self::At(x, moment) => write!(f, "{x} at t = {moment}"),
            Self::Case { branches, otherwise } => {
                write!(f, "case")?;
                branches.iter().try_for_each(|(when, then)| write!(f, " when {when} then {then}"))?;
                otherwise.map_or(Ok(()), |node| write!(f, " else {node}"))
            }
            other => {
                write!(f, "{}", other.word())?;
                other.operands().iter().try_for_each(|operand| write!(f, " {operand}"))
            }
        }
    }
}

impl Op {
    const fn word(&self) -> &'static str {
        match self {
            Self::Time => "timestep",
            Self::Length => "length",
            Self::Spread(_) => "spread",
            Self::Not(_) => "not",
            Self::And(..) => "and",
            Self::Or(..) => "or",
            Self::Distinct(..) => "distinct",
            Self::IsNull(_) => "is null",
            Self::IsTrue(_) => "is true",
            Self::IsFalse(_) => "is false",
            Self::Negate(_) => "negate",
            Self::Coalesce(_) => "coalesce",
            Self::IntFromBool(_) => "int",
            Self::FloatFromInt(_) => "float",
            Self::Lag(_) => "lag",
            _ => "",
        }
    }
}

impl fmt::Display for Constant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Null => write!(f, "null"),
            Self::Bool(value) => write!(f, "{value}"),
            Self::Int(value) => write!(f, "{value}"),
            Self::Float(bits) => write!(f, "{:?}", f64::from_bits(*bits)),
            Self::Text(text) => write!(f, "{text:?}"),
        }
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

mirrorstats_exact::names!(Aggregate {
    First: "first",
    Last: "last",
    Any: "any",
    All: "all",
    Count: "count",
    Min: "min",
    Max: "max",
    Sum: "sum",
});

macro_rules! by_name {
    ($($type:ty)+) => {
        $(impl fmt::Display for $type {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(self.name())
            }
        })+
    };
}

by_name!(Comparison Arithmetic Aggregate);

//! Nodes of a plan as SQL expressions: values of one step (table `s`) or of one episode (tables `e1`, ...).
//!
//! Truth values of episodes are stored as 0 and 1.

use std::fmt::Write as _;

use super::Dialect;
use super::layout::Layout;
use super::one_pass::Windowed;
use crate::columns::{Level, Type};
use crate::logical_plan::plan::{Aggregate, Comparison, Constant, NodeId, Op};

impl Layout<'_> {
    fn counted(&self, text: impl FnOnce() -> String) -> String {
        if !self.spend(1) {
            return String::new();
        }
        let text = text();
        // An incomplete text is not repeated in those that contain it.
        if self.spend(text.len()) { text } else { String::new() }
    }

    fn name(&self, name: &str) -> String {
        self.dialect.quoted(name)
    }

    fn of_step(&self, id: NodeId, name: &str) -> String {
        match self.lag.get() {
            0 => format!("s.{}", self.name(name)),
            lag => format!("lag{lag}.{}", self.lag_column(lag, &id.index().to_string())),
        }
    }

    fn time(&self) -> String {
        match self.lag.get() {
            0 => "s.t".to_owned(),
            lag => format!("lag{lag}.{}", self.lag_column(lag, "t")),
        }
    }

    /// The expression for the previous step; null at the first step.
    fn lagged(&self, written: impl FnOnce() -> String) -> String {
        let lag = self.lag.get();
        self.lag.set(lag + 1);
        let (time, value) = (self.time(), written());
        self.lag.set(lag);
        format!("CASE WHEN {time} IS NOT NULL THEN {value} END")
    }

    pub(super) fn aggregate(&self, id: NodeId) -> String {
        let node = self.plan.node(id);
        match &node.op {
            Op::Length => "COUNT(s.t)".to_owned(),
            Op::Column(name) if node.ty == Type::Bool => {
                format!("MIN(CASE WHEN s.{0} THEN 1 WHEN NOT s.{0} THEN 0 END)", self.name(name))
            }
            Op::Column(name) if node.ty == Type::Float => {
                format!("MIN(CAST(s.{} AS DOUBLE))", self.name(name))
            }
            Op::Column(name) => format!("{}(s.{})", self.dialect.any_value(), self.name(name)),
            Op::At(value, moment) => self.lookup(id, *value, *moment),
            Op::Aggregate(aggregate, x) => match aggregate {
                Aggregate::First => format!("MIN(CASE WHEN {} THEN s.t END)", self.truth(*x)),
                Aggregate::Last => format!("MAX(CASE WHEN {} THEN s.t END)", self.truth(*x)),
                Aggregate::Any => format!("MAX(CASE WHEN {} THEN 1 ELSE 0 END)", self.truth(*x)),
                Aggregate::All => format!("MIN(CASE WHEN {} THEN 1 ELSE 0 END)", self.truth(*x)),
                Aggregate::Count => {
                    // DuckDB sums integers in 128 bits, which keeps it from joining the passes well.
                    format!("COUNT(CASE WHEN {} THEN 1 END)", self.truth(*x))
                }
                Aggregate::Min => format!("MIN({})", self.value(*x)),
                Aggregate::Max => format!("MAX({})", self.value(*x)),
                Aggregate::Sum => format!("SUM({})", wide(&self.value(*x))),
            },
            _ => self.value(id),
        }
    }

    fn lookup(&self, id: NodeId, value: NodeId, moment: NodeId) -> String {
        let value = self.operand(value);
        match (self.landmark(id), self.dialect.functions()) {
            (Some((landmark, condition)), Some(functions)) => {
                let function = functions.value_at[usize::from(landmark == Aggregate::Last)];
                let found = condition.map(|condition| format!("CASE WHEN {} THEN s.t END", self.truth(condition)));
                format!("{function}({value}, {})", found.as_deref().unwrap_or("s.t"))
            }
            _ => format!("MAX(CASE WHEN s.t = {} THEN {value} END)", self.value(moment)),
        }
    }

    pub(super) fn read(&self, id: NodeId) -> Option<String> {
        match &self.plan.node(id).op {
            _ if self.is_aggregate(id) => Some(format!("e{}.{}", self.pass(id), self.column('n', id))),
            Op::Column(name) if self.plan.node(id).level == Level::Episode => Some(format!("e1.{name}")),
            _ if self.is_shared(id) => Some(format!("s.{}", self.step_column(id))),
            _ => None,
        }
    }

    pub(super) fn value(&self, id: NodeId) -> String {
        self.counted(|| self.value_of(id))
    }

    fn value_of(&self, id: NodeId) -> String {
        let node = self.plan.node(id);
        if let Some(column) = self.read(id) {
            return column;
        }
        match &node.op {
            Op::Column(name) if node.ty == Type::Float => format!("CAST({} AS DOUBLE)", self.of_step(id, name)),
            Op::Column(name) => self.of_step(id, name),
            Op::Time => self.time(),
            Op::Lag(x) => self.lagged(|| self.value(*x)),
            Op::Constant(constant) => self.dialect.constant(constant, node.ty),
            Op::Spread(x) => self.value(*x),
            Op::Negate(x) => format!("(0 - {})", self.number(*x)),
            Op::Arithmetic(op, x, y) => self.dialect.arithmetic(*op, &self.number(*x), &self.number(*y)),
            // Spark's 1 and 0 have 32 bits.
            Op::IntFromBool(x) if self.dialect == Dialect::Spark => wide(&self.truth_as_int(*x)),
            Op::IntFromBool(x) => self.truth_as_int(*x),
            Op::FloatFromInt(x) => format!("CAST({} AS DOUBLE)", self.value(*x)),
            Op::Scale(x, decimals) => {
                // FLOOR means the same in all engines; they disagree on how ROUND rounds a half.
                let scaled = format!("{} * CAST(1e{decimals} AS DOUBLE)", self.value(*x));
                let up = format!("FLOOR({scaled} + CAST(0.5 AS DOUBLE))");
                let down = format!("0 - FLOOR(CAST(0.5 AS DOUBLE) - {scaled})");
                wide(&format!("CASE WHEN {} < 0 THEN {down} ELSE {up} END", self.value(*x)))
            }
            Op::Case { branches, otherwise } => self.case(branches, *otherwise, |id| self.value(id)),
            Op::Coalesce(values) => coalesce(values.iter().map(|&id| self.value(id))),
            _ => self.searched(id).unwrap_or_else(|| self.truth_as_int(id)),
        }
    }

    fn searched(&self, id: NodeId) -> Option<String> {
        let (list, functions) = (self.list(id)?, self.dialect.functions()?);
        let Op::Aggregate(aggregate, _) = self.plan.node(id).op else { return None };
        let [count, smallest, largest] = functions.of_list;
        let items = self.items(list);
        Some(match aggregate {
            Aggregate::First => format!("{smallest}({items})"),
            Aggregate::Last => format!("{largest}({items})"),
            Aggregate::Any => format!("CASE WHEN {count}({items}) > 0 THEN 1 ELSE 0 END"),
            _ => format!("COALESCE({count}({items}), 0)"),
        })
    }

    fn items(&self, Windowed { condition, windows }: &Windowed) -> String {
        let item = format!("t{}", condition.index());
        let window = |(comparison, moment): &(Comparison, NodeId)| {
            format!("{item} {} {}", comparison.name(), self.value(*moment))
        };
        let windows: Vec<String> = windows.iter().map(window).collect();
        let list = format!("e1.{}", self.column('l', *condition));
        self.dialect.filtered(&list, &item, &windows.join(" AND "))
    }

    fn number(&self, id: NodeId) -> String {
        let node = self.plan.node(id);
        match node.op {
            Op::Arithmetic(..) | Op::Negate(_) => self.value(id),
            _ if node.ty == Type::Int => wide(&self.value(id)),
            _ => self.value(id),
        }
    }

    /// A truth value as 0, 1 or null.
    pub(super) fn truth_as_int(&self, id: NodeId) -> String {
        self.counted(|| self.truth_as_int_of(id))
    }

    fn truth_as_int_of(&self, id: NodeId) -> String {
        match &self.plan.node(id).op {
            _ if self.is_shared(id) => self.int_of_truth(id),
            _ if self.is_aggregate(id) || self.list(id).is_some() => self.value(id),
            Op::Spread(x) => self.truth_as_int(*x),
            Op::Lag(x) => self.lagged(|| self.truth_as_int(*x)),
            Op::Case { branches, otherwise } => self.case(branches, *otherwise, |id| self.truth_as_int(id)),
            Op::Coalesce(values) => coalesce(values.iter().map(|&id| self.truth_as_int(id))),
            Op::Constant(Constant::Bool(value)) => i64::from(*value).to_string(),
            Op::Constant(_) => "CAST(NULL AS BIGINT)".to_owned(),
            Op::IsTrue(x) => format!("CASE WHEN {} THEN 1 ELSE 0 END", self.truth(*x)),
            Op::IsFalse(x) => format!("CASE WHEN NOT {} THEN 1 ELSE 0 END", self.truth(*x)),
            _ => self.int_of_truth(id),
        }
    }

    fn int_of_truth(&self, id: NodeId) -> String {
        let truth = self.truth(id);
        let otherwise = if self.is_never_null(id) { "ELSE 0".to_owned() } else { format!("WHEN NOT {truth} THEN 0") };
        format!("CASE WHEN {truth} THEN 1 {otherwise} END")
    }

    fn is_never_null(&self, id: NodeId) -> bool {
        if !self.spend(1) {
            return false;
        }
        match &self.plan.node(id).op {
            Op::IsNull(_) | Op::IsTrue(_) | Op::IsFalse(_) | Op::Distinct(..) | Op::Aggregate(..) => true,
            Op::Constant(constant) => *constant != Constant::Null,
            Op::Spread(x) | Op::Not(x) => self.is_never_null(*x),
            Op::And(x, y) | Op::Or(x, y) => self.is_never_null(*x) && self.is_never_null(*y),
            _ => false,
        }
    }

    pub(super) fn truth(&self, id: NodeId) -> String {
        self.counted(|| self.truth_of(id))
    }

    fn truth_of(&self, id: NodeId) -> String {
        let node = self.plan.node(id);
        if self.is_shared(id) {
            return format!("s.{}", self.step_column(id));
        }
        match &node.op {
            Op::Column(name) if node.level == Level::Step => self.of_step(id, name),
            Op::Spread(x) => self.truth(*x),
            Op::Not(x) => match &self.plan.node(*x).op {
                Op::IsNull(y) if !self.is_shared(*x) => format!("({} IS NOT NULL)", self.operand(*y)),
                _ => format!("(NOT {})", self.truth(*x)),
            },
            Op::And(x, y) => format!("({} AND {})", self.truth(*x), self.truth(*y)),
            Op::Or(x, y) => format!("({} OR {})", self.truth(*x), self.truth(*y)),
            Op::Compare(comparison, x, y) => {
                let (x, y) = (self.operand(*x), self.operand(*y));
                format!("({x} {} {y})", comparison.name())
            }
            Op::Distinct(x, y) => {
                let (x, y) = (self.operand(*x), self.operand(*y));
                format!(
                    "(CASE WHEN {x} IS NULL AND {y} IS NULL THEN 0 WHEN {x} IS NULL OR {y} IS NULL THEN 1 \
                     WHEN {x} = {y} THEN 0 ELSE 1 END = 1)"
                )
            }
            Op::IsNull(x) => format!("({} IS NULL)", self.operand(*x)),
            Op::Matches(x, pattern) => {
                let function = self.dialect.functions().map_or("regexp_like", |functions| functions.matches);
                format!("{function}({}, {})", self.value(*x), self.dialect.pattern(pattern))
            }
            _ => format!("({} = 1)", self.truth_as_int(id)),
        }
    }

    fn operand(&self, id: NodeId) -> String {
        if self.plan.node(id).ty == Type::Bool { self.truth_as_int(id) } else { self.value(id) }
    }

    fn case(
        &self,
        branches: &[(NodeId, NodeId)],
        otherwise: Option<NodeId>,
        value: impl Fn(NodeId) -> String,
    ) -> String {
        let mut text = "CASE".to_owned();
        for (when, then) in branches {
            // Null counts as false here.
            let when = match self.plan.node(*when).op {
                Op::IsTrue(x) if !self.is_shared(*when) => self.truth(x),
                _ => self.truth(*when),
            };
            let _ = write!(text, " WHEN {when} THEN {}", value(*then));
        }
        if let Some(otherwise) = otherwise {
            let _ = write!(text, " ELSE {}", value(otherwise));
        }
        text + " END"
    }
}

fn coalesce(values: impl Iterator<Item = String>) -> String {
    format!("COALESCE({})", values.collect::<Vec<_>>().join(", "))
}

fn wide(value: &str) -> String {
    format!("CAST({value} AS BIGINT)")
}

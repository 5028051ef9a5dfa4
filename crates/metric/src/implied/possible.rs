//! The possible values of each node of a plan: an interval, and whether null is possible.
//!
//! Rule: includes at least all values that some trace gives. Truth values are 0 and 1. Texts and floats have no
//! interval, so comparisons of them are open.

use crate::columns::Type;
use crate::overflow::{ALL, Range, arithmetic, hull};
use crate::plan::{Aggregate, Arithmetic, Constant, NodeId, Op, Plan};

const TRUTHS: Range = (0, 1);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Possible {
    /// The values; `None` if the node never has one.
    values: Option<Range>,
    pub(super) may_be_null: bool,
}

impl Possible {
    pub(super) const NULL: Self = Self { values: None, may_be_null: true };

    pub(super) const NOT_TRUE: Self = Self { values: Some((0, 0)), may_be_null: true };

    const fn always(values: Range) -> Self {
        Self { values: Some(values), may_be_null: false }
    }

    /// The smallest and the largest value, within 64 bits.
    pub(super) fn range(&self) -> (i64, i64) {
        let (low, high) = self.values.unwrap_or((0, 0));
        let fit = |value: i128| i64::try_from(value.clamp(ALL.0, ALL.1)).expect("clamped to 64 bits");
        (fit(low), fit(high))
    }

    /// The value, if it is the only possible one and null is impossible.
    pub(super) fn only_value(&self) -> Option<i64> {
        let (low, high) = self.range();
        (self.values.is_some() && !self.may_be_null && low == high).then_some(low)
    }

    fn can_be_true(self) -> bool {
        self.values.is_some_and(|(_, high)| high > 0)
    }

    fn is_true(self) -> bool {
        !self.may_be_null && self.values.is_some_and(|(low, _)| low > 0)
    }

    fn is_false(self) -> bool {
        !self.may_be_null && !self.can_be_true()
    }

    fn truth(can_be_false: bool, can_be_true: bool) -> Self {
        Self::always((i128::from(!can_be_false), i128::from(can_be_true)))
    }

    fn or(self, other: Self) -> Self {
        let values = match (self.values, other.values) {
            (Some(one), Some(other)) => Some(hull([one, other])),
            (one, other) => one.or(other),
        };
        Self { values, may_be_null: self.may_be_null || other.may_be_null }
    }

    fn map(self, to: impl Fn(Range) -> Range) -> Self {
        Self { values: self.values.map(to), ..self }
    }
}

const MOST_MOMENTS: usize = 6;

#[derive(Clone, Copy)]
pub(super) struct Traces<'p> {
    pub(super) plan: &'p Plan,
    pub(super) steps: u32,
    pub(super) has_value: fn(&str) -> bool,
}

impl Traces<'_> {
    /// The possible values of a node, given the values of `assumed` nodes. Examines both cases of each first and last
    /// moment that the node needs: present and absent. This shows that `x is not null and x > 3` is never null.
    pub(super) fn of_node(&self, node: NodeId, assumed: &[(NodeId, Possible)]) -> Possible {
        let needed = self.plan.needed_by([node]);
        let is_moment =
            |id: &&NodeId| matches!(self.plan.node(**id).op, Op::Aggregate(Aggregate::First | Aggregate::Last, _));
        let moments: Vec<NodeId> = needed.iter().filter(is_moment).copied().take(MOST_MOMENTS).collect();
        let there = Possible::always((1, self.steps.into()));
        let cases = (0..1_usize << moments.len()).map(|case| {
            let is_there = |at: usize| if case >> at & 1 == 1 { there } else { Possible::NULL };
            let taken = moments.iter().enumerate().map(|(at, moment)| (*moment, is_there(at)));
            self.evaluate(&needed, &assumed.iter().copied().chain(taken).collect::<Vec<_>>())
        });
        cases.reduce(Possible::or).expect("there is one case at least")
    }

    fn evaluate(&self, needed: &[NodeId], assumed: &[(NodeId, Possible)]) -> Possible {
        let mut found = vec![Possible::NULL; self.plan.nodes().len()];
        let mut last = Possible::NULL;
        for &id in needed {
            let known = assumed.iter().find(|(node, _)| *node == id).map(|(_, possible)| *possible);
            last = known.unwrap_or_else(|| self.of_op(id, |of| found[of.index()]));
            last = last.map(|(low, high)| (low.max(ALL.0), high.min(ALL.1)));
            found[id.index()] = last;
        }
        last
    }

    fn of_op(&self, id: NodeId, of: impl Fn(NodeId) -> Possible) -> Possible {
        let node = self.plan.node(id);
        match &node.op {
            Op::Column(name) => {
                let values = if node.ty == Type::Bool { TRUTHS } else { ALL };
                Possible { values: Some(values), may_be_null: !(self.has_value)(name) }
            }
            Op::At(x, moment) => self.at(*x, *moment, of),
            op => of_op(op, self.steps.into(), of),
        }
    }

    fn at(&self, x: NodeId, moment: NodeId, of: impl Fn(NodeId) -> Possible) -> Possible {
        let values = of(x).values.filter(|_| of(moment).values.is_some());
        let is_there = match self.plan.node(moment).op {
            Op::Aggregate(Aggregate::First | Aggregate::Last, holds) => !of(x).may_be_null || self.asks_for(holds, x),
            _ => false,
        };
        Possible { values, may_be_null: of(moment).may_be_null || !is_there }
    }

    /// Returns true if a predicate can hold only if `x` has a value.
    fn asks_for(&self, predicate: NodeId, x: NodeId) -> bool {
        match self.plan.node(predicate).op {
            Op::And(a, b) => self.asks_for(a, x) || self.asks_for(b, x),
            Op::Not(missing) => self.plan.node(missing).op == Op::IsNull(x),
            _ => false,
        }
    }
}

fn of_op(op: &Op, steps: i128, of: impl Fn(NodeId) -> Possible) -> Possible {
    match op {
        Op::Column(_) | Op::At(..) => Possible { values: Some(ALL), may_be_null: true },
        Op::Time | Op::Length => Possible::always((1, steps)),
        Op::Constant(constant) => of_constant(constant),
        Op::Spread(x) | Op::IntFromBool(x) | Op::FloatFromInt(x) => of(*x),
        Op::Lag(x) => Possible { may_be_null: true, ..of(*x) },
        Op::Not(x) => of(*x).map(|(low, high)| (1 - high, 1 - low)),
        Op::And(x, y) => both(of(*x), of(*y)),
        Op::Or(x, y) => {
            let not = |x: Possible| x.map(|(low, high)| (1 - high, 1 - low));
            not(both(not(of(*x)), not(of(*y))))
        }
        Op::Compare(_, x, y) => of_two(of(*x), of(*y), |_, _| TRUTHS),
        Op::Distinct(..) => Possible::always(TRUTHS),
        Op::IsNull(x) => Possible::truth(of(*x).values.is_some(), of(*x).may_be_null),
        Op::IsTrue(x) => Possible::truth(!of(*x).is_true(), of(*x).can_be_true()),
        Op::IsFalse(x) => {
            let can_be_false = of(*x).values.is_some_and(|(low, _)| low == 0);
            Possible::truth(!of(*x).is_false(), can_be_false)
        }
        Op::Arithmetic(op, x, y) => of_arithmetic(*op, of(*x), of(*y)),
        Op::Negate(x) => of(*x).map(|(low, high)| (-high, -low)),
        Op::Case { branches, otherwise } => of_case(branches, otherwise.map(&of), &of),
        Op::Coalesce(values) => of_coalesce(values.iter().map(|value| of(*value))),
        Op::Matches(x, _) => of(*x).map(|_| TRUTHS),
        Op::Aggregate(aggregate, x) => of_aggregate(*aggregate, of(*x), steps),
    }
}

fn of_constant(constant: &Constant) -> Possible {
    match constant {
        Constant::Null => Possible::NULL,
        Constant::Bool(truth) => Possible::always((i128::from(*truth), i128::from(*truth))),
        Constant::Int(value) => Possible::always(((*value).into(), (*value).into())),
        Constant::Float(_) | Constant::Text(_) => Possible::always(ALL),
    }
}

fn both(left: Possible, right: Possible) -> Possible {
    if left.is_false() || right.is_false() {
        return Possible::always((0, 0));
    }
    let may_be_null = left.may_be_null || right.may_be_null;
    let values = match (left.values, right.values) {
        (Some((a, b)), Some((c, d))) => Some((a.min(c), b.min(d))),
        (Some((0, _)), None) | (None, Some((0, _))) => Some((0, 0)),
        _ => None,
    };
    Possible { values, may_be_null }
}

fn of_two(x: Possible, y: Possible, to: impl Fn(Range, Range) -> Range) -> Possible {
    let values = x.values.zip(y.values).map(|(x, y)| to(x, y));
    Possible { values, may_be_null: x.may_be_null || y.may_be_null }
}

fn of_arithmetic(op: Arithmetic, x: Possible, y: Possible) -> Possible {
    let divides = matches!(op, Arithmetic::Quotient | Arithmetic::Remainder);
    let by_zero = divides && y.values.is_some_and(|(low, high)| low <= 0 && high >= 0);
    let found = of_two(x, y, |x, y| arithmetic(op, x, y));
    Possible { may_be_null: found.may_be_null || by_zero, ..found }
}

fn of_case(branches: &[(NodeId, NodeId)], otherwise: Option<Possible>, of: impl Fn(NodeId) -> Possible) -> Possible {
    let mut found: Option<Possible> = None;
    let mut add = |possible: Possible| found = Some(found.map_or(possible, |found| found.or(possible)));
    let mut is_decided = false;
    for (when, then) in branches.iter().filter(|(when, _)| of(*when).can_be_true()) {
        add(of(*then));
        is_decided = of(*when).is_true();
        if is_decided {
            break;
        }
    }
    if !is_decided {
        add(otherwise.unwrap_or(Possible::NULL));
    }
    found.expect("a branch decides, or the last value is among them")
}

fn of_coalesce(values: impl Iterator<Item = Possible>) -> Possible {
    let mut found = Possible::NULL;
    for value in values {
        found = Possible { may_be_null: value.may_be_null, ..found.or(value) };
        if !value.may_be_null {
            break;
        }
    }
    found
}

fn of_aggregate(aggregate: Aggregate, x: Possible, steps: i128) -> Possible {
    match aggregate {
        Aggregate::First | Aggregate::Last if !x.can_be_true() => Possible::NULL,
        Aggregate::First | Aggregate::Last => Possible { values: Some((1, steps)), may_be_null: !x.is_true() },
        Aggregate::Any | Aggregate::All => Possible::truth(!x.is_true(), x.can_be_true()),
        Aggregate::Count => Possible::always((i128::from(x.is_true()), if x.can_be_true() { steps } else { 0 })),
        Aggregate::Min | Aggregate::Max => x,
        Aggregate::Sum => x.map(|(low, high)| (low.min(low * steps), high.max(high * steps))),
    }
}

//! Integers of a plan that may exceed 64 bits, by the ranges of their operands.
//!
//! The native engine checks every number. Other engines wrap silently, so the statement for them needs a check. Most
//! plans need none, since a count of steps or a sum of pixels cannot exceed 64 bits in any trace.

use crate::columns::Type;
use crate::plan::{Aggregate, Arithmetic, Constant, NodeId, Op, Plan};

/// The integers from the first to the second.
pub(crate) type Range = (i128, i128);

/// All integers of 64 bits.
pub(crate) const ALL: Range = (i64::MIN as i128, i64::MAX as i128);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Suspect {
    pub node: NodeId,
    /// True if it exceeds them in every trace, since it consists of constants.
    pub certain: bool,
}

/// The nodes among `needed` whose value may exceed 64 bits in traces of `rows` rows. `column` gives the smallest and
/// largest value of an integer column, if known.
pub fn may_overflow(
    plan: &Plan,
    needed: &[NodeId],
    rows: u64,
    column: impl Fn(&str) -> Option<(i64, i64)>,
) -> Vec<Suspect> {
    let mut ranges: Vec<Range> = vec![(0, 1); plan.nodes().len()];
    let mut constant = vec![false; plan.nodes().len()];
    let mut found = Vec::new();
    for &id in needed.iter().filter(|&&id| plan.node(id).ty == Type::Int) {
        let (low, high) = range(&plan.node(id).op, i128::from(rows.max(1)), &column, |id| ranges[id.index()]);
        constant[id.index()] = match &plan.node(id).op {
            Op::Constant(Constant::Int(_)) => true,
            op @ (Op::Spread(_) | Op::Negate(_) | Op::Arithmetic(..)) => {
                op.operands().iter().all(|operand| constant[operand.index()])
            }
            _ => false,
        };
        if low < ALL.0 || high > ALL.1 {
            let certain = constant[id.index()] && (low > ALL.1 || high < ALL.0);
            found.push(Suspect { node: id, certain });
        }
        ranges[id.index()] = (low.max(ALL.0), high.min(ALL.1));
    }
    found
}

fn range(op: &Op, rows: i128, column: impl Fn(&str) -> Option<(i64, i64)>, of: impl Fn(NodeId) -> Range) -> Range {
    match op {
        Op::Column(name) => column(name).map_or(ALL, |(low, high)| (low.into(), high.into())),
        Op::Constant(Constant::Int(value)) => ((*value).into(), (*value).into()),
        Op::Time | Op::Length | Op::Aggregate(Aggregate::First | Aggregate::Last, _) => (1, rows),
        Op::Aggregate(Aggregate::Count, _) => (0, rows),
        Op::Aggregate(Aggregate::Sum, x) => {
            let (low, high) = of(*x);
            (low.min(low * rows), high.max(high * rows))
        }
        Op::Aggregate(_, x) | Op::At(x, _) | Op::Spread(x) | Op::Lag(x) => of(*x),
        Op::Negate(x) => (-of(*x).1, -of(*x).0),
        Op::Arithmetic(op, x, y) => arithmetic(*op, of(*x), of(*y)),
        Op::Case { branches, otherwise } => hull(branches.iter().map(|(_, then)| *then).chain(*otherwise).map(of)),
        Op::Coalesce(values) => hull(values.iter().copied().map(of)),
        _ => (0, 1),
    }
}

pub(crate) fn arithmetic(op: Arithmetic, (a, b): Range, (c, d): Range) -> Range {
    match op {
        Arithmetic::Add => (a + c, b + d),
        Arithmetic::Subtract => (a - d, b - c),
        Arithmetic::Multiply => hull([a * c, a * d, b * c, b * d].map(|product| (product, product))),
        // Only the smallest integer divided by -1 exceeds 64 bits.
        Arithmetic::Quotient if c <= -1 && d >= -1 => (a.min(-b), b.max(-a)),
        Arithmetic::Quotient | Arithmetic::Remainder => (a.min(0), b.max(0)),
    }
}

pub(crate) fn hull(ranges: impl IntoIterator<Item = Range>) -> Range {
    ranges.into_iter().reduce(|(a, b), (c, d)| (a.min(c), b.max(d))).unwrap_or((0, 0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::columns::{Column, Columns, Level};
    use crate::definitions::Definitions;

    fn overflows(value: &str) -> bool {
        let columns = [("px", Type::Int), ("big", Type::Int)];
        let columns: Columns =
            columns.map(|(name, ty)| (name, Column { ty, level: Level::Step })).into_iter().collect();
        let text = format!("[metric.M]\nvalue = \"{value}\"");
        let plan = Definitions::from_toml("test", &text, &columns).unwrap().plan;
        let needed = plan.needed_by([plan.outputs[0].node]);
        let range = |name: &str| (name == "px").then_some((i32::MIN.into(), i32::MAX.into()));
        !may_overflow(&plan, &needed, 1_000_000, range).is_empty()
    }

    #[test]
    fn only_large_numbers_need_an_overflow_check() {
        for value in
            ["sum(px) - 1", "length() * 1000000", "max(px * px)", "min(-px)", "min(big % 0)", "min(div(big, 2))"]
        {
            assert!(!overflows(value), "{value}");
        }
        for value in
            ["sum(big)", "max(big + 1)", "min(-big)", "max(px * px * px)", "min(div(big, -1))", "min(div(big, px))"]
        {
            assert!(overflows(value), "{value}");
        }
    }
}

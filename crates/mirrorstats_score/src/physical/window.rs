//! The shape of a condition: windows of timesteps, comparisons with the episode's text, lookups.

use std::collections::BTreeSet;

use mirrorstats_metric::columns::{Level, Type};
use mirrorstats_metric::logical_plan::plan::{Comparison, NodeId, Op, Plan};

pub(super) fn beside_its_episode(plan: &Plan, op: &Op) -> Option<(NodeId, NodeId)> {
    let Op::Compare(Comparison::Equal | Comparison::NotEqual, x, y) = op else { return None };
    let pair = |column: NodeId, text: NodeId| match (&plan.node(column).op, &plan.node(text).op) {
        (Op::Column(_), Op::Spread(text)) if plan.node(column).ty == Type::Text => Some((column, *text)),
        _ => None,
    };
    pair(*x, *y).or_else(|| pair(*y, *x))
}

/// Splits the windows from a condition; returns the rest of the condition and the windows. `first`, `last`, `any` and
/// `count` search for the rest between the ends of the windows. A window with a null end is empty, which agrees with
/// how these aggregates treat null.
pub(super) fn split(plan: &Plan, condition: NodeId) -> (NodeId, Vec<(Comparison, NodeId)>) {
    let part =
        |id: NodeId| plan.window(&plan.node(id).op).filter(|(comparison, _)| *comparison != Comparison::NotEqual);
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

/// Returns true if a lookup of this value should look up its columns and compute from them, once per episode instead of
/// once per timestep. False if a skipped timestep could leave 64 bits.
pub(super) fn computes_after_lookup(plan: &Plan, value: NodeId) -> bool {
    let node = plan.node(value);
    let alone = matches!(node.op, Op::Column(_) | Op::Lag(_)) || node.level == Level::Episode;
    !alone && inner_nodes(plan, value).iter().all(|id| !matches!(plan.node(*id).op, Op::Arithmetic(..) | Op::Negate(_)))
}

fn inner_nodes(plan: &Plan, value: NodeId) -> BTreeSet<NodeId> {
    let (mut inner, mut open) = (BTreeSet::new(), vec![value]);
    while let Some(id) = open.pop() {
        if !is_leaf(plan, id) && inner.insert(id) {
            open.extend(plan.node(id).op.operands());
        }
    }
    inner
}

pub(super) fn is_leaf(plan: &Plan, id: NodeId) -> bool {
    let node = plan.node(id);
    node.level == Level::Episode || matches!(node.op, Op::Column(_) | Op::Constant(_) | Op::Lag(_))
}

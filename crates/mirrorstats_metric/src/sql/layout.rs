//! The layout of the computation: the pass and column of each node, and the expressions that are written only once.

use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

use super::Dialect;
use super::dialect::is_plain;
use super::one_pass::Windowed;
use crate::columns::{Level, Type};
use crate::logical_plan::plan::{Aggregate, NodeId, Op, Plan};
use mirrorstats_exact::budget::Limit;

/// The episode columns of every statement, in the order of the episode table, after `episode_id`.
pub(super) const KEYS: [&str; 4] = ["model", "experiment", "seed", "run"];

#[derive(Clone)]
pub(super) struct Layout<'p> {
    pub(super) plan: &'p Plan,
    pub(super) dialect: Dialect,
    pub(super) needed: Vec<NodeId>,
    /// The pass after which each is known; 0 if one step suffices.
    passes: BTreeMap<NodeId, usize>,
    lists: BTreeMap<NodeId, Windowed>,
    pub(super) shared: BTreeSet<NodeId>,
    pub(super) lag: Cell<usize>,
    written: Rc<Cell<usize>>,
}

/// The longest statement, counting each byte for about five nested nodes. A node is written out for each of its users,
/// so the text may double with every definition.
const MOST_WRITTEN: Limit = Limit::new("bytes written of a statement", 20 << 20);

impl<'p> Layout<'p> {
    pub(super) fn new(
        plan: &'p Plan,
        dialect: Dialect,
        roots: &[NodeId],
        windowed: &BTreeMap<NodeId, Windowed>,
    ) -> Self {
        let needed = plan.needed_by(roots.iter().copied());
        let lists = if dialect.functions().is_some() { lists(plan, &needed, windowed) } else { BTreeMap::new() };
        let conditions = lists.values().map(|list| list.condition);
        let needed = plan.needed_by(roots.iter().copied().chain(conditions));
        let mut layout = Self {
            plan,
            dialect,
            needed,
            passes: BTreeMap::new(),
            lists,
            shared: BTreeSet::new(),
            lag: Cell::new(0),
            written: Rc::default(),
        };
        for id in layout.needed.clone() {
            layout.passes.insert(id, layout.find_pass(id));
        }
        layout.shared = layout.find_shared();
        layout
    }

    fn find_pass(&self, id: NodeId) -> usize {
        let node = self.plan.node(id);
        let after = |nodes: &[NodeId]| nodes.iter().map(|node| self.passes[node]).max().unwrap_or(0);
        match &node.op {
            Op::Aggregate(..) if let Some(list) = self.lists.get(&id) => {
                list.windows.iter().map(|(_, moment)| self.passes[moment]).max().unwrap_or(1).max(1)
            }
            Op::At(..) if self.landmark(id).is_some() => 1,
            op @ (Op::Aggregate(..) | Op::At(..)) => after(&op.operands()) + 1,
            Op::Length => 1,
            Op::Column(_) if node.level == Level::Episode => 1,
            op => after(&op.operands()),
        }
    }

    fn find_shared(&self) -> BTreeSet<NodeId> {
        let mut users: BTreeMap<NodeId, usize> = BTreeMap::new();
        for id in &self.needed {
            self.plan.node(*id).op.operands().into_iter().for_each(|operand| *users.entry(operand).or_default() += 1);
        }
        let mut lagging = BTreeSet::new();
        for id in &self.needed {
            let op = &self.plan.node(*id).op;
            let looks_back = matches!(op, Op::Lag(_)) || op.operands().iter().any(|operand| lagging.contains(operand));
            if looks_back && self.plan.node(*id).level == Level::Step {
                lagging.insert(*id);
            }
        }
        let is_shared = |id: &NodeId| {
            let node = self.plan.node(*id);
            let simple = matches!(node.op, Op::Column(_) | Op::Time | Op::Constant(_) | Op::Spread(_));
            node.level == Level::Step
                && !simple
                // Earlier steps are joined to the table of steps.
                && !lagging.contains(id)
                && self.passes[id] == 0
                && users.get(id).is_some_and(|&count| count > 1)
        };
        self.needed.iter().copied().filter(is_shared).collect()
    }

    pub(super) fn is_shared(&self, id: NodeId) -> bool {
        self.lag.get() == 0 && self.shared.contains(&id)
    }

    /// A column of the steps `lag` before, under a name that no column of the traces has.
    pub(super) fn lag_column(&self, lag: usize, word: &str) -> String {
        self.free_name(format!("lag{lag}_{word}"))
    }

    /// Counts written bytes; `false` if there are too many.
    pub(super) fn spend(&self, bytes: usize) -> bool {
        self.written.set(self.written.get().saturating_add(bytes));
        self.is_within_budget()
    }

    pub(super) fn is_within_budget(&self) -> bool {
        MOST_WRITTEN.check(self.written.get() as u64).is_ok()
    }

    pub(super) fn without_shared(mut self) -> Self {
        self.shared.clear();
        self
    }

    /// The pass after which a node is known; 0 if one step suffices.
    pub(super) fn pass(&self, id: NodeId) -> usize {
        self.passes[&id]
    }

    pub(super) fn is_aggregate(&self, id: NodeId) -> bool {
        let node = self.plan.node(id);
        match &node.op {
            Op::Aggregate(..) => !self.lists.contains_key(&id),
            Op::At(..) | Op::Length => true,
            Op::Column(name) => node.level == Level::Episode && !KEYS.contains(&name.as_str()),
            _ => false,
        }
    }

    pub(super) fn list(&self, id: NodeId) -> Option<&Windowed> {
        self.lists.get(&id)
    }

    pub(super) fn listed(&self) -> BTreeSet<NodeId> {
        self.lists.values().map(|list| list.condition).collect()
    }

    pub(super) fn landmark(&self, id: NodeId) -> Option<(Aggregate, Option<NodeId>)> {
        let node = self.plan.node(id);
        let Op::At(x, moment) = node.op else { return None };
        let found = match self.plan.node(moment).op {
            Op::Aggregate(landmark @ (Aggregate::First | Aggregate::Last), condition) => (landmark, Some(condition)),
            Op::Length => (Aggregate::Last, None),
            _ => return None,
        };
        let at_once = self.passes[&x] == 0 && found.1.is_none_or(|condition| self.passes[&condition] == 0);
        (at_once && node.ty != Type::Bool && self.dialect.functions().is_some()).then_some(found)
    }

    pub(super) fn column(&self, letter: char, id: NodeId) -> String {
        let lets = self.plan.lets.iter().map(|(name, node)| (name, *node));
        let metrics = self.plan.outputs.iter().map(|output| (&output.name, output.node));
        let own = lets.chain(metrics).find(|(name, node)| *node == id && is_plain(name));
        own.map_or_else(|| format!("{letter}{}", id.index()), |(name, _)| format!("{name}_{}", id.index()))
    }

    pub(super) fn step_column(&self, id: NodeId) -> String {
        self.free_name(self.column('c', id))
    }

    fn free_name(&self, mut name: String) -> String {
        let columns = self.plan.columns(&self.needed);
        while columns.iter().any(|(column, _)| column.eq_ignore_ascii_case(&name)) {
            name.push('_');
        }
        name
    }
}

/// The searches to answer by lists: those that only values of episodes depend on. Other searches are read at each step,
/// so the list would be searched at each step too.
fn lists(plan: &Plan, needed: &[NodeId], windowed: &BTreeMap<NodeId, Windowed>) -> BTreeMap<NodeId, Windowed> {
    let read_at_steps = needed.iter().filter_map(|id| match &plan.node(*id).op {
        Op::Spread(x) if plan.node(*id).level == Level::Step => Some(*x),
        Op::At(_, moment) => Some(*moment),
        _ => None,
    });
    let read_at_steps: BTreeSet<NodeId> = plan.needed_by(read_at_steps).into_iter().collect();
    let answered = windowed.iter().filter(|(id, _)| needed.contains(id) && !read_at_steps.contains(id));
    answered.map(|(id, list)| (*id, list.clone())).collect()
}

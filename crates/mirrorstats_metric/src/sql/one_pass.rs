//! The same plan with fewer dependencies between landmarks, so that it needs fewer passes over the steps.
//!
//! A search in a window needs the landmark at its bound first, and so another pass. Most such searches follow from
//! landmarks of the first pass:
//!
//! | written | computed, with `f = first(p)` and `l = last(p)` |
//! |---|---|
//! | `first(p and t < b)` | `case when f < b then f end` |
//! | `any(p and t < b)` | `(f < b) is true` |
//! | `last(p and t > a)`, `any(p and t > a)` | likewise with `l` |
//! | `at(q, f)`, q a condition | true where `first(p and q) = f`, false where `first(p and not q) = f` |
//! | `at(x, case when c then f else l end)` | `case when c then at(x, f) else at(x, l) end` |
//! | `at(x, f) = c` | `at(x = c, f)` |
//!
//! Here p, q, x and c read one step or constants of the episode, and a and b are landmarks. A null bound makes both
//! sides null or false.

use std::collections::{BTreeMap, HashMap, HashSet};

use crate::columns::{Level, Type};
use crate::logical_plan::plan::{Aggregate, Builder, Comparison, Constant, Node, NodeId, Op, Plan};

/// A search among the steps where a condition holds, between moments of the episode.
#[derive(Clone, Debug)]
pub(super) struct Windowed {
    pub(super) condition: NodeId,
    pub(super) windows: Vec<(Comparison, NodeId)>,
}

/// The plan, and the searches that a list of timesteps can answer.
pub(super) struct OnePass {
    pub(super) plan: Plan,
    pub(super) windowed: BTreeMap<NodeId, Windowed>,
}

impl OnePass {
    pub(super) fn of(plan: &Plan) -> Self {
        let mut rewriter = Rewriter {
            plan,
            builder: Builder::default(),
            new: Vec::new(),
            local: Vec::new(),
            per_step: HashMap::new(),
            within: HashMap::new(),
            windowed: BTreeMap::new(),
            looked_up: HashMap::new(),
        };
        for node in plan.nodes() {
            let new = rewriter.node(node);
            rewriter.new.push(new);
        }
        let Rewriter { builder, new, windowed, .. } = rewriter;
        let mut rewritten = builder.finish();
        let to = |id: NodeId| new[id.index()];
        rewritten.outputs.clone_from(&plan.outputs);
        rewritten.outputs.iter_mut().for_each(|output| output.node = to(output.node));
        rewritten.lets = plan.lets.iter().map(|(name, id)| (name.clone(), to(*id))).collect();
        rewritten.filter = plan.filter.map(to);
        Self { plan: rewritten, windowed }
    }
}

struct Rewriter<'p> {
    plan: &'p Plan,
    builder: Builder,
    new: Vec<NodeId>,
    local: Vec<bool>,
    per_step: HashMap<NodeId, NodeId>,
    within: HashMap<NodeId, NodeId>,
    windowed: BTreeMap<NodeId, Windowed>,
    looked_up: HashMap<(NodeId, NodeId), NodeId>,
}

impl Rewriter<'_> {
    fn node(&mut self, node: &Node) -> NodeId {
        let op = node.op.map(|operand| self.new[operand.index()]);
        match (&node.op, op) {
            (_, Op::Spread(x)) if node.level == Level::Step => self.spread(x, node.ty),
            (_, Op::Aggregate(aggregate, x)) => self.aggregate(aggregate, x, node.ty),
            (_, Op::At(x, moment)) => self.at(x, moment, node.ty),
            (_, Op::Coalesce(values)) => self.coalesce(values, node),
            (_, Op::IsNull(x)) if let Some(within) = self.within.get(&x) => {
                let found = self.add(Op::IsTrue(*within), Type::Bool, Level::Episode);
                self.add(Op::Not(found), Type::Bool, Level::Episode)
            }
            (_, Op::Not(x)) if let Op::Not(x) = self.op(x) => *x,
            (Op::Compare(comparison, x, y), op) if node.level == Level::Episode => {
                self.compare(*comparison, (*x, *y), op)
            }
            (_, op) => self.add(op, node.ty, node.level),
        }
    }

    fn add(&mut self, op: Op, ty: Type, level: Level) -> NodeId {
        let across_steps = matches!(op, Op::Aggregate(..) | Op::At(..) | Op::Length);
        let local = !across_steps && op.operands().iter().all(|operand| self.local[operand.index()]);
        let id = self.builder.add(op, ty, level);
        if id.index() == self.local.len() {
            self.local.push(local);
        }
        id
    }

    fn is_local(&self, id: NodeId) -> bool {
        self.local[id.index()]
    }

    fn op(&self, id: NodeId) -> &Op {
        &self.builder.node(id).op
    }

    fn truth(&mut self, value: bool) -> NodeId {
        self.add(Op::Constant(Constant::Bool(value)), Type::Bool, Level::Constant)
    }

    fn both(&mut self, x: NodeId, y: NodeId, level: Level) -> NodeId {
        match self.op(x) {
            Op::Constant(Constant::Bool(true)) => y,
            _ => self.add(Op::And(x, y), Type::Bool, level),
        }
    }

    fn spread(&mut self, x: NodeId, ty: Type) -> NodeId {
        if self.is_local(x) { self.read_at_step(x) } else { self.add(Op::Spread(x), ty, Level::Step) }
    }

    fn read_at_step(&mut self, id: NodeId) -> NodeId {
        let Node { op, ty, level } = self.builder.node(id).clone();
        if level != Level::Episode {
            return id;
        }
        if let Some(known) = self.per_step.get(&id) {
            return *known;
        }
        let new = match op {
            Op::Spread(constant) => constant,
            op => {
                let op = op.map(|operand| self.read_at_step(operand));
                self.add(op, ty, Level::Step)
            }
        };
        self.per_step.insert(id, new);
        new
    }

    fn aggregate(&mut self, aggregate: Aggregate, x: NodeId, ty: Type) -> NodeId {
        match self.split(x).filter(|_| aggregate.searches()) {
            Some(windowed) => self.search(aggregate, x, ty, windowed),
            None => self.add(Op::Aggregate(aggregate, x), ty, Level::Episode),
        }
    }

    /// Splits a condition into one on single steps and windows; `None` without windows, or with other parts.
    fn split(&mut self, condition: NodeId) -> Option<Windowed> {
        let (mut open, mut windows, mut own) = (vec![condition], Vec::new(), self.truth(true));
        let mut seen = HashSet::new();
        while let Some(part) = open.pop() {
            // A repeated part adds no information.
            if !seen.insert(part) {
                continue;
            }
            match self.op(part) {
                _ if self.is_local(part) => own = self.both(own, part, Level::Step),
                Op::And(x, y) => open.extend([*y, *x]),
                op => windows.push(self.builder.plan().window(op)?),
            }
        }
        (!windows.is_empty()).then_some(Windowed { condition: own, windows })
    }

    fn search(&mut self, aggregate: Aggregate, x: NodeId, ty: Type, windowed: Windowed) -> NodeId {
        let all = |of: [Comparison; 2]| windowed.windows.iter().all(|(comparison, _)| of.contains(comparison));
        let landmark = match aggregate {
            Aggregate::First | Aggregate::Any if all([Comparison::Less, Comparison::LessEqual]) => Aggregate::First,
            Aggregate::Last | Aggregate::Any if all([Comparison::Greater, Comparison::GreaterEqual]) => Aggregate::Last,
            _ => {
                let id = self.add(Op::Aggregate(aggregate, x), ty, Level::Episode);
                self.windowed.insert(id, windowed);
                return id;
            }
        };
        let found = self.add(Op::Aggregate(landmark, windowed.condition), Type::Int, Level::Episode);
        let mut within = self.truth(true);
        for (comparison, moment) in windowed.windows {
            let holds = self.add(Op::Compare(comparison, found, moment), Type::Bool, Level::Episode);
            within = self.both(within, holds, Level::Episode);
        }
        if aggregate == Aggregate::Any {
            return self.add(Op::IsTrue(within), Type::Bool, Level::Episode);
        }
        let case = Op::Case { branches: vec![(within, found)], otherwise: None };
        let id = self.add(case, ty, Level::Episode);
        self.within.insert(id, within);
        id
    }

    fn at(&mut self, x: NodeId, moment: NodeId, ty: Type) -> NodeId {
        if let Some(known) = self.looked_up.get(&(x, moment)) {
            return *known;
        }
        let id = self.at_anew(x, moment, ty);
        self.looked_up.insert((x, moment), id);
        id
    }

    fn at_anew(&mut self, x: NodeId, moment: NodeId, ty: Type) -> NodeId {
        let op = match self.op(moment).clone() {
            _ if !self.is_local(x) => Op::At(x, moment),
            Op::Case { branches, otherwise } => Op::Case {
                branches: branches.into_iter().map(|(when, then)| (when, self.at(x, then, ty))).collect(),
                otherwise: otherwise.map(|moment| self.at(x, moment, ty)),
            },
            Op::Coalesce(moments) => {
                let branches = moments.into_iter().map(|moment| {
                    let is_null = self.add(Op::IsNull(moment), Type::Bool, Level::Episode);
                    let is_known = self.add(Op::Not(is_null), Type::Bool, Level::Episode);
                    (is_known, self.at(x, moment, ty))
                });
                Op::Case { branches: branches.collect(), otherwise: None }
            }
            Op::Aggregate(landmark @ (Aggregate::First | Aggregate::Last), condition)
                if ty == Type::Bool && self.is_local(condition) =>
            {
                self.condition_at(x, landmark, condition, moment)
            }
            Op::Length if ty == Type::Bool => {
                let always = self.truth(true);
                self.condition_at(x, Aggregate::Last, always, moment)
            }
            _ => Op::At(x, moment),
        };
        self.add(op, ty, Level::Episode)
    }

    fn condition_at(&mut self, x: NodeId, landmark: Aggregate, condition: NodeId, moment: NodeId) -> Op {
        let fails = self.add(Op::Not(x), Type::Bool, Level::Step);
        let branches = [(x, true), (fails, false)].map(|(x, value)| {
            let both = self.both(condition, x, Level::Step);
            let found = self.add(Op::Aggregate(landmark, both), Type::Int, Level::Episode);
            let there = self.add(Op::Compare(Comparison::Equal, found, moment), Type::Bool, Level::Episode);
            (there, self.truth(value))
        });
        Op::Case { branches: branches.into(), otherwise: None }
    }

    /// Rewrites `coalesce(condition at a landmark, false)`, which needs only one of the two searches.
    fn coalesce(&mut self, values: Vec<NodeId>, node: &Node) -> NodeId {
        if let [value, otherwise] = values[..]
            && self.op(otherwise) == &Op::Constant(Constant::Bool(false))
            && let Op::Case { branches, otherwise: None } = self.op(value)
            && let [(holds, then), (_, no)] = branches[..]
            && (self.op(then), self.op(no))
                == (&Op::Constant(Constant::Bool(true)), &Op::Constant(Constant::Bool(false)))
        {
            return self.add(Op::IsTrue(holds), Type::Bool, node.level);
        }
        self.add(Op::Coalesce(values), node.ty, node.level)
    }

    /// A comparison per episode of two old nodes; `op` is the same comparison of new nodes.
    fn compare(&mut self, comparison: Comparison, (x, y): (NodeId, NodeId), op: Op) -> NodeId {
        for (looked_up, other, comparison) in [(x, y, comparison), (y, x, comparison.flipped())] {
            let other = self.new[other.index()];
            if let Op::At(value, moment) = &self.plan.node(looked_up).op
                && self.is_local(other)
            {
                let (value, moment) = (self.new[value.index()], self.new[moment.index()]);
                let other = self.read_at_step(other);
                let compared = self.add(Op::Compare(comparison, value, other), Type::Bool, Level::Step);
                return self.at(compared, moment, Type::Bool);
            }
        }
        if let Op::Compare(Comparison::Equal, x, y) = op
            && let (Op::IntFromBool(truth), Op::Constant(Constant::Int(1))) = (self.op(x), self.op(y))
        {
            return *truth;
        }
        self.add(op, Type::Bool, Level::Episode)
    }
}

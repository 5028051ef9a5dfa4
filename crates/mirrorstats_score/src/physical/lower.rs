//! From the logical plan to steps.

use std::collections::HashMap;

use super::window::{beside_its_episode, computes_after_lookup, is_leaf, split};
use super::{Kernel, PhysicalPlan, Shape, StepId};
use mirrorstats_metric::columns::{Level, Type};
use mirrorstats_metric::logical_plan::plan::{Aggregate, Arithmetic, Comparison, Constant, NodeId, Op, Plan};

pub(super) struct Lowering<'a> {
    physical: &'a mut PhysicalPlan,
    plan: &'a Plan,
    known: HashMap<(NodeId, Option<StepId>), StepId>,
    metrics: HashMap<NodeId, &'a str>,
}

impl<'a> Lowering<'a> {
    pub(super) fn new(physical: &'a mut PhysicalPlan, plan: &'a Plan) -> Self {
        let mut metrics = HashMap::new();
        for output in &plan.outputs {
            for node in plan.needed_by([output.node]) {
                metrics.entry(node).or_insert(output.name.as_str());
            }
        }
        Self { physical, plan, known: HashMap::new(), metrics }
    }

    pub(super) fn values(&mut self, id: NodeId) -> StepId {
        self.plain(id, None)
    }

    /// Lowers a node at its own level, per timestep or per episode. With `at`, gives its value at the moments of that
    /// step, per episode.
    fn node(&mut self, id: NodeId, at: Option<StepId>) -> StepId {
        if let Some(known) = self.known.get(&(id, at)) {
            return *known;
        }
        let step = match at {
            Some(moments) if is_leaf(self.plan, id) => self.leaf_at(id, moments),
            _ => self.operation(id, at),
        };
        self.known.insert((id, at), step);
        step
    }

    fn leaf_at(&mut self, id: NodeId, moments: StepId) -> StepId {
        let values = self.node(id, None);
        match self.physical.step(values).shape {
            Shape::Timesteps => self.at(values, moments),
            Shape::One | Shape::Episodes => values,
        }
    }

    fn at(&mut self, values: StepId, moments: StepId) -> StepId {
        let ty = self.physical.step(values).ty;
        self.physical.push(Kernel::Op(Op::At(values, moments)), ty, Shape::Episodes)
    }

    fn operation(&mut self, id: NodeId, at: Option<StepId>) -> StepId {
        let plan = self.plan;
        let node = plan.node(id);
        let shape = match node.level {
            Level::Constant => Shape::One,
            Level::Episode => Shape::Episodes,
            Level::Step if at.is_some() => Shape::Episodes,
            Level::Step => Shape::Timesteps,
        };
        let kernel = match (&node.op, at) {
            (Op::Time, Some(moments)) => return moments,
            (Op::Spread(x), _) => return self.spread(*x, shape, at),
            (Op::Compare(comparison, x, y), _) => self.compare(&node.op, *comparison, (*x, *y), at),
            (Op::Aggregate(aggregate, x), _) => self.aggregate(*aggregate, *x),
            (Op::At(x, moment), _) => return self.lookup(*x, *moment),
            (Op::Case { branches, otherwise }, _) => self.case(branches, *otherwise, node.ty, shape, at),
            (op, _) => Kernel::Op(self.with_steps(op, shape, at)),
        };
        let step = self.physical.push(kernel, node.ty, shape);
        if let Some(metric) = self.metrics.get(&id) {
            self.physical.metrics.entry(step).or_insert_with(|| (*metric).to_owned());
        }
        step
    }

    /// The same operation of steps, with operands in the form that its kernel takes.
    fn with_steps(&mut self, op: &Op, shape: Shape, at: Option<StepId>) -> Op<StepId> {
        match op {
            Op::Lag(_) => op.map(|x| self.full(x, Shape::Timesteps, None)),
            Op::And(..)
            | Op::Or(..)
            | Op::Coalesce(_)
            | Op::Arithmetic(Arithmetic::Quotient | Arithmetic::Remainder, ..) => op.map(|x| self.full(x, shape, at)),
            Op::Distinct(..) => op.map(|x| self.plain(x, at)),
            _ => op.map(|x| self.node(x, at)),
        }
    }

    fn plain(&mut self, id: NodeId, at: Option<StepId>) -> StepId {
        let step = self.node(id, at);
        if !self.gives_keys(step) {
            return step;
        }
        let shape = self.physical.step(step).shape;
        self.physical.push(Kernel::Symbols(step), Type::Text, shape)
    }

    fn full(&mut self, id: NodeId, shape: Shape, at: Option<StepId>) -> StepId {
        let step = self.plain(id, at);
        let (ty, from) = (self.physical.step(step).ty, self.physical.step(step).shape);
        if from == Shape::One { self.physical.push(Kernel::Op(Op::Spread(step)), ty, shape) } else { step }
    }

    fn gives_keys(&self, step: StepId) -> bool {
        let step = self.physical.step(step);
        step.ty == Type::Text && matches!(step.kernel, Kernel::Op(Op::Column(_)))
    }

    fn spread(&mut self, x: NodeId, shape: Shape, at: Option<StepId>) -> StepId {
        let values = self.plain(x, at);
        let (ty, from) = (self.physical.step(values).ty, self.physical.step(values).shape);
        if from == shape { values } else { self.physical.push(Kernel::Op(Op::Spread(values)), ty, shape) }
    }

    fn compare(&mut self, op: &Op, comparison: Comparison, (x, y): (NodeId, NodeId), at: Option<StepId>) -> Kernel {
        let plan = self.plan;
        if at.is_none() {
            if let Some((comparison, moment)) = plan.window(op) {
                return Kernel::Window(comparison, self.full(moment, Shape::Episodes, None));
            }
            if let Some((column, text)) = beside_its_episode(plan, op) {
                let (keys, text) = (self.node(column, None), self.full(text, Shape::Episodes, None));
                return Kernel::KeysEqual { keys, text, equal: comparison == Comparison::Equal };
            }
        }
        if plan.node(x).ty == Type::Text {
            self.compare_texts(comparison, x, y, at)
        } else {
            Kernel::Op(Op::Compare(comparison, self.node(x, at), self.node(y, at)))
        }
    }

    fn compare_texts(&mut self, comparison: Comparison, x: NodeId, y: NodeId, at: Option<StepId>) -> Kernel {
        if !matches!(comparison, Comparison::Equal | Comparison::NotEqual) {
            return Kernel::CompareTexts(comparison, self.plain(x, at), self.plain(y, at));
        }
        let equal = comparison == Comparison::Equal;
        let (left, right) = (self.node(x, at), self.node(y, at));
        let is_constant = |step: StepId| self.physical.step(step).shape == Shape::One;
        match (self.gives_keys(left), self.gives_keys(right)) {
            (true, _) if is_constant(right) => Kernel::KeysEqual { keys: left, text: right, equal },
            (_, true) if is_constant(left) => Kernel::KeysEqual { keys: right, text: left, equal },
            _ => Kernel::Op(Op::Compare(comparison, self.plain(x, at), self.plain(y, at))),
        }
    }

    fn case(
        &mut self,
        branches: &[(NodeId, NodeId)],
        otherwise: Option<NodeId>,
        ty: Type,
        shape: Shape,
        at: Option<StepId>,
    ) -> Kernel {
        let branches =
            branches.iter().map(|(when, then)| (self.full(*when, shape, at), self.plain(*then, at))).collect();
        let otherwise = if let Some(id) = otherwise {
            self.full(id, shape, at)
        } else {
            let null = self.physical.push(Kernel::Op(Op::Constant(Constant::Null)), ty, Shape::One);
            self.physical.push(Kernel::Op(Op::Spread(null)), ty, shape)
        };
        Kernel::Op(Op::Case { branches, otherwise: Some(otherwise) })
    }

    fn aggregate(&mut self, aggregate: Aggregate, x: NodeId) -> Kernel {
        if !aggregate.searches() {
            return Kernel::Op(Op::Aggregate(aggregate, self.full(x, Shape::Timesteps, None)));
        }
        let (rest, windows) = split(self.plan, x);
        let windows: Vec<_> = windows
            .into_iter()
            .map(|(comparison, moment)| (comparison, self.full(moment, Shape::Episodes, None)))
            .collect();
        let condition = self.full(rest, Shape::Timesteps, None);
        let within = (!windows.is_empty()).then(|| {
            // Rows, not values: the type is irrelevant.
            self.physical.push(Kernel::Within(windows), Type::Int, Shape::Episodes)
        });
        Kernel::Search { aggregate, condition, within }
    }

    fn lookup(&mut self, x: NodeId, moment: NodeId) -> StepId {
        let moments = self.full(moment, Shape::Episodes, None);
        if !computes_after_lookup(self.plan, x) {
            let values = self.node(x, None);
            return self.at(values, moments);
        }
        let values = self.full(x, Shape::Episodes, Some(moments));
        // A missing timestep gives null, even if the expression replaces nulls.
        let ty = self.physical.step(values).ty;
        self.physical.push(Kernel::NullWhereAbsent { values, moments }, ty, Shape::Episodes)
    }
}

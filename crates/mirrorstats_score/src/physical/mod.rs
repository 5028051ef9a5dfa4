//! The physical plan: the kernels, their operands and their order.
//!
//! The logical plan ([`mirrorstats_metric::logical_plan::plan::Plan`]) gives the meaning of the definitions. This plan fixes every choice before
//! the first batch: which conditions are windows of timesteps, which lookups compute from the looked-up values, where a
//! constant is materialised, and which texts are compared as keys. Equal steps are one step, also across logical plans.
//! Evaluation ([`super::kernels::evaluate`]) runs the steps in order and decides nothing.

mod lower;
mod window;
mod work;

use std::collections::HashMap;

use regex::Regex;

use mirrorstats_metric::catalogs::catalog::Kind;
use mirrorstats_metric::columns::Type;
use mirrorstats_metric::logical_plan::plan::{Aggregate, Comparison, NodeId, Op, Plan};

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct StepId(pub(super) usize);

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Shape {
    One,
    Episodes,
    Timesteps,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Step {
    pub kernel: Kernel,
    pub ty: Type,
    pub shape: Shape,
}

/// The kernels. By default a null operand gives null, and operands have the shape of the result or [`Shape::One`].
/// Texts are symbols (integers that represent texts), except where a kernel takes keys.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Kernel {
    /// The operation of the logical plan, on vectors. A text column gives keys into its dictionary; `IsNull`, `Matches`
    /// and `At` take keys too. `Compare` of symbols is for equality only. No operand of `And`, `Or`, a division,
    /// `Coalesce` and `Lag` is a constant, nor is a condition or the last value of `Case`, which always has one.
    Op(Op<StepId>),
    /// The symbols of keys.
    Symbols(StepId),
    /// A comparison of symbols by the order of their texts.
    CompareTexts(Comparison, StepId, StepId),
    /// True where keys refer to a constant text or to the text of their episode, or where they do not.
    KeysEqual { keys: StepId, text: StepId, equal: bool },
    /// True where the timestep satisfies the comparison with a moment of its episode; timesteps are not materialised.
    Window(Comparison, StepId),
    /// The rows of each episode that are in all these windows, which compare the timestep with moments; empty if a
    /// moment is null. Gives ranges of rows, not values.
    Within(Vec<(Comparison, StepId)>),
    /// `first`, `last`, `any` or `count` of a condition, over all rows or over the rows of a `Within`.
    Search { aggregate: Aggregate, condition: StepId, within: Option<StepId> },
    /// Values per episode, null where the episode has no such timestep.
    NullWhereAbsent { values: StepId, moments: StepId },
}

impl Kernel {
    pub fn operands(&self) -> Vec<StepId> {
        match self {
            Self::Op(op) => op.operands(),
            Self::Symbols(x) | Self::Window(_, x) => vec![*x],
            Self::CompareTexts(_, x, y)
            | Self::KeysEqual { keys: x, text: y, .. }
            | Self::NullWhereAbsent { values: x, moments: y } => vec![*x, *y],
            Self::Within(windows) => windows.iter().map(|(_, moments)| *moments).collect(),
            Self::Search { condition, within, .. } => std::iter::once(*condition).chain(*within).collect(),
        }
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Metric {
    pub name: String,
    pub kind: Kind,
    pub step: StepId,
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Scores {
    pub metrics: Vec<Metric>,
    /// The filter, one truth value per episode; all episodes count if absent.
    pub filter: Option<StepId>,
}

#[derive(Clone, Debug, Default)]
pub struct PhysicalPlan {
    pub(crate) steps: Vec<Step>,
    known: HashMap<Step, StepId>,
    pub(crate) patterns: HashMap<StepId, Regex>,
    /// The metric that is reported for an error of a step.
    pub(crate) metrics: HashMap<StepId, String>,
    /// The outputs of each set of definitions, in the order in which they were added.
    pub scores: Vec<Scores>,
}

impl PhysicalPlan {
    /// The metrics and filters of some definitions, in order, in one plan.
    pub fn of(plans: &[&Plan]) -> Self {
        let mut physical = Self::default();
        for plan in plans {
            let mut lowering = lower::Lowering::new(&mut physical, plan);
            let metrics = plan.outputs.iter().map(|output| Metric {
                name: output.name.clone(),
                kind: output.kind,
                step: lowering.values(output.node),
            });
            let metrics = metrics.collect();
            let filter = plan.filter.map(|node| lowering.values(node));
            physical.scores.push(Scores { metrics, filter });
        }
        physical
    }

    /// Adds nodes of some definitions, each in its own shape; returns their steps.
    pub(crate) fn add_nodes(&mut self, plan: &Plan, nodes: impl IntoIterator<Item = NodeId>) -> Vec<StepId> {
        let mut lowering = lower::Lowering::new(self, plan);
        nodes.into_iter().map(|node| lowering.values(node)).collect()
    }

    pub fn step(&self, id: StepId) -> &Step {
        &self.steps[id.0]
    }

    /// The columns per timestep and the columns per episode that a batch must have.
    pub fn columns(&self) -> (Vec<String>, Vec<String>) {
        let (mut timesteps, mut episodes) = (Vec::new(), Vec::new());
        for step in &self.steps {
            if let Kernel::Op(Op::Column(name)) = &step.kernel {
                let columns = if step.shape == Shape::Timesteps { &mut timesteps } else { &mut episodes };
                columns.push(name.clone());
            }
        }
        (timesteps, episodes)
    }

    fn push(&mut self, kernel: Kernel, ty: Type, shape: Shape) -> StepId {
        let step = Step { kernel, ty, shape };
        if let Some(known) = self.known.get(&step) {
            return *known;
        }
        let id = StepId(self.steps.len());
        if let Kernel::Op(Op::Matches(_, pattern)) = &step.kernel {
            let pattern = Regex::new(pattern).expect("the binder has compiled this pattern");
            self.patterns.insert(id, pattern);
        }
        self.known.insert(step.clone(), id);
        self.steps.push(step);
        id
    }
}

#[cfg(test)]
mod tests {
    use super::PhysicalPlan;
    use crate::vocabulary::schema_columns;
    use mirrorstats_metric::definitions::Definitions;

    fn paper() -> Definitions {
        Definitions::load("paper", &schema_columns()).unwrap()
    }

    fn printed(plan: &PhysicalPlan) -> String {
        let steps = plan.steps.iter().enumerate();
        let steps = steps.map(|(at, step)| format!("%{at} {:?} {:?} {:?}\n", step.ty, step.shape, step.kernel));
        steps.chain(plan.scores.iter().map(|scores| format!("{scores:?}\n"))).collect()
    }

    #[test]
    fn the_plan_of_the_paper_matches_its_snapshot() {
        insta::assert_snapshot!(printed(&PhysicalPlan::of(&[&paper().plan])));
    }

    #[test]
    fn definitions_share_the_steps_that_they_have_in_common() {
        let paper = paper();
        let filtered = paper.clone().filtered("--where", "seed = 1", &schema_columns()).unwrap();
        let alone = PhysicalPlan::of(&[&paper.plan]);
        let both = PhysicalPlan::of(&[&paper.plan, &filtered.plan]);
        // The column and the comparison; the paper's definitions already have the constant 1.
        assert_eq!(both.steps.len(), alone.steps.len() + 2);
        assert_eq!(both.scores[0], alone.scores[0]);
        assert_eq!(both.scores[1].metrics, alone.scores[0].metrics);
        assert!(both.scores[1].filter.is_some());
    }

    #[test]
    fn every_choice_is_in_the_plan() {
        let text = r#"
        [metric.M]
        value = "count(mirror_visible and t < 3 and action <> 'done')"
        [metric.N]
        value = "coalesce(at(regexp_like(self_color, '^b') or selected_cube < body_color, M), false)"
        "#;
        let definitions = Definitions::from_toml("test", text, &schema_columns()).unwrap();
        insta::assert_snapshot!(printed(&PhysicalPlan::of(&[&definitions.plan])));
        let nodes = definitions.plan.nodes().iter().enumerate();
        let nodes = nodes.map(|(at, node)| format!("#{at} {:?} {:?} {:?}\n", node.ty, node.level, node.op));
        insta::assert_snapshot!("logical", nodes.collect::<String>());
    }
}

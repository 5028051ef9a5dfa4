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
use mirrorstats_metric::logical_plan::plan::{Aggregate, Arithmetic, Comparison, Constant, NodeId, Plan};

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

/// The kernels. One that is named like an operation of [`mirrorstats_metric::logical_plan::plan::Op`] computes the same. By default a null operand
/// gives null, and operands have the shape of the result or [`Shape::One`]. No operand of `And`, `Or`, `Divide`,
/// `Coalesce` and `Lag` is a constant. Texts are symbols (integers that represent texts), except where a kernel takes
/// keys.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Kernel {
    /// A column of the batch; a text column gives keys into its dictionary.
    Column(String),
    Constant(Constant),
    Times,
    Lengths,
    Repeat(StepId),
    Spread(StepId),
    Symbols(StepId),
    Not(StepId),
    And(StepId, StepId),
    Or(StepId, StepId),
    /// A comparison by value; of symbols, for equality only.
    Compare(Comparison, StepId, StepId),
    /// A comparison of symbols by the order of their texts.
    CompareTexts(Comparison, StepId, StepId),
    /// True where keys refer to a constant text, or where they do not.
    KeysEqualText {
        keys: StepId,
        text: StepId,
        equal: bool,
    },
    /// True where the keys of a timestep refer to the text of their episode, or where they do not.
    KeysEqualEpisode {
        keys: StepId,
        texts: StepId,
        equal: bool,
    },
    /// True where the timestep satisfies the comparison with a moment of its episode; timesteps are not materialised.
    Window(Comparison, StepId),
    Distinct(StepId, StepId),
    /// Takes keys.
    IsNull(StepId),
    IsTrue(StepId),
    IsFalse(StepId),
    Arithmetic(Arithmetic, StepId, StepId),
    /// Quotient or remainder of two integers, null where the divisor is 0.
    Divide(Arithmetic, StepId, StepId),
    Negate(StepId),
    /// Values of branches may be constants.
    Case {
        branches: Vec<(StepId, StepId)>,
        otherwise: StepId,
    },
    Coalesce(Vec<StepId>),
    KeysMatch(StepId, String),
    SymbolsMatch(StepId, String),
    IntFromBool(StepId),
    FloatFromInt(StepId),
    Scale(StepId, u8),
    /// The rows of each episode that are in all these windows, which compare the timestep with moments; empty if a
    /// moment is null. Gives ranges of rows, not values.
    Within(Vec<(Comparison, StepId)>),
    /// `first`, `last`, `any` or `count` of a condition, over all rows or over the rows of a `Within`.
    Search {
        aggregate: Aggregate,
        condition: StepId,
        within: Option<StepId>,
    },
    /// `all`, `min`, `max` or `sum` of a value per timestep.
    Fold(Aggregate, StepId),
    /// Takes values or keys.
    At {
        values: StepId,
        moments: StepId,
    },
    /// Takes values.
    Lag(StepId),
    /// Values per episode, null where the episode has no such timestep.
    NullWhereAbsent {
        values: StepId,
        moments: StepId,
    },
}

impl Kernel {
    pub fn operands(&self) -> Vec<StepId> {
        match self {
            Self::Column(_) | Self::Constant(_) | Self::Times | Self::Lengths => vec![],
            Self::Repeat(x)
            | Self::Spread(x)
            | Self::Symbols(x)
            | Self::Not(x)
            | Self::Window(_, x)
            | Self::IsNull(x)
            | Self::IsTrue(x)
            | Self::IsFalse(x)
            | Self::Negate(x)
            | Self::KeysMatch(x, _)
            | Self::SymbolsMatch(x, _)
            | Self::IntFromBool(x)
            | Self::FloatFromInt(x)
            | Self::Scale(x, _)
            | Self::Fold(_, x)
            | Self::Lag(x) => vec![*x],
            Self::And(x, y)
            | Self::Or(x, y)
            | Self::Compare(_, x, y)
            | Self::CompareTexts(_, x, y)
            | Self::KeysEqualText { keys: x, text: y, .. }
            | Self::KeysEqualEpisode { keys: x, texts: y, .. }
            | Self::Distinct(x, y)
            | Self::Arithmetic(_, x, y)
            | Self::Divide(_, x, y)
            | Self::At { values: x, moments: y }
            | Self::NullWhereAbsent { values: x, moments: y } => vec![*x, *y],
            Self::Case { branches, otherwise } => {
                branches.iter().flat_map(|(when, then)| [*when, *then]).chain([*otherwise]).collect()
            }
            Self::Coalesce(values) => values.clone(),
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
            if let Kernel::Column(name) = &step.kernel {
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
        if let Kernel::KeysMatch(_, pattern) | Kernel::SymbolsMatch(_, pattern) = &step.kernel {
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

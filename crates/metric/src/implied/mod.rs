//! Facts about metric values that follow from the definitions alone.
//!
//! Rule: these facts hold in all traces. The checked plan, never a name, gives them: where a metric is defined, which
//! metric it restricts to those episodes, and its range of integers. Facts that the plan does not give stay open.

mod possible;

use indexmap::IndexMap;

use self::possible::{Possible, Traces};
use super::catalog::Kind;
use super::plan::{Comparison, Constant, NodeId, Op, Output, Plan};

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Implied {
    /// The smallest and the largest value, if the metric is defined.
    pub range: (i64, i64),
    pub defined: Defined,
    pub restricts: Option<Restricted>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Defined {
    Always,
    Where {
        metric: String,
        is: bool,
    },
    /// Some, by a rule that is not another metric.
    Sometimes,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Restricted {
    pub metric: String,
    /// Its only possible value in the other episodes, if there is only one.
    pub elsewhere: Option<i64>,
}

/// The known facts about each metric of a plan, in episodes of 1 to `steps` steps. `has_value` returns true if a column
/// has a value in every row of every trace.
pub fn implied(plan: &Plan, steps: u32, has_value: fn(&str) -> bool) -> IndexMap<String, Implied> {
    let reader = OutputReader { plan, traces: Traces { plan, steps, has_value } };
    plan.outputs.iter().map(|output| (output.name.clone(), reader.read(output))).collect()
}

struct OutputReader<'p> {
    plan: &'p Plan,
    traces: Traces<'p>,
}

impl OutputReader<'_> {
    fn read(&self, output: &Output) -> Implied {
        let range = self.possible(output.node).range();
        let always = if self.possible(output.node).may_be_null { Defined::Sometimes } else { Defined::Always };
        let Some((when, value)) = self.conditional(output.node) else {
            return Implied { range, defined: always, restricts: None };
        };
        if self.possible(value).may_be_null {
            return Implied { range, defined: Defined::Sometimes, restricts: None };
        }
        let defined = self.rate_asked(when).map_or(Defined::Sometimes, |(metric, is)| Defined::Where { metric, is });
        let restricts = self.metric_of(value).map(|metric| Restricted { metric, elsewhere: self.outside(when, value) });
        Implied { range, defined, restricts }
    }

    fn possible(&self, node: NodeId) -> Possible {
        self.traces.of_node(node, &[])
    }

    /// The condition and the value of a metric with `when`.
    fn conditional(&self, node: NodeId) -> Option<(NodeId, NodeId)> {
        match &self.plan.node(node).op {
            Op::Case { branches, otherwise: None } => match branches[..] {
                [branch] => Some(branch),
                _ => None,
            },
            _ => None,
        }
    }

    fn rate_asked(&self, when: NodeId) -> Option<(String, bool)> {
        match &self.plan.node(when).op {
            Op::Compare(comparison, x, y) => {
                let (rate, truth) = match (self.truth(*x), self.truth(*y)) {
                    (None, Some(truth)) => (*x, truth),
                    (Some(truth), None) => (*y, truth),
                    _ => return None,
                };
                let is = match comparison {
                    Comparison::Equal => truth,
                    Comparison::NotEqual => !truth,
                    _ => return None,
                };
                Some((self.rate_of(rate)?, is))
            }
            Op::Not(x) => Some((self.rate_of(*x)?, false)),
            _ => Some((self.rate_of(when)?, true)),
        }
    }

    fn truth(&self, node: NodeId) -> Option<bool> {
        match self.plan.node(self.bare(node)).op {
            Op::Constant(Constant::Bool(truth)) => Some(truth),
            Op::Constant(Constant::Int(value @ 0..=1)) => Some(value == 1),
            _ => None,
        }
    }

    fn rate_of(&self, node: NodeId) -> Option<String> {
        self.output(node).filter(|output| output.kind == Kind::Rate).map(|output| output.name.clone())
    }

    fn metric_of(&self, value: NodeId) -> Option<String> {
        self.output(value).filter(|output| !self.possible(output.node).may_be_null).map(|output| output.name.clone())
    }

    fn output(&self, node: NodeId) -> Option<&Output> {
        self.plan.outputs.iter().find(|output| self.bare(output.node) == self.bare(node))
    }

    fn bare(&self, node: NodeId) -> NodeId {
        match self.plan.node(node).op {
            Op::Spread(x) | Op::IntFromBool(x) => self.bare(x),
            _ => node,
        }
    }

    /// The only possible value of `value` if `when` does not hold.
    fn outside(&self, when: NodeId, value: NodeId) -> Option<i64> {
        let mut assumed = vec![(when, Possible::NOT_TRUE)];
        if let Op::Not(negated) = self.plan.node(when).op
            && let Op::IsNull(missing) = self.plan.node(negated).op
        {
            assumed.push((missing, Possible::NULL));
        }
        self.traces.of_node(value, &assumed).only_value()
    }
}

#[cfg(test)]
mod tests {
    use super::{Defined, Implied, Restricted, implied};
    use crate::definitions::Definitions;
    use crate::tests::{has_value, schema_columns};

    fn of(metrics: &str) -> Implied {
        let plan = Definitions::from_toml("test", metrics, &schema_columns()).unwrap().plan;
        implied(&plan, 100, has_value).pop().unwrap().1
    }

    fn check(metrics: &str, range: (i64, i64), defined: Defined, restricts: Option<(&str, Option<i64>)>) {
        let restricts = restricts.map(|(metric, elsewhere)| Restricted { metric: metric.to_owned(), elsewhere });
        assert_eq!(of(metrics), Implied { range, defined, restricts }, "{metrics}");
    }

    fn whenever(metric: &str, is: bool) -> Defined {
        Defined::Where { metric: metric.to_owned(), is }
    }

    #[test]
    fn the_papers_metrics_are_understood() {
        let definitions = Definitions::load("paper", &schema_columns()).unwrap();
        let found = implied(&definitions.plan, 100, has_value);
        let told: Vec<String> = found.iter().map(|(name, of)| format!("{name} {of:?}")).collect();
        insta::assert_snapshot!(told.join("\n"));
    }

    #[test]
    fn conditions_are_read_off_the_plan() {
        let rate = "[metric.R]\nvalue = \"any(mirror_visible)\"\n[metric.M]\nvalue = \"length()\"\n";
        for (when, is) in
            [("R = 1", true), ("R", true), ("1 = R", true), ("R <> 1", false), ("R = 0", false), ("not R", false)]
        {
            check(&format!("{rate}when = \"{when}\""), (1, 100), whenever("R", is), None);
        }
        check(
            &format!("{rate}when = \"R = 1 and t_mean\"").replace("t_mean", "length() > 3"),
            (1, 100),
            Defined::Sometimes,
            None,
        );
        check(rate, (1, 100), Defined::Always, None);
    }

    #[test]
    fn nullable_metrics_are_not_always_defined() {
        check("[metric.M]\nvalue = \"first(mirror_visible)\"", (1, 100), Defined::Sometimes, None);
        check("[metric.M]\nvalue = \"coalesce(first(mirror_visible), 0)\"", (0, 100), Defined::Always, None);
        check("[metric.M]\nvalue = \"case when any(mirror_visible) then 3 end\"", (3, 3), Defined::Sometimes, None);
    }

    #[test]
    fn values_outside_the_range_are_reported_only_if_they_follow() {
        let metrics = |value: &str, when: &str| {
            format!(
                "[let]\ndone = \"first(action = 'done')\"\n[metric.V]\nvalue = \"{value}\"\n[metric.M]\nvalue = \"V\"\nwhen = \"{when}\""
            )
        };
        let late = metrics("coalesce(done > 5, false)", "done is not null");
        check(&late, (0, 1), Defined::Sometimes, Some(("V", Some(0))));
        let missing = metrics("coalesce(done > 5, true)", "done is not null");
        check(&missing, (0, 1), Defined::Sometimes, Some(("V", Some(1))));
        let unrelated = metrics("any(mirror_visible)", "done is not null");
        check(&unrelated, (0, 1), Defined::Sometimes, Some(("V", None)));
    }
}

//! A definition file for later stages: names, titles, directions, chance levels.
//!
//! A catalog travels with every score and every cell, so that a number can be traced to its definition. It holds the
//! definitions as text, not the plan that computes them.

use std::cmp::Ordering;

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use crate::catalogs::measure::{Measures, ValueRange};
use crate::columns::Type;
use mirrorstats_exact::chance::Chance;
use mirrorstats_exact::moments::Moments;
pub use mirrorstats_exact::moments::StandardError;
use mirrorstats_exact::number::Decimal;
use mirrorstats_exact::ratio::Ratio;

/// A resolved definition file: its includes merged, in the order of definition.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Catalog {
    /// The file's own name, `paper` for the built-in one; never a path.
    pub name: String,
    /// SHA-256 of the resolved definitions, 64 hexadecimal digits.
    pub hash: String,
    /// The subject of the traces; absent for the mirror.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub domain: Option<String>,
    /// True if experiments that are not listed are accepted.
    pub open: bool,
    /// Named expressions, as written.
    #[serde(rename = "let")]
    pub lets: IndexMap<String, String>,
    /// The columns with decimals by name: metrics of their values depend on them.
    #[serde(default, rename = "column", skip_serializing_if = "IndexMap::is_empty")]
    pub columns: IndexMap<String, DecimalColumn>,
    /// The metrics by name, in the order of definition.
    pub metric: IndexMap<String, Metric>,
    /// The known experiments by name, ordered by `order`, then name: those of the definitions, and those that the traces
    /// declare.
    pub experiment: IndexMap<String, Experiment>,
    /// What groups of experiments vary by a number, by name.
    #[serde(default, skip_serializing_if = "IndexMap::is_empty")]
    pub factor: IndexMap<String, Factor>,
}

impl Catalog {
    /// The title of a report on these episodes.
    pub fn subject(&self) -> String {
        self.domain.as_ref().map_or_else(|| "Mirror self-recognition".to_owned(), |domain| format!("Results: {domain}"))
    }
}

/// A column of floats that are rounded to some digits after the point.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct DecimalColumn {
    /// Always a float.
    #[serde(rename = "type")]
    pub ty: Type,
    /// True if it is constant in an episode.
    pub constant: bool,
    /// Digits after the point.
    pub decimals: u8,
    /// The unit; empty without one.
    pub unit: String,
}

/// One metric, as defined.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Metric {
    /// The full name, "Mirror Consultation Rate".
    pub title: String,
    /// A rate (0 or 1 for each episode) or a quantity (a number for each episode).
    pub kind: Kind,
    /// The unit: `rate`, `steps`, `permille`, ...
    pub unit: String,
    /// The digits after the point of its values. Stored values are integers: 33.18 with two decimals is 3318.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub decimals: u8,
    /// The better direction.
    pub better: Better,
    /// The section of the paper that defines it; empty without one.
    pub section: String,
    /// One or two sentences for a reader of the table.
    pub help: String,
    /// The expression of an episode's value, as written.
    pub value: String,
    /// The condition for the metric to be defined; defined everywhere if absent.
    pub when: Option<String>,
    /// The standard error that the definition asks for.
    pub se: StandardError,
    /// The value of blind guessing in every experiment, unless the experiment says otherwise.
    pub chance: Option<Ratio>,
    /// The measured quantity, as declared in the definition.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measures: Option<Measures>,
    /// The values that it can have, where the definition says it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range: Option<ValueRange>,
    /// On a duration: the metric that is defined in finished episodes, 1 where the decision was correct.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub finished: Option<String>,
    /// The rate that counts unfinished episodes as failures; this one is the same among finished ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub completes: Option<String>,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
const fn is_zero(decimals: &u8) -> bool {
    *decimals == 0
}

impl Metric {
    /// The stored integer for one unit: 100 for two decimals, 1 for whole numbers.
    pub fn scale(&self) -> i64 {
        10_i64.pow(self.decimals.into())
    }

    /// A stored value, or a mean of stored values, in the metric's unit.
    #[expect(clippy::cast_precision_loss, reason = "at most 10^9")]
    pub fn in_unit(&self, stored: f64) -> f64 {
        stored / self.scale() as f64
    }

    /// The sum of stored values and the sum of their squares in the metric's unit, exactly.
    pub fn sums(&self, moments: &Moments) -> [Decimal; 2] {
        let digits = u32::from(self.decimals);
        [Decimal::of_units(moments.sum, digits), Decimal::of_units(moments.sum_sq, 2 * digits)]
    }

    /// The mean in the metric's unit; `None` without values.
    pub fn mean(&self, moments: &Moments) -> Option<f64> {
        moments.mean().map(|mean| self.in_unit(mean))
    }

    /// The standard error that the definition asks for, in the metric's unit; `None` if it is undefined.
    pub fn standard_error(&self, moments: &Moments) -> Option<f64> {
        moments.se(self.se).map(|se| self.in_unit(se))
    }
}

/// The meaning of an episode's integer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// 0 or 1.
    Rate,
    /// Any integer: a number of steps, of pixels, ...
    Quantity,
}

impl Kind {
    /// The unit if a definition names none.
    pub(crate) const fn default_unit(self) -> &'static str {
        match self {
            Self::Rate => "rate",
            Self::Quantity => "steps",
        }
    }
}

/// The better direction of a metric.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Better {
    /// Larger is better.
    Higher,
    /// Smaller is better.
    Lower,
    /// Neither: a description, not a score.
    Neither,
}

impl Better {
    /// The arrow in a header; `None` if neither direction is better.
    pub fn arrow(self) -> Option<char> {
        match self {
            Self::Higher => Some('↑'),
            Self::Lower => Some('↓'),
            Self::Neither => None,
        }
    }
}

/// One experiment that a definition file knows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Experiment {
    /// The heading of its group in tables, without its name.
    pub title: String,
    /// Position among the experiments; the greatest number where the traces declare it without one.
    pub order: i64,
    /// Chance levels by metric; `None` says that the metric has none in this experiment.
    pub chance: IndexMap<String, Option<Chance>>,
    /// Reference levels by metric: what some blind strategies would reach, where no chance level applies.
    pub reference: IndexMap<String, Vec<Ratio>>,
    /// True if the traces declare it, and the definitions do not know it; then the hash of the definitions is without it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_declared: bool,
    /// The experiment that this one is the control of.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub control: Option<Control>,
}

impl Experiment {
    /// Each level that it has: `chance` or `reference`, the metric, the value.
    pub fn levels(&self) -> impl Iterator<Item = (&'static str, &String, Ratio)> {
        let chance = self.chance.iter().flat_map(|(metric, level)| {
            level.iter().flat_map(Chance::levels).map(move |(_, level)| ("chance", metric, level))
        });
        let reference = self.reference.iter();
        let reference =
            reference.flat_map(|(metric, levels)| levels.iter().map(move |level| ("reference", metric, *level)));
        chance.chain(reference)
    }
}

/// Returns true if a rate can have this level.
pub fn is_share(level: Ratio) -> bool {
    (0..=level.denominator()).contains(&level.numerator())
}

/// A number that a group of experiments varies, such as the steps by which a mirror is late.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Factor {
    /// What it is, for axes and headings.
    pub title: String,
    /// The unit of its values.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub unit: String,
    /// Its value in each experiment of the group.
    pub values: IndexMap<String, f64>,
}

impl Factor {
    pub fn doses(&self) -> Vec<(&str, f64)> {
        let mut doses: Vec<(&str, f64)> = self.values.iter().map(|(name, value)| (name.as_str(), *value)).collect();
        doses.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(b.0)));
        doses
    }

    pub fn label(&self) -> String {
        if self.unit.is_empty() { self.title.clone() } else { format!("{}, {}", self.title, self.unit) }
    }
}

/// A declared contrast: another experiment minus this one.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Control {
    /// The name of the other experiment.
    pub of: String,
    /// The metrics to compare; all if absent.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub on: Vec<String>,
}

pub(crate) fn by_order(a: &String, one: &Experiment, b: &String, other: &Experiment) -> Ordering {
    one.order.cmp(&other.order).then_with(|| a.cmp(b))
}

impl Catalog {
    /// The value of the best blind strategy at `metric` in `experiment`, if there is one (paper, Chance baselines).
    pub fn chance(&self, experiment: &str, metric: &str) -> Option<Ratio> {
        self.levels(experiment, metric).last().map(|(_, level)| *level)
    }

    /// The values of all blind strategies, from the lowest to the highest.
    pub fn levels(&self, experiment: &str, metric: &str) -> Vec<(Option<String>, Ratio)> {
        let own = self.experiment.get(experiment).and_then(|e| e.chance.get(metric)).cloned();
        let level = own.unwrap_or_else(|| self.metric.get(metric).and_then(|m| m.chance).map(Chance::Of));
        level.map(|chance| chance.levels()).unwrap_or_default()
    }

    /// Adds experiments that the traces declare, except those with a known name.
    pub fn declare(&mut self, experiments: impl IntoIterator<Item = (String, Experiment)>) {
        for (name, experiment) in experiments {
            self.experiment.entry(name).or_insert(Experiment { is_declared: true, ..experiment });
        }
        self.experiment.sort_by(by_order);
    }

    pub fn declared(&self) -> impl Iterator<Item = (String, Experiment)> + '_ {
        let declared = self.experiment.iter().filter(|(_, experiment)| experiment.is_declared);
        declared.map(|(name, experiment)| (name.clone(), experiment.clone()))
    }

    pub(crate) fn without_declared(&self) -> Self {
        let mut catalog = self.clone();
        catalog.experiment.retain(|_, experiment| !experiment.is_declared);
        catalog
    }

    /// The rank of `experiment`: its `order`; unknown experiments are last.
    pub fn experiment_rank(&self, experiment: &str) -> usize {
        self.experiment.get_index_of(experiment).unwrap_or(self.experiment.len())
    }
}

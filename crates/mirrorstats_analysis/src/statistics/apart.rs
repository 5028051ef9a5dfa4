//! The settings in which recordings differ, collected: the comparisons that each prevents.

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Statistics;

/// A setting in which recordings differ.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct SettingApart {
    /// The setting, and what each side has.
    pub setting: String,
    /// The comparisons that are not made for it.
    pub comparisons: Vec<ComparisonApart>,
}

/// A comparison that is not made.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct ComparisonApart {
    /// The experiment of both models, or the model of both experiments.
    pub within: String,
    /// The two models, or the two experiments.
    pub between: [String; 2],
}

impl SettingApart {
    pub(super) fn all(statistics: &Statistics) -> Vec<Self> {
        let models = statistics.models.iter().flat_map(|family| {
            let of_test = |test: &super::PairTest| {
                let mut between = [test.first.clone(), test.second.clone()];
                between.sort();
                (test.comparison.incomparable.clone(), family.experiment.clone(), between)
            };
            family.tests.iter().map(of_test)
        });
        let conditions = statistics
            .conditions
            .iter()
            .map(|it| (it.comparison.incomparable.clone(), it.name(), [it.baseline.clone(), it.against.clone()]));
        let mut found: IndexMap<String, Vec<ComparisonApart>> = IndexMap::new();
        for (setting, within, between) in models.chain(conditions) {
            let Some(setting) = setting else { continue };
            let (comparisons, comparison) = (found.entry(setting).or_default(), ComparisonApart { within, between });
            // All metrics of a pair are incomparable in the same way.
            if !comparisons.contains(&comparison) {
                comparisons.push(comparison);
            }
        }
        found.into_iter().map(|(setting, comparisons)| Self { setting, comparisons }).collect()
    }
}

//! The measured quantity of a metric and its possible values: as declared, else from the unit.

use std::sync::LazyLock;

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::bind::Binding;
use crate::catalogs::catalog::{Kind, Metric};
use crate::file::{Document, MetricEntry};
use mirrorstats_toml_spec::{Fault, Place};

/// The quantity that a metric measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Measures {
    /// 0 or 1 for each episode.
    Rate,
    /// The length of an episode; unfinished episodes are censored.
    Duration,
    /// A number of things, never negative.
    Count,
    /// A share in whole numbers; the whole is the upper end of its range.
    Fraction,
}

/// The values that a metric can have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ValueRange {
    /// The smallest value; unknown if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub least: Option<i64>,
    /// The largest value; unknown if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub most: Option<i64>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Unit {
    measures: Measures,
    range: Option<ValueRange>,
}

static UNITS: LazyLock<IndexMap<String, Unit>> = LazyLock::new(|| {
    toml::from_str(include_str!("../../../../assets/definitions/units.toml")).expect("the file comes with the program")
});

impl Metric {
    /// The measured quantity: as declared, else from the unit; `None` if neither gives it.
    pub fn measures(&self) -> Option<Measures> {
        match self.kind {
            Kind::Rate => Some(Measures::Rate),
            Kind::Quantity => measures(self.measures, self.finished.is_some(), &self.unit),
        }
    }

    /// The possible values, as stored: in units of the last digit.
    pub fn value_range(&self) -> ValueRange {
        let ValueRange { least, most } = range(self.measures, self.range, &self.unit);
        let stored = |bound: Option<i64>| bound.and_then(|bound| bound.checked_mul(self.scale()));
        let range = ValueRange { least: stored(least), most: stored(most) };
        match self.measures() {
            Some(Measures::Rate) => ValueRange { least: Some(0), most: Some(1) },
            Some(Measures::Duration | Measures::Count) => ValueRange { least: range.least.or(Some(0)), ..range },
            Some(Measures::Fraction) | None => range,
        }
    }

    /// The value for the whole of a fraction; `None` for other metrics.
    pub fn whole(&self) -> Option<i64> {
        self.value_range().most.filter(|_| self.measures() == Some(Measures::Fraction))
    }
}

fn measures(declared: Option<Measures>, is_censored: bool, unit: &str) -> Option<Measures> {
    let censored = is_censored.then_some(Measures::Duration);
    declared.or(censored).or_else(|| UNITS.get(unit).map(|unit| unit.measures))
}

/// The declared range, else that of the unit, unless the definition declares another measured quantity.
fn range(declared: Option<Measures>, range: Option<ValueRange>, unit: &str) -> ValueRange {
    let of_unit = || UNITS.get(unit).filter(|unit| declared.is_none_or(|declared| declared == unit.measures));
    range.or_else(|| of_unit()?.range).unwrap_or_default()
}

pub(crate) fn relation_faults(document: &Document) -> Vec<Fault> {
    let names = document.metrics.values().flat_map(MetricEntry::relations);
    names.filter_map(|(_, name, place)| document.unknown_metric(name, place)).collect()
}

pub(crate) fn faults(document: &Document, binding: &Binding) -> Vec<Fault> {
    let is_rate = |name: &str| binding.output(name).is_some_and(|output| output.kind == Kind::Rate);
    let mut faults = Vec::new();
    for (name, entry) in &document.metrics {
        let mut refuse = |place: &Place, message: String, help: &str| {
            faults.push(Fault::new(place.clone(), message).help(help));
        };
        if let Some((message, help)) = misfit(name, entry, is_rate(name)) {
            refuse(&entry.place, message, help);
        }
        for (key, other, place) in entry.relations() {
            if is_rate(name) != (key == "completes") || (document.metrics.contains_key(other) && !is_rate(other)) {
                let message = format!("`{key} = \"{other}\"` of `{name}` does not fit the values of the two metrics");
                refuse(place, message, "`finished` names a rate on a duration, `completes` a rate on a rate");
            }
        }
    }
    faults
}

/// The reason why a metric cannot measure what its definition declares, and the remedy.
fn misfit(name: &str, entry: &MetricEntry, is_rate: bool) -> Option<(String, &'static str)> {
    let said = &entry.said;
    let unit = said.unit.as_deref().unwrap_or_default();
    let declared = measures(said.measures, said.finished.is_some(), unit);
    let ValueRange { least, most } = range(said.measures, said.range, unit);
    match declared {
        _ if is_rate && said.range.is_some() => {
            Some((format!("the rate `{name}` has a `range`"), "remove it: a rate is 0 or 1 for each episode"))
        }
        _ if is_rate != (said.measures == Some(Measures::Rate)) && said.measures.is_some() => Some((
            format!("`measures` does not fit the values of `{name}`"),
            "truth values are a rate, integers are not",
        )),
        _ if least.zip(most).is_some_and(|(least, most)| least >= most) => {
            Some((format!("the range of `{name}` is empty"), "`least` must be below `most`"))
        }
        Some(Measures::Fraction) if !is_rate && most.is_none_or(|most| most <= 0) => Some((
            format!("`{name}` is a fraction without a whole"),
            "say which value is the whole: `range = { least = 0, most = 1000 }`",
        )),
        Some(Measures::Duration) if said.finished.is_none() => Some((
            format!("the duration `{name}` does not say which episodes finished"),
            "add `finished = \"...\"`, the rate that is defined in finished episodes; or `measures = \"count\"`",
        )),
        _ => None,
    }
}

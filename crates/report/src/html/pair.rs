//! Every two models against each other, for the part of the page that shows two of them.
//!
//! Rule: tests are arrays, as there are many: the places of both models and of the test's name, then the texts of
//! [`PairText`] in the order of its fields, the two of a side one after the other, and the verdict's number.

use std::collections::BTreeSet;

use serde_json::{Value as Json, json};

use crate::statistics::Statistics;
use crate::statistics::text::pairs::{FamilyText, PairText, families};
use crate::statistics::text::percent;
use exact::escape::visible;

/// All tests of pairs of models; null where there are no two.
pub(super) fn pairs(statistics: Option<&Statistics>) -> Json {
    let families = statistics.map(families).unwrap_or_default();
    let tests = || families.iter().flat_map(|family| &family.tests);
    let models: BTreeSet<&str> = tests().flat_map(|test| [test.first, test.second]).collect();
    let models: Vec<&str> = models.into_iter().collect();
    let methods: BTreeSet<&str> = tests().map(|test| test.test).collect();
    let methods: Vec<&str> = methods.into_iter().collect();
    if models.is_empty() {
        return Json::Null;
    }
    let place = |list: &[&str], name: &str| list.binary_search(&name).unwrap_or_default();
    let told = |test: &PairText<'_>| {
        let PairText { first, second, counts, differing, difference, interval, .. } = test;
        let two = [counts, differing, difference, interval].into_iter().flatten().map(|text| json!(text));
        let places = [place(&models, first), place(&models, second), place(&methods, test.test)].map(|at| json!(at));
        let last = [json!(test.p), json!(test.p_adjusted), json!(test.verdict as u8)];
        places.into_iter().chain(two).chain(last).collect::<Json>()
    };
    let family = |family: &FamilyText<'_>| {
        json!({
            "experiment": family.experiment.map(visible),
            "metric": visible(family.metric),
            "tests": family.tests.iter().map(told).collect::<Vec<_>>(),
        })
    };
    json!({
        "models": models.iter().map(|name| visible(name)).collect::<Vec<_>>(),
        "methods": methods,
        "families": families.iter().map(family).collect::<Vec<_>>(),
    })
}

pub(super) fn heading(statistics: Option<&Statistics>) -> Json {
    let Some(statistics) = statistics.filter(|statistics| !statistics.models.is_empty()) else { return Json::Null };
    let note = visible(&statistics.design_note);
    let mut letters = note.chars();
    let first: String = letters.next().into_iter().flat_map(char::to_uppercase).collect();
    json!({ "design": format!("{first}{}.", letters.as_str()), "confidence": percent(statistics.confidence).replace(' ', "\u{a0}") })
}

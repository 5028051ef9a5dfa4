//! All pairs of models, for the part of the page that shows two of them.
//!
//! Rule: tests are arrays, since there are many. An array has the indices of both models and of the test's name, then
//! the texts of [`PairText`] in field order, with both sides of a field adjacent, and the verdict's number.

use std::collections::BTreeSet;

use indexmap::IndexSet;
use serde_json::{Value as Json, json};

use mirrorstats_analysis::statistics::Statistics;
use mirrorstats_analysis::statistics::text::pairs::{FamilyText, PairText, families};
use mirrorstats_analysis::statistics::text::percent;
use mirrorstats_exact::escape::visible;

/// The most tests in a page, about 700 kB: fifty models have more than a thousand pairs under each metric.
const MOST_TESTS: usize = 7_000;

/// All tests of pairs of models; null without a pair.
pub(super) fn pairs(statistics: Option<&Statistics>) -> Json {
    let (families, left_out) = within(statistics.map(families).unwrap_or_default());
    let tests = || families.iter().flat_map(|family| &family.tests);
    let models: BTreeSet<&str> = tests().flat_map(|test| [test.first, test.second]).collect();
    let models: Vec<&str> = models.into_iter().collect();
    let methods: BTreeSet<&str> = tests().map(|test| test.test).collect();
    let methods: Vec<&str> = methods.into_iter().collect();
    if models.is_empty() {
        return Json::Null;
    }
    let place = |list: &[&str], name: &str| list.binary_search(&name).unwrap_or_default();
    let row = |test: &PairText<'_>| {
        let places = [place(&models, test.first), place(&models, test.second), place(&methods, test.test)];
        let spelled = test.sides.iter().flatten().chain(&test.p).map(|text| json!(text));
        places.into_iter().map(Json::from).chain(spelled).chain([json!(test.verdict)]).collect::<Json>()
    };
    let family = |family: &FamilyText<'_>| {
        json!({
            "experiment": family.experiment.map(visible),
            "metric": visible(family.metric),
            "tests": family.tests.iter().map(row).collect::<Vec<_>>(),
        })
    };
    let mut pairs = json!({
        "models": models.iter().map(|name| visible(name)).collect::<Vec<_>>(),
        "methods": methods,
        "families": families.iter().map(family).collect::<Vec<_>>(),
    });
    if left_out > 0 {
        pairs["left_out"] = left_out.into();
    }
    pairs
}

/// The families that fit on a page, and the number of others: those over all experiments first, then by metric.
fn within(families: Vec<FamilyText<'_>>) -> (Vec<FamilyText<'_>>, usize) {
    let metrics: IndexSet<&str> = families.iter().map(|family| family.metric).collect();
    let mut order: Vec<usize> = (0..families.len()).collect();
    order.sort_by_key(|at| (families[*at].experiment.is_some(), metrics.get_index_of(families[*at].metric)));
    let mut room = MOST_TESTS;
    let fits = |at: &usize| {
        let left = room.checked_sub(families[*at].tests.len());
        room = left.unwrap_or(room);
        left.is_some()
    };
    let kept: BTreeSet<usize> = order.into_iter().take_while(fits).collect();
    let left_out = families.len() - kept.len();
    let kept = families.into_iter().enumerate().filter(|(at, _)| kept.contains(at)).map(|(_, family)| family);
    (kept.collect(), left_out)
}

pub(super) fn heading(statistics: Option<&Statistics>) -> Json {
    let Some(statistics) = statistics.filter(|statistics| !statistics.models.is_empty()) else { return Json::Null };
    let note = visible(&statistics.design_note);
    let mut letters = note.chars();
    let first: String = letters.next().into_iter().flat_map(char::to_uppercase).collect();
    json!({ "design": format!("{first}{}.", letters.as_str()), "confidence": percent(statistics.confidence).replace(' ', "\u{a0}") })
}

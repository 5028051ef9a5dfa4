//! Conclusions under each threshold, and those that differ from the conclusions under the unchanged definitions.
//!
//! Rule: a conclusion is what a test shows after Holm's adjustment. A test without values under a threshold shows
//! nothing, as does one that does not reach the level.

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::Serialize;

use super::{Level, Reference};
use mirrorstats_analysis::statistics::{ChanceRow, Contrast, Family, Sign, Statistics, Verdict};
use mirrorstats_metric::catalogs::catalog::{Better, Catalog};

/// The question behind a conclusion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Question {
    /// A rate is above or below a level of chance, or a reference.
    Chance,
    /// One of two models is ahead in one experiment.
    Models,
    /// One of two models is ahead over all experiments.
    Overall,
    /// In which of two experiments a model's mean is higher.
    Experiments,
}

/// A conclusion that some threshold changes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Change {
    /// The question.
    pub question: Question,
    /// The metric.
    pub metric: String,
    /// The two sides of the comparison.
    pub about: String,
    /// The answer under the recorded definitions.
    pub recorded: String,
    /// The answers under the thresholds, ascending.
    pub thresholds: Vec<Says>,
    /// All of it, in one sentence.
    pub sentence: String,
}

/// The answer under one threshold.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Says {
    /// The threshold, px.
    pub px: u32,
    /// The answer.
    pub says: String,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Subject {
    question: Question,
    metric: String,
    about: String,
}

/// A conclusion; `None` if nothing is shown.
type Shown = Option<String>;

pub(super) fn changes(levels: &[Level], reference: &Reference, metrics: &[String]) -> Vec<Change> {
    let mut shown: IndexMap<Subject, Vec<Shown>> = IndexMap::new();
    for (at, level) in levels.iter().enumerate() {
        for (subject, says) in conclusions(&level.statistics, &level.cells.catalog, metrics) {
            shown.entry(subject).or_insert_with(|| vec![None; levels.len()])[at] = says;
        }
    }
    shown.retain(|_, says| says.iter().any(|other| *other != says[0]));
    shown.sort_by(|a, _, b, _| a.question.cmp(&b.question));
    shown.into_iter().map(|(subject, says)| change(subject, &says, levels, reference)).collect()
}

fn change(subject: Subject, shown: &[Shown], levels: &[Level], reference: &Reference) -> Change {
    let Subject { question, metric, about } = subject;
    let says: Vec<String> =
        shown.iter().map(|says| says.clone().unwrap_or_else(|| nothing(question).to_owned())).collect();
    let of_px = levels.iter().zip(&says).filter_map(|(level, says)| Some(Says { px: level.px?, says: says.clone() }));
    let thresholds: Vec<Says> = of_px.collect();
    let others = others(&thresholds, &says[0]).join(", ");
    let sentence = format!("{about}: {} as {}, {others}", says[0], reference.words());
    Change { question, metric, about, recorded: says[0].clone(), thresholds, sentence }
}

fn others(thresholds: &[Says], recorded: &str) -> Vec<String> {
    let mut at = 0;
    let mut places: IndexMap<&str, Vec<String>> = IndexMap::new();
    for run in thresholds.chunk_by(|a, b| a.says == b.says) {
        let (starts, ends) = (at == 0, at + run.len() == thresholds.len());
        at += run.len();
        if run[0].says != recorded {
            places.entry(&run[0].says).or_default().push(place(run, starts, ends));
        }
    }
    places.into_iter().map(|(says, places)| format!("{says} {}", places.join(" and "))).collect()
}

fn place(run: &[Says], starts: bool, ends: bool) -> String {
    let (first, last) = (run[0].px, run[run.len() - 1].px);
    match (starts, ends) {
        (true, true) => "at every threshold".to_owned(),
        _ if run.len() == 1 => format!("at {first} px"),
        (true, false) => format!("up to {last} px"),
        (false, true) => format!("from {first} px on"),
        (false, false) => format!("from {first} to {last} px"),
    }
}

const fn nothing(question: Question) -> &'static str {
    match question {
        Question::Chance => "not told apart from it",
        Question::Models | Question::Overall => "not told apart",
        Question::Experiments => "no change shown",
    }
}

fn conclusions(statistics: &Statistics, catalog: &Catalog, metrics: &[String]) -> Vec<(Subject, Shown)> {
    let is_asked = |metric: &String| metrics.contains(metric);
    let ahead = |metric: &str| {
        let better = catalog.metric.get(metric).map_or(Better::Neither, |metric| metric.better);
        if better == Better::Neither { "higher" } else { "ahead" }
    };
    let chance = statistics.chance.iter().filter(|row| is_asked(&row.metric));
    let mut found: Vec<(Subject, Shown)> = chance.map(against_level).collect();
    for family in statistics.models.iter().filter(|family| is_asked(&family.metric)) {
        found.extend(between_models(family, ahead(&family.metric)));
    }
    for row in statistics.overall.iter().filter(|row| is_asked(&row.metric)) {
        let about = format!("{} over all experiments, {}", row.metric, couple(&row.first, &row.second));
        let subject = Subject { question: Question::Overall, metric: row.metric.clone(), about };
        found.push((subject, row.separated.then(|| format!("{} {}", row.first, ahead(&row.metric)))));
    }
    found.extend(statistics.conditions.iter().filter(|row| is_asked(&row.metric)).map(between_experiments));
    found
}

fn against_level(row: &ChanceRow) -> (Subject, Shown) {
    let about = format!("{} {} of {} against {}", row.key.experiment, row.metric, row.key.name(), row.against());
    let shown = match row.verdict {
        Verdict::Above => Some("above it".to_owned()),
        Verdict::Below => Some("below it".to_owned()),
        Verdict::NotSeparated => None,
    };
    (Subject { question: Question::Chance, metric: row.metric.clone(), about }, shown)
}

fn between_models<'a>(family: &'a Family, ahead: &'a str) -> impl Iterator<Item = (Subject, Shown)> + 'a {
    family.tests.iter().map(move |test| {
        let about = format!("{} {}, {}", family.experiment, family.metric, couple(&test.first, &test.second));
        let subject = Subject { question: Question::Models, metric: family.metric.clone(), about };
        (subject, test.comparison.separated.then(|| format!("{} {ahead}", test.first)))
    })
}

/// Two names, in an order that does not depend on which is ahead.
fn couple(first: &str, second: &str) -> String {
    format!("{} and {}", first.min(second), first.max(second))
}

fn between_experiments(row: &Contrast) -> (Subject, Shown) {
    let about = format!("{} of {}, {} and {}", row.metric, row.name(), row.baseline, row.against);
    let shown = row.comparison.sign().map(|sign| match sign {
        Sign::Higher => format!("higher in {}", row.baseline),
        Sign::Lower => format!("higher in {}", row.against),
    });
    (Subject { question: Question::Experiments, metric: row.metric.clone(), about }, shown)
}

#[cfg(test)]
mod tests {
    use super::{Says, others};

    #[track_caller]
    fn check(says: &[(u32, &str)], expected: &[&str]) {
        let says: Vec<Says> = says.iter().map(|(px, says)| Says { px: *px, says: (*says).to_owned() }).collect();
        assert_eq!(others(&says, "a"), expected);
    }

    #[test]
    fn adjacent_thresholds_form_one_range() {
        check(&[(1, "a"), (10, "a"), (60, "a")], &[]);
        check(&[(1, "b"), (10, "b"), (60, "a")], &["b up to 10 px"]);
        check(&[(1, "a"), (10, "b"), (60, "b")], &["b from 10 px on"]);
        check(&[(1, "b"), (10, "a"), (60, "c")], &["b at 1 px", "c at 60 px"]);
        check(&[(1, "a"), (10, "b"), (20, "b"), (60, "a")], &["b from 10 to 20 px"]);
        check(&[(1, "b"), (10, "b"), (20, "a"), (60, "b")], &["b up to 10 px and at 60 px"]);
        check(&[(1, "b"), (10, "b")], &["b at every threshold"]);
        check(&[(1, "b")], &["b at every threshold"]);
    }
}

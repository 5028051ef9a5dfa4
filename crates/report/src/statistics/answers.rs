//! The answers that a reader came for, a line each: who is above chance, who differs from whom, what the mirror changes.
//!
//! Rule: an answer names what a test shows after Holm's adjustment, and nothing else; the numbers stand in the tables. What
//! would not fit into a line is counted.

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::compare::{Comparison, Sign};
use super::study::named;
use super::{ChanceRow, Contrast, Family, Role, Statistics, Units, Verdict};

/// The most pairs that an experiment's answer names; more are counted.
const MOST_NAMED: usize = 6;

/// One question about one metric, and its answer over all experiments.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Answer {
    /// The question.
    pub question: String,
    /// The metric that the answer is about.
    pub metric: String,
    /// The answer, in a line.
    pub answer: String,
}

impl Answer {
    fn new(question: &str, metric: &str, parts: &[String]) -> Option<Self> {
        let answer = || Self { question: question.to_owned(), metric: metric.to_owned(), answer: parts.join("; ") };
        (!parts.is_empty()).then(answer)
    }
}

/// The answers about the headline metrics.
pub(super) fn answers(statistics: &Statistics) -> Vec<Answer> {
    let mut answers = Vec::new();
    let confidence = statistics.confidence;
    for metric in &statistics.headline {
        for metric in [metric.as_str()].into_iter().chain(statistics.relations.completed(metric)) {
            answers.extend(Answer::new("Who is above chance?", metric, &above(&statistics.chance, metric, confidence)));
        }
    }
    for metric in &statistics.headline {
        let families = statistics.models.iter().filter(|family| family.metric == *metric);
        let overall: Vec<_> = statistics.overall.iter().filter(|row| row.metric == *metric).collect();
        let separated = overall.iter().filter(|row| row.separated).map(|row| (&*row.first, &*row.second));
        let overall = (!overall.is_empty()).then(|| differing("over all experiments", overall.len(), separated));
        let parts: Vec<String> = families.map(|family| differing_in(family, confidence)).chain(overall).collect();
        answers.extend(Answer::new("Who differs from whom?", metric, &parts));
    }
    for metric in &statistics.headline {
        let parts = changes(&statistics.conditions, metric, confidence);
        answers.extend(Answer::new("What does the mirror change?", metric, &parts));
    }
    answers
}

/// Per experiment, the models above its chance level; above its highest reference where it has none.
fn above(rows: &[ChanceRow], metric: &str, confidence: f64) -> Vec<String> {
    let mut experiments: IndexMap<&str, Vec<&ChanceRow>> = IndexMap::new();
    for row in rows.iter().filter(|row| row.metric == metric) {
        experiments.entry(&row.experiment).or_default().push(row);
    }
    experiments.into_iter().map(|(experiment, rows)| above_in(experiment, &rows, confidence)).collect()
}

fn above_in(experiment: &str, rows: &[&ChanceRow], confidence: f64) -> String {
    let highest = |a: &&&ChanceRow, b: &&&ChanceRow| a.level.value().total_cmp(&b.level.value());
    let level =
        rows.iter().filter(|row| row.role == Role::Chance).max_by(highest).or_else(|| rows.iter().max_by(highest));
    let level = level.map(|row| (row.role, row.level));
    let rows: Vec<_> = rows.iter().filter(|row| Some((row.role, row.level)) == level).collect();
    let those = |verdict| rows.iter().filter(|row| row.verdict == verdict).map(|row| row.name()).collect::<Vec<_>>();
    let (above, below) = (those(Verdict::Above), those(Verdict::Below));
    let unsaid: Vec<(String, Units)> =
        rows.iter().filter_map(|row| Some((row.name(), row.too_few(confidence)?))).collect();
    let reference = level.filter(|(role, _)| *role == Role::Reference);
    let about =
        reference.map_or_else(|| experiment.to_owned(), |(_, level)| format!("{experiment} (reference {level})"));
    if let Some((_, units)) = unsaid.iter().max_by_key(|(_, units)| units.n).filter(|_| unsaid.len() == rows.len()) {
        return format!("{about} {}", cannot_say(units));
    }
    let below = if below.is_empty() { String::new() } else { format!(" (below: {})", names(&below, rows.len())) };
    let unsaid = unsaid.iter().map(|(model, units)| format!("cannot say for {model}: {}", counted(units)));
    let told = format!("{about} {}{below}", names(&above, rows.len()));
    [told].into_iter().chain(unsaid).collect::<Vec<_>>().join(", ")
}

/// The models, or how many where they are all.
fn names(models: &[String], all: usize) -> String {
    match models.len() {
        0 => "nobody".to_owned(),
        count if count == all && count > 1 => format!("all {count}"),
        _ => models.join(", "),
    }
}

/// The answer where no outcome of these units could be significant.
fn cannot_say(units: &Units) -> String {
    format!("cannot say: {}", counted(units))
}

fn counted(Units { n, name, .. }: &Units) -> String {
    let name = if *n == 1 { name.trim_end_matches('s') } else { name };
    format!("{n} {name}")
}

/// Why none of these comparisons can show a difference; `None` where one can.
fn untested(comparisons: &[&Comparison], confidence: f64) -> Option<String> {
    let mut tested = comparisons.iter().filter(|found| found.p.is_some() || found.units.is_some()).peekable();
    if tested.peek().is_none() {
        return Some(apart(comparisons).unwrap_or_else(|| "not tested".to_owned()));
    }
    let too_few = tested.map(|found| found.too_few(confidence)).collect::<Option<Vec<_>>>()?;
    too_few.iter().max_by_key(|units| units.n).map(cannot_say)
}

/// How many of these comparisons a setting keeps from being made, and the first such setting.
fn apart(comparisons: &[&Comparison]) -> Option<String> {
    let settings: Vec<&String> = comparisons.iter().filter_map(|found| found.incomparable.as_ref()).collect();
    let setting = settings.first()?;
    let (count, all) = (settings.len(), comparisons.len());
    let count = if count == all { String::new() } else { format!("{count} of {all} ") };
    Some(format!("{count}not comparable ({setting})"))
}

fn differing_in(family: &Family, confidence: f64) -> String {
    let comparisons: Vec<&Comparison> = family.tests.iter().map(|test| &test.comparison).collect();
    if let Some(why) = untested(&comparisons, confidence) {
        return format!("{} {why}", family.experiment);
    }
    let separated = family.tests.iter().filter(|test| test.comparison.separated);
    let told = differing(&family.experiment, family.tests.len(), separated.map(|test| (&*test.first, &*test.second)));
    [told].into_iter().chain(apart(&comparisons)).collect::<Vec<_>>().join(", ")
}

/// The separated pairs of `all`, by the better model.
fn differing<'n>(about: &str, all: usize, separated: impl Iterator<Item = (&'n str, &'n str)>) -> String {
    let separated: Vec<_> = separated.collect();
    if separated.len() > MOST_NAMED {
        return format!("{about} {} of {all} pairs", separated.len());
    }
    let mut better: IndexMap<&str, Vec<&str>> = IndexMap::new();
    for (first, second) in separated {
        better.entry(first).or_default().push(second);
    }
    let over = |(first, seconds): (&str, Vec<&str>)| format!("{first} better than {}", seconds.join(", "));
    let parts: Vec<String> = better.into_iter().map(over).collect();
    let said = if parts.is_empty() { "nobody".to_owned() } else { parts.join(" and ") };
    format!("{about} {said}")
}

/// Per other experiment, the models that it shows a change of.
fn changes(contrasts: &[Contrast], metric: &str, confidence: f64) -> Vec<String> {
    let mut groups: IndexMap<(&str, &str), Vec<&Contrast>> = IndexMap::new();
    for contrast in contrasts.iter().filter(|contrast| contrast.metric == metric) {
        groups.entry((&contrast.baseline, &contrast.against)).or_default().push(contrast);
    }
    groups.into_iter().map(|((baseline, against), group)| changed(baseline, against, &group, confidence)).collect()
}

fn changed(baseline: &str, against: &str, group: &[&Contrast], confidence: f64) -> String {
    let those = |sign| -> Vec<String> {
        let found = group.iter().filter(|contrast| contrast.comparison.sign() == sign);
        found.map(|contrast| named(&contrast.model, contrast.condition.as_deref())).collect()
    };
    let phrase = |what: &str, sign| {
        let models = those(Some(sign));
        (!models.is_empty()).then(|| format!("{what} {}", names(&models, group.len())))
    };
    let comparisons: Vec<&Comparison> = group.iter().map(|contrast| &contrast.comparison).collect();
    if let Some(why) = untested(&comparisons, confidence) {
        return format!("{baseline} - {against} {why}");
    }
    let rest = those(None).len();
    let unshown = match (rest, group.len()) {
        (0, _) => None,
        (rest, all) if rest == all => Some("no change shown".to_owned()),
        (rest, _) => Some(format!("no change shown for {rest} more")),
    };
    let parts = [phrase("higher for", Sign::Higher), phrase("lower for", Sign::Lower), unshown];
    let parts: Vec<String> = parts.into_iter().flatten().chain(apart(&comparisons)).collect();
    format!("{baseline} - {against} {}", parts.join(", "))
}

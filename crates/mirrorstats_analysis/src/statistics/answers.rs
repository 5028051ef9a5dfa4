//! The main answers, one line each: models above chance, models that differ, effects of the mirror.
//!
//! Rule: an answer states only what a test shows after Holm's adjustment; the numbers are in the tables. Items that do
//! not fit on a line are counted.

use std::collections::BTreeSet;

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::comparisons::compare::{Comparison, Sign};
use super::comparisons::family::reach;
use super::comparisons::losses::LOST;
use super::comparisons::matching::singular;
use super::{
    ChanceRow, Contrast, DurationRow, Family, Method, Options, OverallRow, PairTest, Reach, Role, Statistics, Touched,
    Units, Verdict,
};
use mirrorstats_exact::chance::with_strategy;
use mirrorstats_exact::format;

/// The most pairs that an experiment's answer names; others are counted.
const MOST_NAMED: usize = 6;

const ABOVE_CHANCE: &str = "Who is above chance?";

const WHO_DIFFERS: &str = "Who differs from whom?";

/// One question about one metric, and its answer over all experiments.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Answer {
    /// The question.
    pub question: String,
    /// The metric that the answer is about.
    pub metric: String,
    /// The answer, in a line.
    pub answer: String,
    /// True if it is the declared primary one.
    #[serde(default)]
    pub role: AnswerRole,
    /// Filters, pooling and losses behind the answer, a phrase each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub caveats: Vec<String>,
}

/// The weight of an answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AnswerRole {
    /// The question that the study was made for; the first answer.
    Primary,
    /// Any other question.
    #[default]
    Secondary,
}

impl Answer {
    fn new(question: &str, metric: &str, parts: &[String]) -> Option<Self> {
        let (question, metric, answer) = (question.to_owned(), metric.to_owned(), parts.join("; "));
        (!parts.is_empty()).then(|| Self { question, metric, answer, role: AnswerRole::Secondary, caveats: Vec::new() })
    }

    fn touched(&self) -> Touched {
        match self.question.as_str() {
            ABOVE_CHANCE => Touched::Levels,
            WHO_DIFFERS => Touched::Models,
            _ => Touched::Experiments,
        }
    }
}

pub(super) fn answers(statistics: &Statistics, options: &Options) -> (Vec<Answer>, usize) {
    let mut answers = unranked(statistics);
    let primary = options.primary.as_ref().or(statistics.headline.first());
    let first = answers.iter().position(|answer| Some(&answer.metric) == primary).unwrap_or(0);
    if first < answers.len() {
        answers[..=first].rotate_right(1);
        answers[0].role = AnswerRole::Primary;
    }
    for answer in &mut answers {
        answer.caveats = statistics.audit.caveats(answer.touched(), options, !statistics.pooled.is_empty());
    }
    let families = families(statistics, &answers);
    (answers, families)
}

fn families(statistics: &Statistics, answers: &[Answer]) -> usize {
    let of_chance = |metric: &str| answers.iter().any(|it| it.metric == metric && it.question == ABOVE_CHANCE);
    let is_answered = |metric: &String| statistics.headline.contains(metric);
    let chance = statistics.chance.iter().filter(|row| of_chance(&row.metric));
    let levels: BTreeSet<_> = chance.map(|row| (&row.key.experiment, &row.metric, row.level.to_string())).collect();
    let models = statistics.models.iter().filter(|family| is_answered(&family.metric));
    let models = models.filter(|family| family.comparisons().any(|it| it.p.is_some())).count();
    let overall = statistics.overall.iter().filter(|row| is_answered(&row.metric) && row.p.is_some());
    let overall: BTreeSet<_> = overall.map(|row| &row.metric).collect();
    let tested = statistics.conditions.iter().filter(|it| is_answered(&it.metric) && it.comparison.p.is_some());
    let conditions: BTreeSet<_> = tested.map(|it| (&it.metric, &it.baseline, &it.against)).collect();
    levels.len() + models + overall.len() + conditions.len()
}

fn unranked(statistics: &Statistics) -> Vec<Answer> {
    let mut answers = Vec::new();
    let confidence = statistics.confidence;
    for metric in &statistics.headline {
        let whole = above(statistics, metric);
        let parts = |of: &IndexMap<&str, String>| of.values().cloned().collect::<Vec<String>>();
        answers.extend(Answer::new(ABOVE_CHANCE, metric, &parts(&whole)));
        for completed in statistics.relations.completed(metric) {
            let (same, other): (IndexMap<&str, String>, _) = above(statistics, completed)
                .into_iter()
                .partition(|(experiment, part)| whole.get(experiment) == Some(part));
            let same = same.into_keys().collect::<Vec<_>>().join(", ");
            let same = (!same.is_empty()).then(|| format!("{same} as {metric}"));
            answers.extend(Answer::new(ABOVE_CHANCE, completed, &[parts(&other), Vec::from_iter(same)].concat()));
        }
    }
    for metric in &statistics.headline {
        let families = statistics.models.iter().filter(|family| family.metric == *metric);
        let overall: Vec<_> = statistics.overall.iter().filter(|row| row.metric == *metric).collect();
        let separated = overall.iter().filter(|row| row.separated).map(|row| (&*row.first, &*row.second));
        let is_tested = overall.iter().any(|row| row.p.is_some());
        // If no experiment could show a difference, a missing difference over all of them is no answer either.
        let is_unsayable =
            !overall.iter().any(|row| row.separated) && families.clone().all(|family| family.cannot_say(confidence));
        let unsettled = overall.iter().filter(|row| row.losses.is_some_and(|losses| !losses.agree));
        let unsettled: Vec<String> = unsettled.map(|_| LOST.to_owned()).collect();
        let overall = match (overall.len(), is_tested) {
            (0, _) => None,
            (_, false) => Some("over all experiments not tested".to_owned()),
            _ if is_unsayable => Some("over all experiments cannot say".to_owned()),
            (all, true) => {
                let reach = || at_least(OverallRow::reach(&overall, confidence));
                Some(differing("over all experiments", all, separated, reach) + &unsaid_pairs(&unsettled))
            }
        }
        .map(|said| said + &opposite(&overall));
        let mut parts: Vec<String> = families.map(|family| differing_in(family, confidence)).chain(overall).collect();
        if parts.is_empty() && statistics.audit.cells.iter().any(|cell| cell.episodes == 0) {
            parts.push("not tested".to_owned());
        }
        answers.extend(Answer::new(WHO_DIFFERS, metric, &parts));
    }
    let question =
        if statistics.is_mirror { "What does the mirror change?" } else { "What does the experiment change?" };
    for metric in &statistics.headline {
        let parts = changes(&statistics.conditions, metric, confidence);
        answers.extend(Answer::new(question, metric, &parts));
    }
    answers
}

/// The pairs whose difference over all experiments is not that of each.
fn opposite(overall: &[&OverallRow]) -> String {
    let crossed: Vec<&&OverallRow> = overall.iter().filter(|row| row.is_crossed).collect();
    let withheld = crossed.first().map(|row| {
        let others = if crossed.len() > 1 { format!(" and {} more", crossed.len() - 1) } else { String::new() };
        format!(", cannot say for {} and {}{others}: opposite in {}", row.first, row.second, row.opposite.join(", "))
    });
    let mut against: IndexMap<(&str, &[String]), Vec<&str>> = IndexMap::new();
    for row in overall.iter().filter(|row| row.separated && !row.opposite.is_empty()) {
        against.entry((&row.first, &row.opposite)).or_default().push(&row.second);
    }
    let against = against.iter().map(|((first, experiments), seconds)| {
        format!(", {first} and {} the other way in {}", seconds.join(", "), experiments.join(", "))
    });
    withheld.into_iter().chain(against.take(MOST_NAMED)).collect()
}

fn unsaid_pairs(reasons: &[String]) -> String {
    let each: BTreeSet<&str> = reasons.iter().map(String::as_str).collect();
    let each = Vec::from_iter(each).join(" or ");
    match reasons.len() as u64 {
        0 => String::new(),
        count => format!(", cannot say for {}: {each}", format::counted(count, "pair")),
    }
}

/// The answer in each experiment.
fn above<'s>(statistics: &'s Statistics, metric: &str) -> IndexMap<&'s str, String> {
    let mut experiments: IndexMap<&str, Vec<&ChanceRow>> = IndexMap::new();
    for row in statistics.chance.iter().filter(|row| row.metric == metric) {
        experiments.entry(&row.key.experiment).or_default().push(row);
    }
    let of = |(experiment, rows): (&'s str, Vec<&ChanceRow>)| (experiment, above_in(experiment, &rows, statistics));
    experiments.into_iter().map(of).collect()
}

/// What an answer without a difference adds, since no difference shown is not equality.
fn at_least(reach: Option<f64>) -> String {
    let power = |reach| format!("80 % power from {}", format::fixed(Some(reach), 2));
    reach.map_or_else(|| "80 % power for no difference".to_owned(), power)
}

/// The name of a model with what a reader must know of its verdict: the means that it rests on, if the count of episodes
/// points the other way; and the episodes without a decision, which are below chance without a guess.
fn qualified(row: &ChanceRow, statistics: &Statistics) -> String {
    let mut notes = Vec::new();
    let pooled = row.successes as f64 / row.n as f64;
    let is_above = |rate: f64| rate > row.level.value();
    if let Some(mean) = row.unit_mean.filter(|mean| is_above(*mean) != is_above(pooled)) {
        let unit = row.units.as_ref().map_or("unit", |units| singular(&units.name));
        let mean = format::fixed(Some(mean), 3);
        notes.push(format!("{mean} by {unit}, {}/{} by episode", row.successes, row.n));
    }
    let unfinished = |duration: &&DurationRow| duration.key == row.key && duration.finished < duration.n;
    let completed: Vec<&str> = statistics.relations.completed(&row.metric).collect();
    let is_guess = |other: &ChanceRow| {
        completed.contains(&&*other.metric)
            && (&other.key, other.level, other.verdict) == (&row.key, row.level, Verdict::Below)
    };
    let is_silent = row.verdict == Verdict::Below && !completed.is_empty() && !statistics.chance.iter().any(is_guess);
    let silent = statistics.durations.iter().find(unfinished).filter(|_| is_silent);
    if let Some(duration) = silent {
        let silent = duration.n - duration.finished;
        notes.push(format!("no decision made in {silent} of {}", format::counted(duration.n, "episode")));
    }
    if notes.is_empty() { row.key.name() } else { format!("{} ({})", row.key.name(), notes.join("; ")) }
}

fn above_in(experiment: &str, rows: &[&ChanceRow], statistics: &Statistics) -> String {
    let confidence = statistics.confidence;
    let highest = |a: &&&ChanceRow, b: &&&ChanceRow| a.level.value().total_cmp(&b.level.value());
    let level =
        rows.iter().filter(|row| row.role == Role::Chance).max_by(highest).or_else(|| rows.iter().max_by(highest));
    let level = level.map(|row| (row.role, row.level));
    let rows: Vec<_> = rows.iter().filter(|row| Some((row.role, row.level)) == level).collect();
    let those = |verdict| {
        rows.iter().filter(|row| row.verdict == verdict).map(|row| qualified(row, statistics)).collect::<Vec<_>>()
    };
    let (above, below) = (those(Verdict::Above), those(Verdict::Below));
    let unsaid: Vec<(String, Units)> =
        rows.iter().filter_map(|row| Some((row.key.name(), row.unsaid(confidence)?))).collect();
    let about = match rows.first() {
        Some(row) if row.role == Role::Reference || row.strategy.is_some() => {
            format!("{experiment} ({} {})", row.role.name(), with_strategy(row.level, row.strategy.as_deref()))
        }
        _ => experiment.to_owned(),
    };
    if let Some((_, units)) = unsaid.iter().max_by_key(|(_, units)| units.n).filter(|_| unsaid.len() == rows.len()) {
        return format!("{about} {}", cannot_say(units));
    }
    let family: Vec<&ChanceRow> = rows.iter().map(|row| **row).collect();
    if let Some(units) = ChanceRow::hopeless(&family, confidence) {
        return format!("{about} {} for {}", cannot_say(&units), format::counted(rows.len() as u64, "model"));
    }
    // Qualified names are spelled out.
    let is_plain = rows.iter().all(|row| qualified(row, statistics) == row.key.name());
    let all = if is_plain { rows.len() } else { usize::MAX };
    let silent = above.is_empty().then(|| at_least(ChanceRow::reach(&family, confidence)));
    let below = (!below.is_empty()).then(|| format!("below: {}", names(&below, all)));
    let notes = below.into_iter().chain(silent).collect::<Vec<_>>().join("; ");
    let notes = if notes.is_empty() { notes } else { format!(" ({notes})") };
    let unsaid = unsaid.iter().map(|(model, units)| format!("cannot say for {model}: {}", units.counted()));
    let verdicts = format!("{about} {}{notes}", names(&above, all));
    [verdicts].into_iter().chain(unsaid).collect::<Vec<_>>().join(", ")
}

fn names(models: &[String], all: usize) -> String {
    match models.len() {
        0 => "nobody".to_owned(),
        count if count == all && count > 1 => format!("all {count}"),
        _ => models.join(", "),
    }
}

/// The answer if no outcome of these units could be significant.
fn cannot_say(units: &Units) -> String {
    format!("cannot say: {}", units.counted())
}

/// The reason why these comparisons cannot show a difference; `None` if any can.
fn untested(comparisons: &[&Comparison], confidence: f64) -> Option<String> {
    let unsaid = |found: &Comparison| found.unsaid(confidence);
    let is_tried =
        |found: &&&Comparison| found.incomparable.is_none() && (found.p.is_some() || unsaid(found).is_some());
    let mut tested = comparisons.iter().filter(is_tried).peekable();
    if tested.peek().is_none() {
        let selected = comparisons.iter().find_map(|found| found.selected.as_ref());
        let selected = selected.map(|selected| format!("not tested: {selected}"));
        return Some(apart(comparisons).or(selected).unwrap_or_else(|| "not tested".to_owned()));
    }
    let too_few = tested.map(|found| unsaid(found)).collect::<Option<Vec<_>>>()?;
    too_few.iter().max_by_key(|units| units.n).map(cannot_say)
}

fn apart(comparisons: &[&Comparison]) -> Option<String> {
    let settings: Vec<&String> = comparisons.iter().filter_map(|found| found.incomparable.as_ref()).collect();
    let setting = settings.first()?;
    let (count, all) = (settings.len(), comparisons.len());
    let count = if count == all { String::new() } else { format!("{count} of {all} ") };
    Some(format!("{count}not comparable ({setting})"))
}

impl Family {
    /// Returns true if none of the comparisons could have shown a difference.
    pub fn cannot_say(&self, confidence: f64) -> bool {
        unsayable(self, confidence).is_some()
    }
}

fn unsayable(family: &Family, confidence: f64) -> Option<String> {
    let comparisons: Vec<&Comparison> = family.comparisons().collect();
    untested(&comparisons, confidence).or_else(|| match family.detectable {
        Some(Reach { method, n, tests, family: None, .. }) => {
            let name = if method == Method::Mcnemar { "pair" } else { "episode" };
            Some(format!(
                "cannot say: {} for {}",
                format::counted(n, name),
                format::counted(tests as u64, "comparison")
            ))
        }
        _ => None,
    })
}

fn differing_in(family: &Family, confidence: f64) -> String {
    if let Some(why) = unsayable(family, confidence) {
        return format!("{} {why}", family.experiment);
    }
    let comparisons: Vec<&Comparison> = family.comparisons().collect();
    let separated = family.tests.iter().filter(|test| test.comparison.separated);
    let is_silent = |it: &&Comparison| !it.separated && it.incomparable.is_none();
    let reason = |it: &Comparison| match it.unsaid(confidence) {
        Some(units) if units.name == LOST => Some(units.name),
        Some(units) => Some(units.counted()),
        None => it.p.is_none().then(|| "not tested".to_owned()),
    };
    let unsaid: Vec<String> = comparisons.iter().copied().filter(is_silent).filter_map(reason).collect();
    let unsettled = unsaid_pairs(&unsaid);
    let pairs = separated.map(|test| (&*test.first, &*test.second));
    let reach = || at_least(reach(&comparisons, confidence));
    let differing = differing(&family.experiment, family.tests.len(), pairs, reach);
    let names: Vec<String> = family.tests.iter().map(|test| format!("{} and {}", test.first, test.second)).collect();
    let within = within(&names, &comparisons);
    let by_unit = family.tests.iter().filter_map(by_unit);
    let parts = [differing + &unsettled].into_iter().chain(within).chain(by_unit).chain(apart(&comparisons));
    parts.collect::<Vec<_>>().join(", ")
}

/// The comparisons whose difference is shown to be within the margin; `None` if no margin was asked for.
fn within(names: &[String], comparisons: &[&Comparison]) -> Option<String> {
    let margin = comparisons.iter().find_map(|it| it.equivalence)?.margin;
    let is_shown = |it: &Comparison| it.equivalence.is_some_and(|it| it.is_shown);
    let shown: Vec<&str> =
        names.iter().zip(comparisons).filter(|(_, it)| is_shown(it)).map(|(name, _)| name.as_str()).collect();
    Some(match shown.len() {
        0 => format!("none shown to be within {margin}"),
        count if count > MOST_NAMED => format!("{count} of {} within {margin}", names.len()),
        _ => format!("within {margin}: {}", shown.join(", ")),
    })
}

/// The means of a shown difference, if the counts of episodes point the other way.
fn by_unit(test: &PairTest) -> Option<String> {
    let found = test.comparison.separated.then_some(&test.comparison)?;
    let [first, second] = found.unit_means?.map(|mean| format::fixed(Some(mean), 3));
    let ([k, l], [m, n]) = (found.successes?, found.n);
    let is_turned = (k as f64 / m as f64 - l as f64 / n as f64) * found.difference? < 0.0;
    let unit = found.units.as_ref().map_or("unit", |units| singular(&units.name));
    is_turned.then(|| {
        format!("{} and {}: {first} and {second} by {unit}, {k}/{m} and {l}/{n} by episode", test.first, test.second)
    })
}

/// The separated pairs, grouped by the better model; `all` is the number of pairs, and `reach` says what would have
/// been shown.
fn differing<'n>(
    about: &str,
    all: usize,
    separated: impl Iterator<Item = (&'n str, &'n str)>,
    reach: impl Fn() -> String,
) -> String {
    let separated: Vec<_> = separated.collect();
    if separated.len() > MOST_NAMED {
        return format!("{about} {} of {}", separated.len(), format::counted(all as u64, "pair"));
    }
    let mut better: IndexMap<&str, Vec<&str>> = IndexMap::new();
    for (first, second) in separated {
        better.entry(first).or_default().push(second);
    }
    let over = |(first, seconds): (&str, Vec<&str>)| format!("{first} better than {}", seconds.join(", "));
    let parts: Vec<String> = better.into_iter().map(over).collect();
    let said = if parts.is_empty() { format!("nobody ({})", reach()) } else { parts.join(" and ") };
    format!("{about} {said}")
}

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
        found.map(|contrast| contrast.name()).collect()
    };
    let phrase = |what: &str, sign| {
        let models = those(Some(sign));
        (!models.is_empty()).then(|| format!("{what} {}", self::names(&models, group.len())))
    };
    let comparisons: Vec<&Comparison> = group.iter().map(|contrast| &contrast.comparison).collect();
    if let Some(why) = untested(&comparisons, confidence) {
        return format!("{baseline} - {against} {why}");
    }
    let is_silent = |it: &Comparison| it.sign().is_none() && it.incomparable.is_none();
    let silent = group.iter().filter(|contrast| is_silent(&contrast.comparison));
    let (unsaid, shown): (Vec<&&Contrast>, Vec<_>) = silent.partition(|it| it.comparison.cannot_say(confidence));
    let reach = || at_least(reach(&comparisons, confidence));
    let unshown = match (shown.len(), group.len()) {
        (0, _) => None,
        (rest, all) if rest == all => Some(format!("no change shown ({})", reach())),
        (rest, _) => Some(format!("no change shown for {rest} more ({})", reach())),
    };
    let names: Vec<String> = group.iter().map(|contrast| contrast.name()).collect();
    let unsaid = unsaid.into_iter().map(|contrast| {
        let model = contrast.name();
        let why = contrast.comparison.unsaid(confidence).map_or_else(|| "not tested".to_owned(), |it| it.counted());
        format!("cannot say for {model}: {why}")
    });
    let shown = [phrase("higher for", Sign::Higher), phrase("lower for", Sign::Lower), unshown].into_iter().flatten();
    let parts: Vec<String> =
        shown.chain(unsaid).chain(within(&names, &comparisons)).chain(apart(&comparisons)).collect();
    format!("{baseline} - {against} {}", parts.join(", "))
}

//! Conclusions in sentences, made from the numbers.

use indexmap::IndexMap;

use super::rates::chance::own_levels;
use super::{ChanceRow, DurationRow, Family, Method, Reach, Selection, Statistics, Verdict};
use crate::study::Study;
use mirrorstats_exact::format::{counted, fixed};
use mirrorstats_statistics::power::Detectable;

/// The metrics of conclusions: rates with a level, and durations. The first metric if there are neither.
pub(super) fn headline(study: &Study) -> Vec<String> {
    let has_level =
        |metric: &str| study.experiments.iter().any(|known| !own_levels(study, known.name, metric).is_empty());
    let rates = || study.rates().map(|column| column.name.as_str());
    let levelled: Vec<&str> = rates().filter(|metric| has_level(metric)).collect();
    let durations = study.relations.durations.iter().map(|(duration, _)| duration.as_str());
    let durations: Vec<&str> = durations.filter(|metric| study.column(metric).is_some()).collect();
    let first = match (levelled.is_empty(), durations.is_empty()) {
        (false, _) => None,
        (true, false) => rates().next(),
        (true, true) => study.table.metrics.first().map(|column| column.name.as_str()),
    };
    first.into_iter().chain(levelled).chain(durations).map(str::to_owned).collect()
}

pub(super) fn conclusions(statistics: &Statistics) -> Vec<String> {
    let is_headline = |metric: &String| statistics.headline.contains(metric);
    let families: Vec<&Family> = statistics.models.iter().filter(|family| is_headline(&family.metric)).collect();
    let mut sentences: Vec<String> = statistics.selection.iter().map(Selection::sentence).collect();
    sentences.extend(reaches(&families));
    sentences.extend(against_levels(&statistics.chance));
    sentences.extend(families.iter().map(|family| ties(family)));
    sentences.extend(unfinished(&statistics.durations));
    sentences
}

fn reaches(families: &[&Family]) -> Vec<String> {
    let mut shared: IndexMap<(Method, u64, usize), (Reach, Vec<String>)> = IndexMap::new();
    for family in families {
        let Some(reach) = family.detectable else { continue };
        let of_reach = shared.entry((reach.method, reach.n, reach.tests));
        of_reach.or_insert_with(|| (reach, Vec::new())).1.push(format!("{} {}", family.experiment, family.metric));
    }
    shared.into_values().map(|(reach, names)| reach_sentence(reach, &names)).collect()
}

fn reach_sentence(reach: Reach, names: &[String]) -> String {
    let is_paired = reach.method == Method::Mcnemar;
    let (about, n) = (names.join(", "), reach.n);
    let with = if is_paired { counted(n, "pair") } else { counted(n, "episode") + " per model" };
    let when = if is_paired { "if every disagreement points the same way" } else { "against a model without success" };
    let least = |found: Detectable| format!("{}/{} ({})", found.pairs, found.n, fixed(Some(found.smallest), 2));
    let Some(single) = reach.single.map(least) else {
        return format!("{about}: {with} cannot show any difference between two models, whatever the outcomes.");
    };
    let first = format!("as the first of {} under Holm", reach.tests);
    let rest = match reach.family.map(least) {
        None => format!(", {when}; {first} none could have been."),
        Some(family) => format!(" and {family} {first}, {when}."),
    };
    format!(
        "{about}: with {with}, the smallest difference between two models that could have been shown is {single} in one \
         comparison{rest}"
    )
}

fn against_levels(rows: &[ChanceRow]) -> Vec<String> {
    let mut groups: IndexMap<(&str, &str, String), Vec<&ChanceRow>> = IndexMap::new();
    for row in rows {
        groups.entry((&row.key.experiment, &row.metric, row.against())).or_default().push(row);
    }
    groups.iter().map(|((experiment, metric, level), rows)| level_sentence(experiment, metric, level, rows)).collect()
}

fn level_sentence(experiment: &str, metric: &str, level: &str, rows: &[&ChanceRow]) -> String {
    let those = |verdict| rows.iter().filter(|row| row.verdict == verdict).map(|row| row.key.name()).collect();
    let phrase = |what: &str, models: Vec<String>| match models.len() {
        0 => None,
        count if count == rows.len() && count > 1 => Some(format!("{what}: all {count} models")),
        _ => Some(format!("{what}: {}", models.join(", "))),
    };
    let parts = [
        phrase("above it", those(Verdict::Above)),
        phrase("below it", those(Verdict::Below)),
        phrase("not told apart from it", those(Verdict::NotSeparated)),
    ];
    let parts: Vec<String> = parts.into_iter().flatten().collect();
    format!("{experiment} {metric} against {level}: {}.", parts.join("; "))
}

fn ties(family: &Family) -> String {
    let about = format!("{} {}", family.experiment, family.metric);
    if let [all] = family.tied.as_slice() {
        return format!("{about}: no model is shown to be better than another (one tied set of {}).", all.len());
    }
    let sets: Vec<String> = family.tied.iter().map(|set| format!("{{{}}}", set.join(", "))).collect();
    format!("{about}: tied sets, best first: {}.", sets.join(" "))
}

fn unfinished(rows: &[DurationRow]) -> Vec<String> {
    let mut totals: IndexMap<&str, (u64, u64)> = IndexMap::new();
    for row in rows {
        let (unfinished, all) = totals.entry(&row.metric).or_default();
        *unfinished += row.n - row.finished;
        *all += row.n;
    }
    let sentence = |(metric, (unfinished, all)): (&str, (u64, u64))| {
        format!(
            "{metric}: {unfinished} of {} never finished and are censored; every comparison is of restricted means, \
             since the plain mean takes them as finished.",
            counted(all, "episode")
        )
    };
    totals.into_iter().filter(|(_, (unfinished, _))| *unfinished > 0).map(sentence).collect()
}

//! What a reader may and may not conclude, in sentences made from the numbers.

use std::collections::{BTreeMap, BTreeSet};

use indexmap::IndexMap;

use super::chance::levels;
use super::study::Study;
use super::{CENSORED, ChanceRow, DurationRow, FEW, Family, Reach, Role, Statistics, Verdict};
use crate::base::format::fixed;
use crate::stats::clustered::FEWEST_CLUSTERS;
use crate::stats::power::Detectable;

/// How many gaps a warning names before it counts the rest.
const NAMED_GAPS: usize = 5;

/// The metrics that conclusions are about: rates with a level to compare with, and durations.
/// The first metric where there is neither.
pub(super) fn headline(study: &Study) -> Vec<String> {
    let has_level = |metric: &str| study.experiments.iter().any(|known| !levels(study, known.name, metric).is_empty());
    let rates = study.rates().map(|column| column.name.as_str()).filter(|metric| has_level(metric));
    let durations = CENSORED.iter().map(|(duration, _)| *duration).filter(|metric| study.column(metric).is_some());
    let chosen: Vec<String> = rates.chain(durations).map(str::to_owned).collect();
    if chosen.is_empty() {
        return study.table.metrics.first().map(|column| column.name.clone()).into_iter().collect();
    }
    chosen
}

/// What the numbers allow to say about the headline metrics.
pub(super) fn conclusions(statistics: &Statistics) -> Vec<String> {
    let is_headline = |metric: &String| statistics.headline.contains(metric);
    let families: Vec<&Family> = statistics.models.iter().filter(|family| is_headline(&family.metric)).collect();
    let mut sentences = reaches(&families);
    sentences.extend(against_levels(&statistics.chance));
    sentences.extend(families.iter().map(|family| ties(family)));
    sentences.extend(unfinished(&statistics.durations));
    sentences
}

/// What the numbers of pairs could have shown, once for all experiments that share them.
fn reaches(families: &[&Family]) -> Vec<String> {
    let mut shared: IndexMap<(u64, usize), (Reach, Vec<String>)> = IndexMap::new();
    for family in families {
        let reach = family.detectable;
        let (_, names) = shared.entry((reach.n, reach.tests)).or_insert_with(|| (reach, Vec::new()));
        names.push(format!("{} {}", family.experiment, family.metric));
    }
    shared.into_values().map(|(reach, names)| reach_sentence(reach, &names)).collect()
}

fn reach_sentence(reach: Reach, names: &[String]) -> String {
    let least = |found: Option<Detectable>| match found {
        Some(found) => format!("{}/{} ({})", found.pairs, found.n, fixed(Some(found.smallest), 2)),
        None => "no difference at all".to_owned(),
    };
    format!(
        "{}: with {}, the smallest difference between two models that could have been shown is {} in one \
         comparison and {} as the first of {} under Holm, if every disagreement points the same way.",
        names.join(", "),
        if reach.n == 1 { "1 pair".to_owned() } else { format!("{} pairs", reach.n) },
        least(reach.single),
        least(reach.family),
        reach.tests,
    )
}

fn against_levels(rows: &[ChanceRow]) -> Vec<String> {
    let mut groups: IndexMap<(&str, &str, String), Vec<&ChanceRow>> = IndexMap::new();
    for row in rows {
        let role = match row.role {
            Role::Chance => "chance",
            Role::Reference => "the reference",
        };
        let level = format!("{role} ({})", row.level);
        groups.entry((&row.experiment, &row.metric, level)).or_default().push(row);
    }
    groups.iter().map(|((experiment, metric, level), rows)| level_sentence(experiment, metric, level, rows)).collect()
}

fn level_sentence(experiment: &str, metric: &str, level: &str, rows: &[&ChanceRow]) -> String {
    let those = |verdict| rows.iter().filter(|row| row.verdict == verdict).map(|row| row.model.as_str()).collect();
    let phrase = |what: &str, models: Vec<&str>| match models.len() {
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
            "{metric}: {unfinished} of {all} episodes never finished and are censored; compare medians and restricted \
             means, since the plain mean takes them as finished."
        )
    };
    totals.into_iter().filter(|(_, (unfinished, _))| *unfinished > 0).map(sentence).collect()
}

/// What the numbers do not allow to say.
pub(super) fn warnings(statistics: &Statistics) -> Vec<String> {
    let found = [few_seeds(statistics), few_episodes(statistics), gaps(statistics), losses(statistics)];
    found.into_iter().flatten().collect()
}

fn few_seeds(statistics: &Statistics) -> Option<String> {
    let mut blocks: BTreeMap<(&str, &str), usize> = BTreeMap::new();
    for row in &statistics.clusters {
        let seeds = blocks.entry((&row.experiment, &row.model)).or_default();
        *seeds = row.seeds.max(*seeds);
    }
    let fewest = blocks.into_values().min().filter(|&fewest| fewest < FEWEST_CLUSTERS)?;
    let seeds = if fewest == 1 { "1 seed".to_owned() } else { format!("{fewest} seeds") };
    Some(format!(
        "{seeds} are too few for a claim about new seeds: no test over fewer than {FEWEST_CLUSTERS} can reach p = 0.05. \
         Tests and intervals speak of new runs of these seeds; see the clustered intervals for how little is known beyond them."
    ))
}

fn few_episodes(statistics: &Statistics) -> Option<String> {
    let few = statistics.cells.iter().filter(|cell| cell.few).count();
    (few > 0).then(|| {
        format!(
            "{few} of {} cells are of conditional metrics with fewer than {FEW} defined episodes (marked with a dagger): \
             do not compare them.",
            statistics.cells.len()
        )
    })
}

fn gaps(statistics: &Statistics) -> Option<String> {
    let named: Vec<String> = statistics
        .gaps
        .iter()
        .take(NAMED_GAPS)
        .map(|gap| {
            let found = if gap.episodes == 0 { "missing".to_owned() } else { format!("{} episodes", gap.episodes) };
            format!("{} {} seed {} run {} ({found})", gap.experiment, gap.model, gap.seed, gap.run)
        })
        .collect();
    let rest = statistics.gaps.len().saturating_sub(named.len());
    let rest = if rest > 0 { format!("; and {rest} more") } else { String::new() };
    (!named.is_empty()).then(|| {
        format!(
            "{} places cannot be paired, for want of exactly one episode: {}{rest}.",
            statistics.gaps.len(),
            named.join("; ")
        )
    })
}

fn losses(statistics: &Statistics) -> Option<String> {
    if !statistics.losses.recorded {
        return Some(
            "the traces do not record how replies came (no reply_status): episodes lost to infrastructure, if any, are \
             counted as the model's own."
                .to_owned(),
        );
    }
    let lost: BTreeSet<(&str, &str, u64)> = statistics
        .losses
        .rows
        .iter()
        .map(|row| (row.experiment.as_str(), row.model.as_str(), row.lossy.lost))
        .collect();
    let total: u64 = lost.iter().map(|(.., lost)| lost).sum();
    (total > 0).then(|| {
        format!(
            "{total} episodes were lost to failures that are not the agent's (rate limit, server error, timeout): they are \
             in no denominator; the bounds under losses say what they could have changed."
        )
    })
}

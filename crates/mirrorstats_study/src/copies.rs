//! Copies of episodes in a study: every number counts them as independent episodes.

use std::collections::{BTreeMap, HashSet};

use crate::results::Results;
use crate::{Study, StudyError};
use mirrorstats_exact::escape::visible;
use mirrorstats_score::tables::table::{EpisodeTable, KeyRef};
use mirrorstats_trace::footers::declared::{Origin, StepHashes};
use mirrorstats_trace::read::open::TraceFile;
use mirrorstats_trace::validate::copies::{copies as find, decisive};

const NAMED: usize = 3;
/// Equal orders of episodes are named if chance gives fewer than one in a million.
const LEAST_ORDERS: f64 = 1e6;
/// 2^-10 by chance.
const FEWEST_DISTINCT: usize = 10;
/// Replies of a script on the same machine take less.
const LEAST_LATENCY: i64 = 50;
const FEWEST_LATENCIES: usize = 3;
/// The steps of a study that is searched for suspected copies: the search reads every column once more.
const MOST_SEARCHED: u64 = 1_000_000;

#[derive(Clone, Debug)]
pub(crate) struct Copies {
    pub phrase: String,
    pub sentence: String,
}

/// The episodes that are copies of others; `None` without copies, and for scores, which have no steps to compare.
pub(crate) fn copies(study: &Study, results: &Results) -> Result<Option<Copies>, StudyError> {
    let Ok(traces) = study.traces() else { return Ok(None) };
    let mut copy_candidates = results.copy_candidates.clone();
    if !copy_candidates.is_empty() {
        let counted: HashSet<&str> = results.episodes.keys.iter().map(|key| key.episode_id).collect();
        copy_candidates.retain(|id| counted.contains(id.as_str()));
    }
    let found = find(traces, &copy_candidates, study.threads)?;
    let named: Vec<String> = found.iter().take(NAMED).map(|it| named(&it.episode, &it.of)).collect();
    let rest = found.len().saturating_sub(NAMED);
    let rest = if rest > 0 { format!("; and {rest} more") } else { String::new() };
    let (episodes, count) = match found.len() {
        0 => return Ok(None),
        1 => ("episode is a copy of another", 1),
        count => ("episodes are copies of others", count),
    };
    let phrase = format!("{count} {episodes}");
    let sentence = format!(
        "{phrase} under another id ({}{rest}): every number and test counts them as independent; leave them out.",
        named.join("; ")
    );
    Ok(Some(Copies { phrase, sentence }))
}

/// Episodes that may be copies of others under another model, seed or run, or with other latencies: their steps are
/// those of others. `None` without any, and without [`steps`].
pub(crate) fn suspected(study: &Study, results: &Results) -> Result<Option<String>, StudyError> {
    let table = &results.episodes;
    let mut known = steps(study, table)?;
    // Rows are in the order of experiment, model, seed and run.
    let rows: Vec<(KeyRef<'_>, StepHashes)> =
        table.keys.iter().filter_map(|key| Some((key, known.remove(key.episode_id)?))).collect();
    let cells: Vec<_> = rows.chunk_by(|a, b| (a.0.experiment, a.0.model) == (b.0.experiment, b.0.model)).collect();
    for (at, first) in cells.iter().enumerate() {
        let name = visible(first[0].0.model);
        let is_same = |second: &&&[(KeyRef<'_>, StepHashes)]| {
            second[0].0.experiment == first[0].0.experiment && are_repeated(&prints(first), &prints(second))
        };
        if let Some(second) = cells[at + 1..].iter().find(is_same) {
            let (experiment, other) = (visible(first[0].0.experiment), visible(second[0].0.model));
            return Ok(Some(format!(
                "{experiment}: {other} has the steps of {name}, episode by episode: suspected copies"
            )));
        }
        let seeds: Vec<Vec<_>> = first.chunk_by(|a, b| a.0.seed == b.0.seed).map(prints).collect();
        let is_repeated = |(at, one): (usize, &Vec<_>)| seeds[at + 1..].iter().any(|other| are_repeated(one, other));
        if seeds.iter().enumerate().any(is_repeated) || is_multiple(&prints(first)) {
            let experiment = visible(first[0].0.experiment);
            return Ok(Some(format!(
                "{experiment} {name}: seeds or runs repeat each other step by step: suspected copies"
            )));
        }
    }
    let jittered = jittered(&rows);
    let phrase =
        || format!("{jittered} episodes have the steps and, within 1 %, the latencies of others: suspected copies");
    Ok((jittered > 0).then(phrase))
}

/// Hashes of the steps of the episodes, which scores carry. Empty for large studies; for reconstructions, whose steps
/// are made up; and for scripts, which act alike in equal scenes.
pub(crate) fn steps(study: &Study, table: &EpisodeTable) -> Result<BTreeMap<String, StepHashes>, StudyError> {
    let Ok(traces) = study.traces() else { return Ok(table.declared.steps.clone()) };
    let is_made_up = table.declared.origin == Some(Origin::Reconstruction);
    let is_large = traces.files().iter().map(TraceFile::rows).sum::<u64>() > MOST_SEARCHED;
    let mut recordings = table.declared.recordings.values();
    if is_large || is_made_up || recordings.any(|recording| !recording["agent"]["scripted"].is_null()) {
        return Ok(BTreeMap::new());
    }
    Ok(decisive(traces, study.threads)?)
}

type Print = (u64, u64);

fn prints(rows: &[(KeyRef<'_>, StepHashes)]) -> Vec<Print> {
    rows.iter().map(|(_, found)| found.print).collect()
}

fn counts(prints: &[Print]) -> BTreeMap<Print, u32> {
    let mut counts = BTreeMap::new();
    for print in prints {
        *counts.entry(*print).or_default() += 1;
    }
    counts
}

/// True if two lists are equal, in order or not, though random ones would hardly be. Of equal sets, the number of
/// distinct orders is the multinomial coefficient. Two sets are equal by chance with at most the probability that a
/// distribution with the shares of the first gives to its counts.
fn are_repeated(first: &[Print], second: &[Print]) -> bool {
    let found = counts(first);
    let factorial = |n: u32| (1..=n).map(|k| f64::from(k).ln()).sum::<f64>();
    let all = u32::try_from(first.len()).unwrap_or(u32::MAX);
    let orders = factorial(all) - found.values().map(|n| factorial(*n)).sum::<f64>();
    let shares = found.values().map(|n| f64::from(*n) * (f64::from(*n) / f64::from(all)).ln()).sum::<f64>();
    let rare = -LEAST_ORDERS.ln();
    first == second && -orders < rare || orders + shares < rare && found == counts(second)
}

/// True if each of many distinct episodes is there twice, or three times, ...: by chance, half of the counts are odd.
fn is_multiple(prints: &[Print]) -> bool {
    let counts = counts(prints);
    let common = counts.values().fold(0, |common, count| gcd(common, *count));
    common > 1 && counts.len() >= FEWEST_DISTINCT
}

fn gcd(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// The episodes with the steps and nearly the latencies of an earlier one, where latencies differ between episodes.
fn jittered(rows: &[(KeyRef<'_>, StepHashes)]) -> usize {
    let first = |found: &StepHashes| found.latencies.first().copied();
    let all: Vec<i64> = rows.iter().filter_map(|(_, found)| first(found)).collect();
    let (least, most) = (all.iter().min().copied().unwrap_or(0), all.iter().max().copied().unwrap_or(0));
    if least < LEAST_LATENCY || most * 10 < least * 11 {
        return 0;
    }
    let mut groups: BTreeMap<Print, Vec<&StepHashes>> = BTreeMap::new();
    for (_, found) in rows.iter().filter(|(_, found)| found.latencies.len() >= FEWEST_LATENCIES) {
        groups.entry(found.print).or_default().push(found);
    }
    let is_near = |a: &StepHashes, b: &StepHashes| {
        a.latencies.len() == b.latencies.len()
            && a.latencies.iter().zip(&b.latencies).all(|(a, b)| (a - b).abs() * 100 <= *a.max(b))
    };
    let of_group = |group: &Vec<&StepHashes>| {
        let (mut found, mut originals): (usize, Vec<&StepHashes>) = (0, Vec::new());
        for episode in group {
            if originals.iter().any(|original| is_near(original, episode)) {
                found += 1;
            } else {
                originals.push(episode);
            }
        }
        found
    };
    groups.values().map(of_group).sum()
}

fn named(episode: &str, of: &str) -> String {
    format!("`{}` of `{}`", visible(episode), visible(of))
}

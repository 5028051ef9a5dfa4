//! Warnings about conclusions, and limits of the design, in sentences made from the numbers.

use std::collections::{BTreeMap, BTreeSet};

use super::comparisons::matching::Matching;
use super::episodes::first_named;
use super::{CellRow, FEW, Gap, Replies, RowKey, Selection, Statistics};
use mirrorstats_exact::format::{counted, p_value};
use mirrorstats_statistics::comparisons::holm::level;
use mirrorstats_statistics::design::{Cluster, DesignKind};
use mirrorstats_statistics::intervals::clustered::fewest_clusters;

/// The most gaps that a warning names; others are counted.
const NAMED_GAPS: usize = 5;

/// The number of characters shown of a scene's name, since fingerprints are long.
const SCENE_SHOWN: usize = 16;

pub(super) fn design_note(statistics: &Statistics) -> String {
    let (paired, all) = pairings(statistics);
    if statistics.design.kind == Some(DesignKind::Reconstruction) {
        return "reconstructed episodes: their seeds, runs and scenes are made up, so nothing is paired or clustered and every \
                test takes episodes as independent; no number here says more about a model than the aggregates that the \
                episodes were made from"
            .to_owned();
    }
    let has_scenes = matchings(statistics).any(|matching| matching.pairs + matching.alone + matching.repeated > 0);
    if statistics.design.kind.is_none() && statistics.design.cluster.is_none() && !has_scenes {
        return "the traces declare no design: episodes are taken as independent, nothing is paired or clustered; record or import \
                them with a column `scene` and the design in the footer to have pairs"
            .to_owned();
    }
    let kind = match statistics.design.kind {
        Some(DesignKind::Import) => "imported episodes",
        Some(DesignKind::Recording) => "recorded episodes",
        _ => "episodes of an undeclared kind",
    };
    let pairs = match (has_scenes, paired) {
        _ if all == 0 => "there is nothing to compare".to_owned(),
        (false, _) => "no scenes are declared, so nothing is paired".to_owned(),
        (true, 0) => format!("none of {} has pairs of equal scenes", counted(all as u64, "comparison")),
        (true, 1) => format!("1 of {} is by pairs of equal scenes", counted(all as u64, "comparison")),
        (true, _) => format!("{paired} of {all} comparisons are by pairs of equal scenes"),
    };
    let clusters = match statistics.design.clusters() {
        Some(Cluster::Seed) => "seeds are clusters",
        None => "no clusters are declared",
    };
    format!("{kind}; {pairs}; {clusters}")
}

fn matchings(statistics: &Statistics) -> impl Iterator<Item = &Matching> {
    let models = statistics.models.iter().flat_map(|family| &family.tests).map(|test| &test.matching);
    models.chain(statistics.conditions.iter().map(|contrast| &contrast.matching))
}

fn pairings(statistics: &Statistics) -> (usize, usize) {
    let (models, conditions) = (&statistics.models, &statistics.conditions);
    let models = models.iter().filter(|family| family.metric == models[0].metric).flat_map(|family| &family.tests);
    let conditions = conditions.iter().filter(|contrast| contrast.metric == conditions[0].metric);
    let matchings = models.map(|test| &test.matching).chain(conditions.map(|contrast| &contrast.matching));
    (matchings.clone().filter(|matching| matching.paired).count(), matchings.count())
}

pub(super) fn warnings(statistics: &Statistics) -> Vec<String> {
    let chosen = statistics.selection.as_ref().filter(|selection| selection.by_results);
    let found = [
        chosen.map(Selection::sentence),
        matches!(statistics.design.kind, None | Some(DesignKind::Reconstruction))
            .then(|| format!("{}.", statistics.design_note)),
        repeated(statistics),
        few_seeds(statistics),
        few_episodes(statistics),
        gaps(statistics),
        losses(statistics),
        statistics.replies.as_ref().and_then(Replies::sentence),
    ];
    found.into_iter().flatten().collect()
}

fn repeated(statistics: &Statistics) -> Option<String> {
    let most = matchings(statistics).map(|matching| matching.repeated).max().filter(|&most| most > 0)?;
    let unpaired = matchings(statistics).any(|matching| matching.repeated > 0 && !matching.paired);
    let follows = if unpaired { "; a test counts each scene once" } else { "" };
    Some(format!(
        "up to {most} episodes of a comparison share a scene that one side has more than once: they are not pairs{follows}."
    ))
}

fn few_seeds(statistics: &Statistics) -> Option<String> {
    let level = level(statistics.confidence)?;
    let mut blocks: BTreeMap<&RowKey, usize> = BTreeMap::new();
    for row in &statistics.clusters {
        let seeds = blocks.entry(&row.key).or_default();
        *seeds = row.seeds.max(*seeds);
    }
    let needed = fewest_clusters(level);
    let fewest = blocks.into_values().min().filter(|&fewest| fewest < needed)?;
    let verb = if fewest == 1 { "is" } else { "are" };
    Some(format!(
        "{} {verb} too few for a claim about new seeds: no test over fewer than {needed} can reach p = {}. \
         Tests and intervals are by seed.",
        counted(fewest as u64, "seed"),
        p_value(Some(level)).trim_end_matches('0')
    ))
}

fn few_episodes(statistics: &Statistics) -> Option<String> {
    let few: Vec<&CellRow> = statistics.cells.iter().filter(|cell| cell.few).collect();
    let metrics: BTreeSet<&str> = few.iter().map(|cell| cell.metric.as_str()).collect();
    (!few.is_empty()).then(|| {
        format!(
            "{} of {} cells are of conditional metrics with fewer than {FEW} defined episodes ({}): do not compare them.",
            few.len(),
            statistics.cells.len(),
            metrics.into_iter().collect::<Vec<_>>().join(", ")
        )
    })
}

fn gaps(statistics: &Statistics) -> Option<String> {
    let places = match statistics.gaps.len() {
        0 => return None,
        1 => "1 scene of a model is".to_owned(),
        count => format!("{count} scenes of models are"),
    };
    let gap = |gap: &Gap| {
        let found = if gap.episodes == 0 { "missing".to_owned() } else { counted(gap.episodes as u64, "episode") };
        let scene: String = gap.scene.chars().take(SCENE_SHOWN).collect();
        format!("{} {} scene {scene} ({found})", gap.key.experiment, gap.key.name())
    };
    let gaps = first_named(statistics.gaps.iter().map(gap), NAMED_GAPS);
    Some(format!("{places} not paired, as pairs need exactly one episode per scene: {gaps}."))
}

fn losses(statistics: &Statistics) -> Option<String> {
    if !statistics.losses.recorded {
        let words = "neither reply_status nor a list of lost episodes records how replies came: episodes lost to \
                     infrastructure, if any, are counted as the model's own.";
        return Some(words.to_owned());
    }
    let total = lost(statistics);
    let (lost, they) = if total == 1 { ("was", "it is") } else { ("were", "they are") };
    (total > 0).then(|| {
        format!(
            "{} {lost} lost without an answer (a crash, a rate limit, a server error, a timeout): {they} \
             in no denominator; the bounds under losses say what they could have changed.",
            counted(total, "episode")
        )
    })
}

pub(super) fn lost(statistics: &Statistics) -> u64 {
    let rows = statistics.losses.rows.iter();
    let lost: BTreeSet<(&RowKey, u64)> = rows.map(|row| (&row.key, row.lossy.lost)).collect();
    lost.iter().map(|(_, lost)| lost).sum()
}

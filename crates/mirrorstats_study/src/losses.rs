//! Episodes lost because no answer came: ended by the infrastructure, or never recorded.
//!
//! Rule: a lost episode is neither a success nor a failure. Denominators exclude lost episodes, or on request include
//! all of them as failures; the answer says which. A file of scores keeps their rows, marked by the label `lost`.

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::path::{Path, PathBuf};

use crate::results::Results;
use crate::{Study, StudyError};
use mirrorstats_analysis::statistics::Replies;
use mirrorstats_exact::escape::visible;
use mirrorstats_metric::catalogs::catalog::{Better, Catalog, Kind};
use mirrorstats_score::tables::builder::TableBuilder;
use mirrorstats_score::tables::lost_counts::LostCounts;
use mirrorstats_score::tables::table::{
    CONDITION, EpisodeTable, KeyRef, LOST, LabelColumn, MetricColumn, UNUSABLE_REPLIES,
};
use mirrorstats_trace::beside::lost::{self, LostEpisode};
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::schema;

const YES: &str = "true";

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LostAs {
    #[default]
    Nothing,
    /// Failures, in the denominator of every rate that is defined for all episodes.
    Failure,
}

#[derive(Debug)]
pub(crate) struct Counted {
    pub results: Results,
    pub all: Option<EpisodeTable>,
    pub lost: LostCounts,
}

impl Counted {
    /// The episodes that count, and how many were lost.
    pub(crate) fn of(results: Results, lost_as: LostAs) -> Self {
        let lost = LostCounts::of_table(&results.episodes);
        if lost.is_empty() {
            return Self { results, all: None, lost };
        }
        match lost_as {
            LostAs::Nothing => without(results, lost),
            LostAs::Failure => {
                let episodes = with_failures(&results.episodes);
                // Episodes without a look, claim or decision have no timeline.
                let timelines = results.timelines.filter(|timelines| timelines.len() == episodes.len());
                let all = Some(episodes.clone());
                Self { results: Results { episodes, timelines, ..results }, all, lost }
            }
        }
    }

    pub(crate) fn replies(&self) -> Option<Replies> {
        Replies::from_table(self.all.as_ref().unwrap_or(&self.results.episodes))
    }
}

/// The episodes in the lists beside the inputs that no trace has. A list may be of more models than the inputs: those
/// without any episode count only if the inputs are all traces of their folders, without a filter.
pub(crate) fn unrecorded(study: &Study, table: &EpisodeTable) -> Result<Vec<LostEpisode>, StudyError> {
    let mut listed = lost::beside(&study.inputs)?;
    if listed.is_empty() {
        return Ok(listed);
    }
    let ids: HashSet<&str> = table.keys.iter().map(|key| key.episode_id).collect();
    let models: BTreeSet<&str> = table.keys.model.iter().flatten().collect();
    let is_whole = study.question.filter.is_none() && are_whole_folders(&study.inputs);
    let is_known = |episode: &LostEpisode| is_whole || models.contains(episode.model.as_str());
    listed.retain(|episode| !ids.contains(episode.episode_id.as_str()) && is_known(episode));
    Ok(listed)
}

fn are_whole_folders(given: &[Input]) -> bool {
    let paths: BTreeSet<&Path> = given.iter().map(|input| input.path.as_path()).collect();
    let folders: BTreeSet<&Path> = given.iter().filter_map(|input| input.path.parent()).collect();
    let inside = |folder: &Path| {
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        let files = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
        files.filter(|path| path.extension().is_some_and(|extension| extension == "parquet")).collect::<Vec<_>>()
    };
    let is_given = |path: PathBuf| paths.contains(path.strip_prefix(".").unwrap_or(&path)) || paths.contains(&*path);
    folders.into_iter().flat_map(inside).all(is_given)
}

pub(crate) fn label(results: &mut Results) {
    let Results { episodes, lost, quality, .. } = results;
    if let Some(ids) = lost.as_ref().filter(|ids| !ids.is_empty()) {
        let is_lost = |row| ids.contains(episodes.keys.get(row).episode_id).then_some(YES);
        let values = (0..episodes.len()).map(is_lost).collect();
        episodes.labels.push(LabelColumn { name: LOST.to_owned(), values });
    }
    if let Some(quality) = quality {
        let replies = quality.take_by_episode();
        if !replies.is_empty() {
            let text = |row| replies.get(episodes.keys.get(row).episode_id).map(ToString::to_string);
            let values = (0..episodes.len()).map(text).collect();
            episodes.labels.push(LabelColumn { name: UNUSABLE_REPLIES.to_owned(), values });
        }
        for (key, lost) in LostCounts::of_table(episodes).iter() {
            quality.0.entry(key.clone()).or_default().lost = Some(*lost);
        }
        if lost.is_some() || !episodes.declared.unrecorded.is_empty() {
            quality.0.values_mut().for_each(|quality| quality.lost = quality.lost.or(Some(0)));
        }
    }
}

/// A line that names the cells with lost episodes or replies without a decision; `None` without any.
pub(crate) fn beside_cells(lost: &LostCounts, replies: Option<&Replies>) -> Option<String> {
    const NAMED: usize = 8;
    let mut cells: BTreeMap<[&str; 2], [u64; 3]> = BTreeMap::new();
    for (key, count) in lost.iter() {
        cells.entry([&key.experiment, &key.model]).or_default()[0] += count;
    }
    for it in replies.into_iter().flat_map(|replies| &replies.cells) {
        let counts = cells.entry([&it.key.experiment, &it.key.model]).or_default();
        (counts[1], counts[2]) = (counts[1] + it.unusable, counts[2] + it.replies);
    }
    let words = |([experiment, model], [lost, unusable, replies]): (&[&str; 2], &[u64; 3])| {
        let lost = (*lost > 0).then(|| format!("{lost} lost"));
        let unusable = (*unusable > 0).then(|| format!("{unusable} of {replies} replies without a decision"));
        let what: Vec<String> = lost.into_iter().chain(unusable).collect();
        format!("{} {} {}", visible(experiment), visible(model), what.join(", "))
    };
    let named: Vec<String> = cells.iter().take(NAMED).map(words).collect();
    let rest = cells.len().saturating_sub(NAMED);
    let rest = if rest > 0 { format!("; and {rest} more") } else { String::new() };
    (!named.is_empty()).then(|| format!("Beside the numbers: {}{rest}.", named.join("; ")))
}

/// `2 episodes were lost without an answer`.
pub(crate) fn lost_episodes(lost: u64) -> String {
    let (noun, verb) = if lost == 1 { ("episode", "was") } else { ("episodes", "were") };
    format!("{lost} {noun} {verb} lost without an answer")
}

fn without(results: Results, lost: LostCounts) -> Counted {
    let all = results.episodes;
    let kept: Vec<usize> = (0..all.len()).filter(|row| !all.is_lost(*row)).collect();
    let mut episodes = all.taken(&kept);
    episodes.labels.retain(|label| label.name != LOST);
    let timelines = results.timelines;
    let timelines = timelines.map(|timelines| kept.iter().map(|row| timelines[*row].clone()).collect());
    Counted { results: Results { episodes, timelines, ..results }, all: Some(all), lost }
}

/// Adds a row for each episode that was never recorded: a failure in each rate that every episode has, otherwise
/// undefined.
fn with_failures(table: &EpisodeTable) -> EpisodeTable {
    let mut builder = TableBuilder::new(table.header());
    for row in 0..table.len() {
        let labels = table.labels.iter().map(|label| label.values.get(row));
        builder.push(table.keys.get(row), labels, table.metrics.iter().map(|metric| metric.get(row)));
    }
    for episode in &table.declared.unrecorded {
        let key = KeyRef {
            experiment: &episode.experiment,
            model: &episode.model,
            seed: episode.seed,
            run: episode.run,
            episode_id: &episode.episode_id,
        };
        let label = |label: &LabelColumn| match label.name.as_str() {
            LOST => Some(YES),
            CONDITION => episode.condition.as_deref().or_else(|| schema::column(CONDITION)?.default_text()),
            _ => None,
        };
        let failure = |metric: &MetricColumn| failure(&table.catalog, &metric.name);
        builder.push(key, table.labels.iter().map(label), table.metrics.iter().map(failure));
    }
    EpisodeTable { declared: table.declared.clone(), ..builder.finish() }
}

fn failure(catalog: &Catalog, metric: &str) -> Option<i64> {
    let metric = catalog.metric.get(metric)?;
    match (metric.kind, metric.better) {
        (Kind::Rate, Better::Higher) if metric.when.is_none() => Some(0),
        (Kind::Rate, Better::Lower) if metric.when.is_none() => Some(1),
        _ => None,
    }
}

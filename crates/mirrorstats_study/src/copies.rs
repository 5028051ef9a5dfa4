//! Copies of episodes in a study: every number counts them as independent episodes.

use std::collections::{BTreeMap, BTreeSet};

use crate::{Study, StudyError};
use mirrorstats_exact::escape::visible;
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_trace::copies::copies as find;

const NAMED: usize = 3;

#[derive(Clone, Debug)]
pub(crate) struct Copies {
    pub phrase: String,
    pub sentence: String,
}

/// The episodes that are copies of others; `None` without copies, and for scores, which have no steps to compare.
pub(crate) fn copies(study: &Study, table: &EpisodeTable) -> Result<Option<Copies>, StudyError> {
    let Ok(traces) = study.traces() else { return Ok(None) };
    let found = find(traces, alike(table), study.threads)?;
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

fn named(episode: &str, of: &str) -> String {
    format!("`{}` of `{}`", visible(episode), visible(of))
}

/// The episodes that share their keys and scores with another one.
fn alike(table: &EpisodeTable) -> BTreeSet<String> {
    let mut groups: BTreeMap<_, Vec<usize>> = BTreeMap::new();
    for (row, key) in table.keys.iter().enumerate() {
        let scores: Vec<Option<i64>> = table.metrics.iter().map(|metric| metric.get(row)).collect();
        groups.entry((key.experiment, key.model, key.seed, key.run, scores)).or_default().push(row);
    }
    let several = groups.into_values().filter(|rows| rows.len() > 1).flatten();
    several.map(|row| table.keys.get(row).episode_id.to_owned()).collect()
}

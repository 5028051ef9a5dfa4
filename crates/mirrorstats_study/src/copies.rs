//! Copies of episodes in a study: every number counts them as independent episodes.

use std::collections::HashSet;

use crate::results::Results;
use crate::{Study, StudyError};
use mirrorstats_exact::escape::visible;
use mirrorstats_trace::copies::copies as find;

const NAMED: usize = 3;

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

fn named(episode: &str, of: &str) -> String {
    format!("`{}` of `{}`", visible(episode), visible(of))
}

//! A filter that keeps no episode: how many there are, and what the columns that it names hold.
//!
//! Rule: what cannot bear a conclusion is refused. Reports, statistics, figures and comparisons of no episode are errors;
//! tables for programs (`score`, `query`) stay tables without rows, and a note says so.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::num::NonZeroUsize;

use super::args::ScoringArgs;
use super::listing::counted;
use super::outcome::Failure;
use super::{output, scoring};
use crate::base::visible::visible;
use crate::cells::cell::KeyValue;
use crate::cells::group::{KEY_COLUMNS, column_values};
use crate::metric::names::mentioned;
use crate::score::score_traces;
use crate::score::table::EpisodeTable;
use crate::trace::inputs::Input;

/// Values of a column that are listed.
const LISTED: usize = 8;

/// Refuses no episodes where a filter is why there are none.
///
/// # Errors
/// Such a filter; what is wrong with the traces without it.
pub fn check(episodes: usize, inputs: &[Input], asked: &ScoringArgs, threads: NonZeroUsize) -> Result<(), Failure> {
    match words(episodes, inputs, asked, threads)? {
        None => Ok(()),
        Some(words) => Err(Failure::Rendered(format!(
            "error: {words}\n  help: give a filter that holds for some of them, or none"
        ))),
    }
}

/// Says so where a filter is why a table has no rows.
///
/// # Errors
/// What is wrong with the traces without the filter.
pub fn note(episodes: usize, inputs: &[Input], asked: &ScoringArgs, threads: NonZeroUsize) -> Result<(), Failure> {
    if let Some(words) = words(episodes, inputs, asked, threads)? {
        output::note(&words);
    }
    Ok(())
}

/// What there is to say about a filter that keeps none.
fn words(
    episodes: usize,
    inputs: &[Input],
    asked: &ScoringArgs,
    threads: NonZeroUsize,
) -> Result<Option<String>, Failure> {
    let Some(condition) = asked.condition.as_deref().filter(|_| episodes == 0) else { return Ok(None) };
    let names = mentioned(condition);
    let all = unfiltered(inputs, asked, &names, threads)?;
    let mut words =
        format!("the filter `{}` keeps none of {}", visible(condition), counted(all.len() as u64, "episode"));
    for name in &names {
        if let Some(values) = column_values(&all, name) {
            let _ = write!(words, "\n  {}: {}", visible(name), listed(&values));
        }
    }
    Ok(Some(words))
}

/// All episodes, with the columns of these names.
fn unfiltered(
    inputs: &[Input],
    asked: &ScoringArgs,
    names: &[String],
    threads: NonZeroUsize,
) -> Result<EpisodeTable, Failure> {
    let whole = ScoringArgs { definitions: asked.definitions.clone(), metrics: None, condition: None };
    if scoring::are_scores(inputs) {
        return scoring::table(inputs, &whole, &[], threads);
    }
    let traces = scoring::open(inputs)?;
    let is_label =
        |name: &&String| !KEY_COLUMNS.contains(&name.as_str()) && score_traces::check_label(&traces, name).is_ok();
    let labels: Vec<String> = names.iter().filter(is_label).cloned().collect();
    let known = scoring::metric_names(&traces, &whole)?;
    let metrics = names.iter().filter(|name| known.contains(name)).cloned().collect();
    scoring::table(inputs, &ScoringArgs { metrics: Some(metrics), ..whole }, &labels, threads)
}

/// The first values of a column: texts as SQL has them.
fn listed(values: &BTreeSet<KeyValue>) -> String {
    let one = |value: &KeyValue| match value {
        KeyValue::Missing => "null".to_owned(),
        KeyValue::Int(value) => value.to_string(),
        KeyValue::Text(text) => format!("'{}'", visible(text)),
    };
    let mut shown: Vec<String> = values.iter().take(LISTED).map(one).collect();
    if values.len() > LISTED {
        shown.push(format!("... ({} in all)", values.len()));
    }
    shown.join(", ")
}

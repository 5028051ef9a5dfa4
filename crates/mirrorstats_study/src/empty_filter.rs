//! A filter that keeps no episode: the number of episodes, and the values of the columns that it names.
//!
//! Rule: an empty selection supports no conclusion. Reports, statistics, figures and comparisons without episodes are
//! errors; tables for programs (`score`, `query`) are empty tables, with a note.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::num::NonZeroUsize;

use crate::inputs::Source;
use crate::question::Question;
use crate::{StudyError, scores};
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::format::counted;
use mirrorstats_metric::names::mentioned;
use mirrorstats_score::cells::KeyValue;
use mirrorstats_score::cells::group::{KEY_COLUMNS, column_values};
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_score::{score_traces, vocabulary};

const LISTED: usize = 8;

/// The explanation of a filter that keeps no episode; `None` without a filter.
pub(crate) fn explained(
    source: &Source,
    question: &Question,
    threads: NonZeroUsize,
) -> Result<Option<String>, StudyError> {
    let Some(filter) = question.filter.as_deref() else { return Ok(None) };
    let names = mentioned(filter);
    let all = unfiltered(source, question, &names, threads)?;
    let episodes = counted(all.len() as u64, "episode");
    let mut words = format!("the filter `{}` keeps none of {episodes}", visible(filter));
    for name in &names {
        if let Some(values) = column_values(&all, name) {
            let _ = write!(words, "\n  {}: {}", visible(name), listed(&values));
        }
    }
    Ok(Some(words))
}

fn unfiltered(
    source: &Source,
    question: &Question,
    names: &[String],
    threads: NonZeroUsize,
) -> Result<EpisodeTable, StudyError> {
    let Question { definitions, each, parts, .. } = question.clone();
    let whole = Question { definitions, each, parts, ..Question::default() };
    let traces = match source {
        Source::Scores(files) => return scores::read(files, &whole),
        Source::Traces(traces) => traces,
    };
    let is_label =
        |name: &&String| !KEY_COLUMNS.contains(&name.as_str()) && vocabulary::check_label(traces, name).is_ok();
    let labels: Vec<String> = names.iter().filter(is_label).cloned().collect();
    let known = whole.load(&vocabulary::trace_columns(traces))?.catalog.metric;
    let metrics = names.iter().filter(|name| known.contains_key(*name)).cloned().collect();
    let question = Question { metrics: Some(metrics), ..whole };
    Ok(score_traces::score(traces, &question.bind(traces)?, &labels, threads)?)
}

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

//! One scan of traces, and all its results.

use std::collections::BTreeSet;
use std::num::NonZeroUsize;

use crate::StudyError;
use crate::design;
use crate::own_definitions::check_scored;
use crate::question::{Question, STANDING_LABELS};
use crate::results::{Outputs, Results};
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_score::quality::QualityReader;
use mirrorstats_score::score_traces::{self, Scored};
use mirrorstats_score::tables::table::{EpisodeTable, LabelColumn};
use mirrorstats_score::vocabulary;
use mirrorstats_statistics::losses::INFRASTRUCTURE;
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::schema::{self, Column, Domain};
use mirrorstats_trace::validate::replies::REPLY_STATUS;

/// Columns that are read beyond those of the definitions: invalid values in them do not prevent scoring.
pub(crate) const UNCHECKED: [&str; 1] = [REPLY_STATUS];

pub(crate) fn scan(
    traces: &TraceSet,
    question: &Question,
    outputs: Outputs,
    threads: NonZeroUsize,
) -> Result<Results, StudyError> {
    let mut labels = question.labels_over(traces);
    if outputs.design {
        design::add_labels(&mut labels, traces);
    }
    let definitions = question.bind(traces)?;
    let reader = if outputs.quality { QualityReader::of(traces) } else { QualityReader::of_statuses(traces) };
    let wanted = score_traces::Outputs {
        labels: &labels,
        timelines: outputs.timelines,
        quality: (outputs.quality || !reader.columns().is_empty()).then_some(&reader),
        unchecked: &UNCHECKED,
        copy_candidates: outputs.copy_candidates,
    };
    let (scored, lost) = score_with_losses(traces, &[&definitions], wanted, threads)?;
    let Scored { tables, timelines, quality, copy_candidates } = scored;
    let [episodes] = <[_; 1]>::try_from(tables).expect("a table per definitions");
    check_scored(&definitions, traces, &episodes)?;
    Ok(Results { timelines, lost, quality, copy_candidates, ..Results::of(episodes) })
}

/// Scores traces under each of these definitions. The same scan finds the lost episodes; `None` if the traces do not
/// record them.
pub(crate) fn score_with_losses(
    traces: &TraceSet,
    definitions: &[&Definitions],
    outputs: score_traces::Outputs<'_>,
    threads: NonZeroUsize,
) -> Result<(Scored, Option<BTreeSet<String>>), StudyError> {
    let lost = lost_episodes(traces)?;
    let all: Vec<&Definitions> = definitions.iter().copied().chain(&lost).collect();
    let mut scored = score_traces::score_all(traces, &all, outputs, threads)?;
    let lost = lost.and_then(|_| scored.tables.pop());
    let ids = |table: EpisodeTable| table.keys.iter().map(|key| key.episode_id.to_owned()).collect();
    Ok((scored, lost.map(ids)))
}

/// Episodes that the infrastructure ended: without `done`, their last reply lost. `None` if the traces do not record
/// it.
fn lost_episodes(traces: &TraceSet) -> Result<Option<Definitions>, StudyError> {
    let status = traces.column(REPLY_STATUS);
    if traces.domain() == Domain::Own
        || status.is_none_or(|column| column.missing_from.is_some() || column.conflict.is_some())
    {
        return Ok(None);
    }
    let columns = vocabulary::trace_columns(traces);
    let statuses: Vec<String> = INFRASTRUCTURE.iter().map(|status| format!("'{status}'")).collect();
    let ended = format!("first(action = 'done') is null and at(reply_status, length()) in ({})", statuses.join(", "));
    Ok(Some(Definitions::without_metrics(&columns)?.filtered("losses", &ended, &columns)?))
}

pub(crate) fn says_something(label: &LabelColumn) -> bool {
    let default = schema::column(&label.name).and_then(Column::default_text);
    !STANDING_LABELS.contains(&label.name.as_str()) || label.values.iter().any(|text| text.is_some() && text != default)
}

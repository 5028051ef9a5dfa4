//! The one scan of the inputs, and all its results.

use std::collections::BTreeSet;
use std::thread;

use crate::inputs::{self, Source};
use crate::question::STANDING_LABELS;
use crate::results::{Outputs, Results};
use crate::spark::SparkJob;
use crate::{Study, StudyError, losses, own_definitions, scores};
use mirrorstats_engines::spark::Cluster;
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_score::quality::QualityReader;
use mirrorstats_score::score_traces::{self, Scored};
use mirrorstats_score::tables::table::{EpisodeTable, KeyRef, LabelColumn};
use mirrorstats_score::vocabulary;
use mirrorstats_statistics::losses::INFRASTRUCTURE;
use mirrorstats_trace::beside::labels::PREFIX;
use mirrorstats_trace::footers::declared::Declared;
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::schema::{self, Column, Domain};
use mirrorstats_trace::validate::replies::REPLY_STATUS;

impl Study {
    /// Reads the inputs once. A file that changed since it was opened is an error. Errors: faults of the traces or the
    /// scores; numbers beyond 64 bits; a file that changed in between.
    pub fn scan(&self, outputs: Outputs) -> Result<Results, StudyError> {
        let (results, inputs) = thread::scope(|scope| {
            // Hashing reads the same pages; on its own thread it does not slow the scan.
            let hashing = outputs.hashes.then(|| scope.spawn(|| inputs::hashes(&self.inputs)));
            let results = self.scan_rows(outputs);
            let inputs = hashing.map(|thread| thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
            (results, inputs)
        });
        // A changed file explains any other error.
        self.check_unchanged()?;
        let mut results = Results { inputs: inputs.transpose()?.unwrap_or_default(), ..results? };
        self.declare(&mut results)?;
        results.quality = results.quality.filter(|_| outputs.quality);
        Ok(results)
    }

    pub(crate) fn declare(&self, results: &mut Results) -> Result<(), StudyError> {
        if let Source::Traces(traces) = &self.source {
            let unrecorded = losses::unrecorded(&self.inputs, &results.episodes)?;
            let losses_recorded = results.lost.is_some();
            results.episodes.declared = Declared { unrecorded, losses_recorded, ..Declared::from_traces(traces) };
        }
        let asked = self.question.labels();
        results.episodes.labels.retain(|label| asked.contains(&label.name) || says_something(label));
        losses::label(results);
        Ok(())
    }

    /// Returns true if the definitions or the filter read coders' labels. Errors: scores in the place of traces; every
    /// fault of the definitions.
    pub fn reads_labels(&self) -> Result<bool, StudyError> {
        let traces = self.traces()?;
        let plan = self.question.bind(traces)?.plan;
        Ok(plan.columns(&plan.needed()).iter().any(|(name, _)| traces.is_label_column(name)))
    }

    /// The results of an earlier scan with the current coders' labels. Errors: scores in the place of traces.
    pub fn relabelled(&self, mut results: Results) -> Result<Results, StudyError> {
        let traces = self.traces()?;
        let EpisodeTable { labels, keys, .. } = &mut results.episodes;
        labels.retain(|label| !label.name.starts_with(PREFIX));
        labels.extend(traces.label_columns().iter().map(|name| {
            let value = |key: KeyRef<'_>| traces.labels().value(name, key.episode_id).map(|is| is.to_string());
            LabelColumn { name: name.clone(), values: keys.iter().map(value).collect() }
        }));
        Ok(results)
    }

    /// The episode table, computed by Spark. Lost episodes, which Spark does not know, come from a scan. Errors: as
    /// [`Study::score`]; scores in the place of traces; faults of Spark.
    pub fn score_on(&self, cluster: Cluster) -> Result<EpisodeTable, StudyError> {
        let traces = self.traces()?;
        let episodes = SparkJob::of_study(self, cluster)?.score()?;
        own_definitions::check(&self.question.bind(traces)?, traces, &episodes)?;
        let mut results = Results::of(episodes);
        if traces.column(REPLY_STATUS).is_some() {
            let scanned = self.scan_traces(traces, Outputs { losses: true, ..Outputs::default() })?;
            results = Results { episodes: results.episodes, ..scanned };
        }
        self.check_unchanged()?;
        self.declare(&mut results)?;
        Ok(results.episodes)
    }

    fn scan_rows(&self, outputs: Outputs) -> Result<Results, StudyError> {
        let mut results = match &self.source {
            Source::Scores(files) => Results::of(scores::read(files, &self.question)?),
            Source::Traces(traces) => self.scan_traces(traces, outputs)?,
        };
        results.select(outputs);
        Ok(results)
    }

    fn scan_traces(&self, traces: &TraceSet, outputs: Outputs) -> Result<Results, StudyError> {
        let labels = self.question.labels_over(traces);
        let definitions = self.question.bind(traces)?;
        let statuses = outputs.losses.then(|| QualityReader::of_statuses(traces));
        let statuses = statuses.filter(|reader| !reader.columns().is_empty());
        let reader = outputs.quality.then(|| QualityReader::of(traces)).or(statuses);
        let timelines = outputs.timelines || outputs.outcomes;
        let quality = reader.as_ref();
        let wanted = score_traces::Outputs {
            labels: &labels,
            timelines,
            quality,
            unchecked: &UNCHECKED,
            copy_candidates: outputs.copy_candidates,
        };
        let lost = if outputs.losses { lost_episodes(traces)? } else { None };
        let all: Vec<&Definitions> = std::iter::once(&definitions).chain(&lost).collect();
        let Scored { tables, timelines, quality, copy_candidates } =
            score_traces::score_all(traces, &all, wanted, self.threads)?;
        let mut tables = tables.into_iter();
        let episodes = tables.next().expect("a table per definitions");
        own_definitions::check(&definitions, traces, &episodes)?;
        let lost = tables.next().map(|table| ids(&table));
        Ok(Results { timelines, lost, quality, copy_candidates, ..Results::of(episodes) })
    }
}

pub(crate) fn ids(table: &EpisodeTable) -> BTreeSet<String> {
    table.keys.iter().map(|key| key.episode_id.to_owned()).collect()
}

fn says_something(label: &LabelColumn) -> bool {
    let default = schema::column(&label.name).and_then(Column::default_text);
    !STANDING_LABELS.contains(&label.name.as_str()) || label.values.iter().any(|text| text.is_some() && text != default)
}

/// Columns that are read beyond those of the definitions: invalid values in them do not prevent scoring.
pub(crate) const UNCHECKED: [&str; 1] = [REPLY_STATUS];

/// Episodes that the infrastructure ended: without `done`, their last reply lost. `None` if the traces do not record
/// it.
pub(crate) fn lost_episodes(traces: &TraceSet) -> Result<Option<Definitions>, StudyError> {
    let status = traces.column("reply_status");
    if traces.domain() == Domain::Own
        || status.is_none_or(|column| column.missing_from.is_some() || column.conflict.is_some())
    {
        return Ok(None);
    }
    let columns = vocabulary::trace_columns(traces);
    let statuses: Vec<String> = INFRASTRUCTURE.iter().map(|status| format!("'{status}'")).collect();
    let ended = format!("first(action = 'done') is null and at(reply_status, length()) in ({})", statuses.join(", "));
    // No metric and every experiment: only the filter is needed.
    let nothing = Definitions::from_toml("losses", "open = true", &columns)?;
    Ok(Some(nothing.filtered("losses", &ended, &columns)?))
}

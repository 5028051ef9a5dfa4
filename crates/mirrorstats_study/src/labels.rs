//! The current coders' labels in the results of an earlier scan.

use crate::results::Results;
use crate::{Study, StudyError};
use mirrorstats_score::tables::table::{EpisodeTable, KeyRef, LabelColumn};
use mirrorstats_trace::beside::labels::PREFIX;

/// Returns true if the definitions or the filter read coders' labels. Errors: scores in the place of traces; every
/// fault of the definitions.
pub fn reads_labels(study: &Study) -> Result<bool, StudyError> {
    let traces = study.traces()?;
    let plan = study.question.bind(traces)?.plan;
    Ok(plan.columns(&plan.needed()).iter().any(|(name, _)| traces.is_label_column(name)))
}

/// The results of an earlier scan with the current coders' labels. Errors: scores in the place of traces.
pub fn relabelled(study: &Study, mut results: Results) -> Result<Results, StudyError> {
    let traces = study.traces()?;
    let EpisodeTable { labels, keys, .. } = &mut results.episodes;
    labels.retain(|label| !label.name.starts_with(PREFIX));
    labels.extend(traces.label_columns().iter().map(|name| {
        let value = |key: KeyRef<'_>| traces.labels().value(name, key.episode_id).map(|is| is.to_string());
        LabelColumn { name: name.clone(), values: keys.iter().map(value).collect() }
    }));
    Ok(results)
}

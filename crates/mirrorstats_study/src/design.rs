//! The design of a study: labels of the audit, and settings by the files that declare them.

use std::collections::BTreeSet;
use std::sync::Arc;

use serde_json::Value;

use crate::{Study, StudyError};
use mirrorstats_analysis::comparable::{BODY_COLOR, FINGERPRINT, ORIGIN, REPETITION, divide_scenes_by_color};
use mirrorstats_exact::hash;
use mirrorstats_score::tables::table::{EpisodeTable, LabelColumn};
use mirrorstats_trace::footers::declared::Declared;
use mirrorstats_trace::read::open::{TraceFile, TraceSet};
use mirrorstats_trace::scan::episode_places;

pub(crate) const LABELS: [&str; 2] = [BODY_COLOR, REPETITION];
/// Digits of the hash that distinguishes two fingerprints of one name.
const DIGITS: usize = 8;

/// Declares the settings of each episode by the content of its file: one name for two contents becomes two names, and
/// files of different kinds give each episode its kind.
pub(crate) fn declare(study: &Study, traces: &TraceSet, table: &mut EpisodeTable) -> Result<(), StudyError> {
    let recordings: Vec<Value> = traces.files().iter().map(TraceFile::recording).collect();
    let kinds: Vec<Option<&str>> = recordings.iter().map(|recording| recording["kind"].as_str()).collect();
    let has_kinds = kinds.iter().collect::<BTreeSet<_>>().len() > 1 && table.label(ORIGIN).is_none();
    if has_kinds || !table.declared.ambiguous.is_empty() {
        let places = episode_places(traces, study.threads)?;
        let files: Vec<Option<usize>> =
            table.keys.iter().map(|key| places.get(key.episode_id).map(|place| place.file)).collect();
        if has_kinds {
            let kind = |file: &Option<usize>| file.and_then(|file| kinds[file]);
            let values = files.iter().map(kind).collect();
            table.labels.push(LabelColumn { name: ORIGIN.to_owned(), values });
        }
        by_content(table, &recordings, &files);
    }
    divide_scenes_by_color(table);
    Ok(())
}

fn by_content(table: &mut EpisodeTable, recordings: &[Value], files: &[Option<usize>]) {
    let ambiguous = std::mem::take(&mut table.declared.ambiguous);
    let Some(column) = table.label(FINGERPRINT).filter(|_| !ambiguous.is_empty()) else {
        table.declared.ambiguous = ambiguous;
        return;
    };
    let content = |name: &str, file: usize| {
        let parts = &recordings[file]["fingerprints"][name];
        format!("{name}/{}", hash::of_bytes(parts.to_string().as_bytes()).chars().take(DIGITS).collect::<String>())
    };
    let renamed = |(row, file): (usize, &Option<usize>)| {
        let name = column.get(row)?;
        let new = file.filter(|_| ambiguous.contains(name)).map(|file| content(name, file));
        Some(new.unwrap_or_else(|| name.to_owned()))
    };
    let values: Vec<Option<String>> = files.iter().enumerate().map(renamed).collect();
    let values = values.iter().map(Option::as_deref).collect();
    let Declared { fingerprints, recordings: shared, .. } = &mut table.declared;
    for (file, recording) in recordings.iter().enumerate() {
        let named = ambiguous.iter().filter(|name| !recording["fingerprints"][name.as_str()].is_null());
        for name in named {
            fingerprints.insert(content(name, file), recording["fingerprints"][name.as_str()].clone());
            shared.insert(content(name, file), Arc::new(recording.clone()));
        }
    }
    table.labels.retain(|label| label.name != FINGERPRINT);
    table.labels.push(LabelColumn { name: FINGERPRINT.to_owned(), values });
}

/// Removes the labels of the audit, except those that were asked for.
pub(crate) fn remove_labels(table: &mut EpisodeTable, asked: &[String]) {
    table.labels.retain(|label| !LABELS.contains(&label.name.as_str()) || asked.contains(&label.name));
}

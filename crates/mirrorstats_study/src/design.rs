//! The design of a study: labels of the audit, and settings by the files that declare them.

use serde_json::Value;

use crate::question::add_new;
use crate::{Study, StudyError};
use mirrorstats_analysis::comparable::{BODY_COLOR, FINGERPRINT, ORIGIN, REPETITION, divide_scenes_by_color};
use mirrorstats_exact::hash;
use mirrorstats_score::tables::table::{EpisodeTable, LabelColumn};
use mirrorstats_trace::footers::declared::{Declared, Origin};
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::scan::episode_places;

pub(crate) const LABELS: [&str; 2] = [BODY_COLOR, REPETITION];
/// Digits of the hash that distinguishes two fingerprints of one name.
const DIGITS: usize = 8;

/// Adds the labels that the audit reads.
pub(crate) fn add_labels(labels: &mut Vec<String>, traces: &TraceSet) {
    add_new(labels, LABELS.into_iter().filter(|name| traces.declares(name)));
}

/// Declares the settings of each episode by the content of its file.
pub(crate) fn declare(study: &Study, traces: &TraceSet, table: &mut EpisodeTable) -> Result<(), StudyError> {
    let files: Vec<Declared> = Declared::of_files(traces).collect();
    if differ_in_kind(&files) || !table.declared.ambiguous.is_empty() {
        let places = episode_places(traces, study.threads)?;
        by_file(table, &files, |episode| places.get(episode).map(|place| place.file));
    }
    divide_scenes_by_color(table);
    Ok(())
}

fn differ_in_kind(files: &[Declared]) -> bool {
    files.iter().any(|file| file.origin != files[0].origin)
}

/// One fingerprint for two contents becomes two, and files of different kinds give each episode its kind.
pub(crate) fn by_file(table: &mut EpisodeTable, files: &[Declared], file_of: impl Fn(&str) -> Option<usize>) {
    let places: Vec<Option<usize>> = table.keys.iter().map(|key| file_of(key.episode_id)).collect();
    if differ_in_kind(files) && table.label(ORIGIN).is_none() {
        let kind = |file: &Option<usize>| file.and_then(|file| files[file].origin).map(Origin::name);
        table.labels.push(LabelColumn { name: ORIGIN.to_owned(), values: places.iter().map(kind).collect() });
    }
    let mut ambiguous = files.iter().cloned().reduce(Declared::joined).unwrap_or_default().ambiguous;
    // Within a file, nothing says which content is meant.
    ambiguous.retain(|name| files.iter().all(|file| !file.ambiguous.contains(name)));
    let Some(column) = table.label(FINGERPRINT).filter(|_| !ambiguous.is_empty()) else { return };
    let content = |name: &str, file: usize| {
        let parts = files[file].fingerprints.get(name).unwrap_or(&Value::Null);
        format!("{name}/{}", hash::of_bytes(parts.to_string().as_bytes()).chars().take(DIGITS).collect::<String>())
    };
    let renamed = |(row, file): (usize, &Option<usize>)| {
        let name = column.get(row)?;
        let new = file.filter(|_| ambiguous.contains(name)).map(|file| content(name, file));
        Some(new.unwrap_or_else(|| name.to_owned()))
    };
    let values: Vec<Option<String>> = places.iter().enumerate().map(renamed).collect();
    let values = values.iter().map(Option::as_deref).collect();
    let Declared { fingerprints, recordings, ambiguous: unsettled, .. } = &mut table.declared;
    for name in &ambiguous {
        fingerprints.remove(name);
        unsettled.remove(name);
        for (file, declared) in files.iter().enumerate() {
            let parts = declared.fingerprints.get(name).cloned();
            fingerprints.extend(parts.map(|parts| (content(name, file), parts)));
            let recording = declared.recordings.get(name).cloned();
            recordings.extend(recording.map(|recording| (content(name, file), recording)));
        }
    }
    table.labels.retain(|label| label.name != FINGERPRINT);
    table.labels.push(LabelColumn { name: FINGERPRINT.to_owned(), values });
}

/// Removes the labels of the audit that say nothing: each episode the first repetition, and colours without scenes.
pub(crate) fn remove_plain_labels(table: &mut EpisodeTable, asked: &[String]) {
    let has_scenes = table.label("scene").is_some();
    let says_nothing = |label: &LabelColumn| match label.name.as_str() {
        REPETITION => label.values.iter().all(|text| text.is_none_or(|text| text == "1")),
        BODY_COLOR => !has_scenes,
        _ => false,
    };
    table.labels.retain(|label| asked.contains(&label.name) || !says_nothing(label));
}

/// Removes the labels of the audit, except those that were asked for, and the hashes of steps.
pub(crate) fn remove_labels(table: &mut EpisodeTable, asked: &[String]) {
    table.declared.steps.clear();
    table.labels.retain(|label| !LABELS.contains(&label.name.as_str()) || asked.contains(&label.name));
}

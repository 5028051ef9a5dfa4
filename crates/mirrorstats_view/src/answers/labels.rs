//! Labels and notes: coders' judgements of an episode, and the lines that a page may add.

use std::path::PathBuf;

use serde::Deserialize;
use serde_json::{Value, json};

use crate::{Snapshot, View, ViewError};
use mirrorstats_exact::escape::{visible, visible_lines};
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_trace::beside::label_line::LabelLine;
use mirrorstats_trace::beside::labels::{Mark, PREFIX, append, list_beside};
use mirrorstats_trace::read::open::TraceSet;

/// A label as sent by a page; the server knows the coder's name.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Asked {
    id: String,
    step: Option<u32>,
    label: Option<String>,
    note: Option<String>,
    #[serde(default)]
    removed: bool,
}

/// The marks of an episode, followed by those of its steps.
pub(crate) fn of_episode(snapshot: &Snapshot, id: &str) -> Value {
    let labels = snapshot.scored.as_ref().and_then(|scored| scored.study.traces().ok()).map(TraceSet::labels);
    let entry = |Mark { coder, step, label, note }: Mark<'_>| json!({"coder": visible(coder), "step": step, "label": label, "note": note.map(visible_lines)});
    labels.map_or_else(|| json!([]), |labels| labels.of_episode(id).map(entry).collect())
}

pub(crate) fn of_row(table: &EpisodeTable, row: usize) -> Vec<&str> {
    let put = table.labels.iter().filter(|label| label.values.get(row) == Some("true"));
    put.filter_map(|label| label.name.strip_prefix(PREFIX)).collect()
}

/// Appends a line from a page to the list beside the episode's trace; returns the episode's marks.
pub(crate) fn put(view: &View, body: &[u8]) -> Result<Value, ViewError> {
    let Some(coder) = view.options.coder.clone() else {
        let words = "this page only shows; `mirrorstats view --label NAME` lets you label as NAME";
        return Err(ViewError::Request(words.to_owned()));
    };
    let asked: Asked = serde_json::from_slice(body)
        .map_err(|error| ViewError::Request(format!("expected a label, found {}", visible(&error.to_string()))))?;
    let given = |text: Option<String>| text.map(|text| text.trim().to_owned()).filter(|text| !text.is_empty());
    let (label, note) = (given(asked.label), given(asked.note));
    let line = LabelLine { coder, episode_id: asked.id, step: asked.step, label, note, removed: asked.removed };
    line.check().map_err(|invalid| ViewError::Request(invalid.to_string()))?;
    append(&list_of(&view.newest(), &line)?, &line)?;
    view.refresh()?;
    Ok(of_episode(&view.newest(), &line.episode_id))
}

/// The list for a line; the line's episode and step must exist.
fn list_of(snapshot: &Snapshot, line: &LabelLine) -> Result<PathBuf, ViewError> {
    let id = &line.episode_id;
    let (input, steps) = snapshot
        .scored
        .as_ref()
        .and_then(|scored| scored.place(id))
        .ok_or_else(|| ViewError::Absent(format!("no whole episode `{}`", visible(id))))?;
    match line.step.filter(|step| *step as usize > steps) {
        Some(step) => Err(ViewError::Request(format!("expected a step from 1 to {steps}, found {step}"))),
        None => Ok(list_beside(&input.path)),
    }
}

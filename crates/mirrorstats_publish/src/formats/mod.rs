//! Other programs' formats: the episodes of a study, and what a format cannot hold.

mod every_eval_ever;
mod inspect_scout;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use mirrorstats_exact::replace::{TemporaryFolder, folder_of, make_folder};
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_study::Study;
use mirrorstats_trace::episodes::episode::Episode;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::episode_rows::{self, Displayed, EpisodeRows};
use serde_json::{Map, Value};

use crate::about::About;
use crate::manifest::list;
use crate::{Progress, PublishError, is_empty, put};

/// A format of another program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportFormat {
    /// Every Eval Ever 0.3: results with intervals, and one line per episode and rate.
    EveryEvalEver,
    /// Transcripts of Inspect Scout: one row per episode.
    InspectScout,
}

/// Columns that say nothing to a reader of one episode.
const TECHNICAL: [&str; 4] = ["episode_hash", "fingerprint", "frame_digest", "frame_time"];

/// Writes a study into a folder; returns the files, and what the format cannot hold.
pub fn export(
    study: &Study,
    format: ExportFormat,
    about: &About,
    out: &Path,
    progress: Progress<'_>,
) -> Result<(Vec<String>, Vec<String>), PublishError> {
    if !is_empty(out) {
        let name = out.display();
        return Err(PublishError::Refused(format!(
            "--out: expected a new folder, found `{name}`\n  help: name another folder"
        )));
    }
    let parent = folder_of(out);
    make_folder(parent).map_err(PublishError::file(parent))?;
    let stage = TemporaryFolder::create(parent, "export").map_err(PublishError::file(parent))?;
    progress("episodes");
    let left_out = match format {
        ExportFormat::EveryEvalEver => every_eval_ever::write_all(study, about, stage.path())?,
        ExportFormat::InspectScout => inspect_scout::write_all(study, stage.path())?,
    };
    let files = list(stage.path())?;
    put(stage.path(), out, &files, None)?;
    Ok((files, left_out))
}

/// One episode for a transcript.
pub(crate) struct Transcript {
    /// The identity; its steps have no values.
    pub head: Episode,
    /// What the agent said or did in each step.
    pub said: Vec<String>,
}

impl Transcript {
    /// The messages: the request, then what the agent said or did in each step. `message` takes the position, the role
    /// and the text.
    fn messages(&self, experiment: &str, message: impl Fn(usize, &str, &str) -> Value) -> Vec<Value> {
        let ask = format!("{experiment}: the observation of each step, until the agent decides");
        let answers = self.said.iter().zip(1..).map(|(text, at)| message(at, "assistant", text));
        std::iter::once(message(0, "user", &ask)).chain(answers).collect()
    }
}

/// The episodes of a study that count, by id.
fn transcripts(study: &Study, episodes: &EpisodeTable) -> Result<BTreeMap<String, Transcript>, PublishError> {
    let counted: BTreeSet<&str> = episodes.keys.iter().map(|key| key.episode_id).collect();
    let mut found = BTreeMap::new();
    for file in study.traces()?.files() {
        let input = Input { name: file.name().to_owned(), path: file.path().to_owned() };
        for rows in episode_rows::read(&input.path)? {
            if counted.contains(rows.episode_id.as_str()) {
                let refused = |error| PublishError::Refused(format!("{}: {error}", input.name));
                let transcript = Transcript { head: rows.identity().map_err(refused)?, said: said(&rows) };
                found.insert(rows.episode_id, transcript);
            }
        }
    }
    Ok(found)
}

/// The raw reply of each step; without one, its columns as JSON.
fn said(rows: &EpisodeRows) -> Vec<String> {
    let mut steps: Vec<Map<String, Value>> = vec![Map::new(); rows.len()];
    for column in rows.own_columns() {
        if TECHNICAL.contains(&column.name.as_str()) {
            continue;
        }
        for (step, value) in steps.iter_mut().zip(column.values()) {
            let value = match value {
                None => continue,
                Some(Displayed::Bool(value)) => value.into(),
                Some(Displayed::Text(text)) => text.into(),
            };
            step.insert(column.name.clone(), value);
        }
    }
    let text = |step: Map<String, Value>| match step.get("reply") {
        Some(Value::String(reply)) => reply.clone(),
        _ => Value::Object(step).to_string(),
    };
    steps.into_iter().map(text).collect()
}

//! Copies what a bundle is made from: traces, logs and lists; definitions, style and prompts.
//!
//! Rule: a trace is copied byte for byte, except that the episodes of people who declined or withdrew are left out.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::format::counted;
use mirrorstats_exact::replace::{folder_of, make_folder};
use mirrorstats_exact::{hash, input};
use mirrorstats_experiment::prompt::Templates;
use mirrorstats_log::assemble;
use mirrorstats_metric::file;
use mirrorstats_report::style;
use mirrorstats_score::vocabulary::trace_columns;
use mirrorstats_study::Study;
use mirrorstats_study::question::Question;
use mirrorstats_trace::beside::labels::{self, list_beside};
use mirrorstats_trace::beside::lost::list_of;
use mirrorstats_trace::read::episode_rows::{self, Displayed, EpisodeRows};
use mirrorstats_trace::read::open::{TraceFile, TraceSet};
use mirrorstats_trace::write::merge;
use serde::Deserialize;

use crate::derive::prompt_of;
use crate::manifest::{Frames, Withheld};
use crate::{PublishError, write};

pub(crate) const TRACES: &str = "traces";
const PROMPTS: &str = "prompts";
const PARTICIPANT: &str = "participant";
/// The journal of a recording with people, which is never published.
const JOURNAL: &str = "participants.jsonl";
const LONGEST_LINE: Limit = Limit::new("bytes in a line of the journal of participants", 4 << 20);

/// Copies traces, their lists and, for frames, their logs. Returns what was withheld.
pub(crate) fn copy_traces(
    traces: &TraceSet,
    frames: Frames,
    base: &Path,
    notes: &mut Vec<String>,
) -> Result<Vec<Withheld>, PublishError> {
    let folder = base.join(TRACES);
    make_folder(&folder).map_err(PublishError::file(&folder))?;
    let (mut withheld, mut taken, mut gone) = (BTreeSet::new(), BTreeSet::new(), BTreeSet::new());
    for file in traces.files() {
        let to = folder.join(free_name(file, &mut taken));
        let out = withdrawn(folder_of(file.path()))?;
        let own = copy_trace(file, &to, &out, &mut withheld)?;
        let log = file.path().with_extension("mcap");
        if log.is_file() && frames != Frames::None && to.is_file() {
            let to = to.with_extension("mcap");
            copy(&log, &to)?;
            if !own.is_empty() {
                assemble::without(&to, &own, &file.recording())?;
            }
        }
        if log.is_file() && frames != Frames::All {
            withheld.insert(Withheld {
                kind: "log".to_owned(),
                sha256: input::open(&log).and_then(hash::of_reader).map_err(PublishError::file(&log))?,
                reason: "frames were left out".to_owned(),
            });
        }
        gone.extend(own);
    }
    copy_lists(traces, &folder)?;
    let labels = folder.join("labels.jsonl");
    labels::remove(&labels, &gone)?;
    if !gone.is_empty() {
        let episodes = counted(gone.len() as u64, "episode");
        notes.push(format!("{episodes} of people who declined or withdrew are not in the bundle"));
    }
    Ok(withheld.into_iter().collect())
}

/// The file's own name, or the first free one with a number.
fn free_name(file: &TraceFile, taken: &mut BTreeSet<String>) -> String {
    let name = Path::new(file.name());
    let stem = name.file_stem().map_or_else(|| "trace".to_owned(), |stem| stem.to_string_lossy().into_owned());
    let names = std::iter::once(stem.clone()).chain((2..).map(|number| format!("{stem}-{number}")));
    let free = names.map(|name| format!("{name}.parquet")).find(|name| !taken.contains(name)).unwrap_or(stem);
    taken.insert(free.clone());
    free
}

/// Copies a trace without the episodes of these people; returns the ids of their episodes.
fn copy_trace(
    file: &TraceFile,
    to: &Path,
    people: &BTreeSet<String>,
    withheld: &mut BTreeSet<Withheld>,
) -> Result<BTreeSet<String>, PublishError> {
    if people.is_empty() || !file.declares(PARTICIPANT) {
        copy(file.path(), to)?;
        return Ok(BTreeSet::new());
    }
    let (mut own, mut others) = (BTreeSet::new(), Vec::new());
    for rows in episode_rows::read(file.path())? {
        if participant(&rows).is_some_and(|code| people.contains(&code)) {
            let sha256 = rows.stated_hash().unwrap_or_else(|| hash::of_bytes(rows.episode_id.as_bytes()));
            let reason = "the person declined or withdrew".to_owned();
            withheld.insert(Withheld { kind: "episode".to_owned(), sha256, reason });
            own.insert(rows.episode_id.clone());
        } else {
            others.push(rows);
        }
    }
    if own.is_empty() {
        copy(file.path(), to)?;
    } else if !others.is_empty() {
        let recording = file.recording();
        merge::write(to, Some(&recording).filter(|value| !value.is_null()), &others)?;
    }
    Ok(own)
}

/// The code of the person who played, in a trace of any domain.
fn participant(rows: &EpisodeRows) -> Option<String> {
    let columns = rows.own_columns();
    let column = columns.iter().find(|column| column.name == PARTICIPANT)?;
    column.values().flatten().find_map(|value| match value {
        Displayed::Text(code) => Some(code),
        Displayed::Bool(_) => None,
    })
}

/// The codes of people whose data must not be published, from the journal beside the traces.
fn withdrawn(folder: &Path) -> Result<BTreeSet<String>, PublishError> {
    #[derive(Deserialize)]
    struct Line {
        participant: String,
        left: Option<String>,
    }
    let path = folder.join(JOURNAL);
    if !path.is_file() {
        return Ok(BTreeSet::new());
    }
    let mut last = BTreeMap::new();
    for line in input::lines(&path, LONGEST_LINE).map_err(PublishError::file(&path))? {
        let line = line.map_err(PublishError::file(&path))?;
        // A line that was cut off by a crash has no answer of anybody.
        let Ok(Line { participant, left: Some(left) }) = serde_json::from_slice(&line) else { continue };
        last.insert(participant, left);
    }
    Ok(last.into_iter().filter(|(_, left)| left != "stopped").map(|(code, _)| code).collect())
}

/// Joins the lists beside the traces: labels of coders and lost episodes.
fn copy_lists(traces: &TraceSet, folder: &Path) -> Result<(), PublishError> {
    let of = |list: fn(&Path) -> PathBuf| traces.files().iter().map(|file| list(file.path())).collect::<BTreeSet<_>>();
    for list in of(list_beside).into_iter().chain(of(|path| list_of(folder_of(path)))) {
        let Ok(mut text) = fs::read(&list) else { continue };
        if text.last().is_some_and(|last| *last != b'\n') {
            text.push(b'\n');
        }
        let to = folder.join(list.file_name().unwrap_or_default());
        let file = OpenOptions::new().create(true).append(true).open(&to);
        file.and_then(|mut file| file.write_all(&text)).map_err(PublishError::file(&to))?;
    }
    Ok(())
}

fn copy(from: &Path, to: &Path) -> Result<(), PublishError> {
    fs::copy(from, to).map(drop).map_err(PublishError::file(from))
}

/// Copies the user's definitions as one file with all that they include. Returns the setting.
pub(crate) fn copy_definitions(study: &Study, traces: &TraceSet, base: &Path) -> Result<Option<String>, PublishError> {
    let Some(asked) = &study.question.definitions else { return Ok(None) };
    if let Some(name) = asked.to_str().filter(|name| file::built_in(name).is_some()) {
        return Ok(Some(name.to_owned()));
    }
    let (name, text) = definitions_text(&study.question, traces)?;
    write(&base.join(&name), text)?;
    Ok(Some(name))
}

/// The path in the bundle and the text of all definitions of a question.
pub(crate) fn definitions_text(question: &Question, traces: &TraceSet) -> Result<(String, String), PublishError> {
    let whole = Question { filter: None, metrics: None, ..question.clone() };
    let definitions = whole.bind_to(&trace_columns(traces))?;
    Ok((format!("definitions/{}.toml", definitions.catalog.name), definitions.as_one_file()))
}

/// Copies a style file. Returns the setting.
pub(crate) fn copy_style(asked: &Path, base: &Path) -> Result<String, PublishError> {
    if let Some(name) = asked.to_str().filter(|name| style::built_in(name).is_some()) {
        return Ok(name.to_owned());
    }
    let name = format!("styles/{}", asked.file_name().unwrap_or_default().to_string_lossy());
    let to = base.join(&name);
    make_folder(folder_of(&to)).map_err(PublishError::file(&to))?;
    copy(asked, &to)?;
    Ok(name)
}

/// Copies folders of prompts, each under its name.
pub(crate) fn copy_prompts(folders: &[PathBuf], base: &Path) -> Result<(), PublishError> {
    for folder in folders {
        let name = folder.file_name().unwrap_or_default().to_string_lossy();
        let templates = Templates::read(folder_of(folder), &name)
            .map_err(|fault| PublishError::Refused(format!("--prompts {}: {fault}", folder.display())))?;
        write_prompt(&templates, &name, base)?;
    }
    Ok(())
}

pub(crate) fn write_prompt(templates: &Templates, name: &str, out: &Path) -> Result<(), PublishError> {
    for (part, text) in &templates.all {
        write(&out.join(PROMPTS).join(name).join(format!("{part}.txt")), text)?;
    }
    Ok(())
}

/// The prompts that the traces name and that are neither given nor built in.
pub(crate) fn missing_prompts(traces: &TraceSet, base: &Path) -> BTreeSet<Withheld> {
    let mut missing = BTreeSet::new();
    for recording in traces.files().iter().map(TraceFile::recording) {
        if let Some((name, sha256)) = prompt_of(&recording)
            && prompt(base, name, sha256).is_none()
        {
            let reason = format!("the prompt `{name}` was not given with --prompts");
            missing.insert(Withheld { kind: "prompt".to_owned(), sha256: sha256.to_owned(), reason });
        }
    }
    missing
}

/// The prompt of this name and hash: from the bundle, else the built-in one.
pub(crate) fn prompt(base: &Path, name: &str, sha256: &str) -> Option<Templates> {
    let own = Templates::read(&base.join(PROMPTS), name).ok();
    own.into_iter().chain(Templates::built_in(name)).find(|templates| templates.hash() == sha256)
}

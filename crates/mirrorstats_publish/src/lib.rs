//! A study as one folder that others open, check and cite.
//!
//! ```text
//! traces ──► sources ──► derive ──► report, viewer, scores, frames, card    publish
//!            (copied)      │
//!                          └──► the same files, compared with the published ones    verify
//! ```
//!
//! Sources are copied: traces, logs, lists beside them, the user's definitions, style and prompts. Everything else is a
//! function of the sources and the settings in the manifest. So `verify` makes it again and compares.
//!
//! Rule: no output depends on the clock or on paths of this machine.

#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod about;
mod card;
mod compare;
mod croissant;
mod derive;
pub mod formats;
mod frames;
mod manifest;
mod sources;
pub mod verify;

use std::fs;
use std::io;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use mirrorstats_exact::replace::{
    Content, FolderError, FolderFiles, TemporaryFolder, folder_of, make_folder, replace_folder,
};
use mirrorstats_log::LogError;
use mirrorstats_report::bundle::MANIFEST;
use mirrorstats_study::{Study, StudyError};
use mirrorstats_trace::beside::ListError;
use mirrorstats_trace::error::TraceError;

use about::About;
use manifest::Settings;
pub use manifest::{Frames, Manifest, Withheld};

#[derive(Debug, thiserror::Error)]
pub enum PublishError {
    #[error(transparent)]
    Study(#[from] StudyError),
    #[error(transparent)]
    Trace(#[from] TraceError),
    #[error(transparent)]
    List(#[from] ListError),
    #[error(transparent)]
    Log(#[from] LogError),
    #[error("cannot write the bundle: {0}\n  help: is the folder there and writable, and the disk not full?")]
    Write(#[from] FolderError),
    #[error("{}: {source}", path.display())]
    File { path: PathBuf, source: io::Error },
    #[error("{0}")]
    Refused(String),
}

impl PublishError {
    pub(crate) fn file(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::File { path, source }
    }
}

/// A request to publish.
#[derive(Clone, Debug)]
pub struct PublishRequest {
    pub out: PathBuf,
    /// The style of tables, by name or path.
    pub style: PathBuf,
    pub frames: Frames,
    pub about: About,
    /// Folders of prompts that are not built in.
    pub prompts: Vec<PathBuf>,
    pub threads: NonZeroUsize,
}

/// Receives the name of each part before it is made.
pub type Progress<'p> = &'p (dyn Fn(&str) + Sync);

/// The published folder.
#[derive(Clone, Debug)]
pub struct Published {
    pub manifest: Manifest,
    /// Statements about missing parts.
    pub notes: Vec<String>,
}

/// Writes the bundle of a study: the folder appears whole or not at all.
pub fn publish(study: &Study, request: &PublishRequest, progress: Progress<'_>) -> Result<Published, PublishError> {
    let traces = study.traces()?;
    let out = &request.out;
    check_out(out)?;
    study.check_out(out)?;
    let parent = folder_of(out);
    make_folder(parent).map_err(PublishError::file(parent))?;
    let name = out.file_name().unwrap_or_default().to_string_lossy();
    let stage = TemporaryFolder::create(parent, &name).map_err(PublishError::file(parent))?;
    let base = fs::canonicalize(stage.path()).map_err(PublishError::file(stage.path()))?;
    progress("traces");
    let mut notes = Vec::new();
    sources::copy_prompts(&request.prompts, &base)?;
    let mut withheld = sources::copy_traces(traces, request.frames, &base, &mut notes)?;
    withheld.extend(sources::missing_prompts(traces, &base));
    let settings = Settings {
        definitions: sources::copy_definitions(study, traces, &base)?,
        style: sources::copy_style(&request.style, &base)?,
        frames: request.frames,
        filter: study.question.filter.clone(),
        by: study.question.by.clone(),
        metrics: study.question.metrics.clone(),
        pool: study.question.pool,
        lost_as_failures: study.question.lost == mirrorstats_study::losses::LostAs::Failure,
        about: request.about.clone(),
        withheld,
    };
    let derived = derive::derive(&base, &base, &settings, request.threads, progress)?;
    notes.extend(derived.notes);
    progress("hashes");
    let manifest = Manifest::of_folder(&base, settings, derived.episodes)?;
    write(&base.join(MANIFEST), manifest.json())?;
    let mut files: Vec<String> = manifest.outputs.iter().map(|output| output.path.clone()).collect();
    files.push(MANIFEST.to_owned());
    put(&base, out, &files, Some(MANIFEST))?;
    Ok(Published { manifest, notes })
}

/// Replaces a folder by these files of a stage.
pub(crate) fn put(stage: &Path, out: &Path, files: &[String], index: Option<&str>) -> Result<(), PublishError> {
    let staged: Vec<PathBuf> = files.iter().map(|path| stage.join(path)).collect();
    let new: Vec<_> = files.iter().map(Path::new).zip(staged.iter().map(|path| Content::File(path))).collect();
    Ok(replace_folder(out, &FolderFiles { new: &new, index: index.map(Path::new), old: &old_files })?)
}

/// Accepts a new folder, an empty one, or an earlier bundle.
fn check_out(out: &Path) -> Result<(), PublishError> {
    if is_empty(out) || manifest::read(out).is_ok() {
        return Ok(());
    }
    Err(PublishError::Refused(format!(
        "--out: expected a new folder or an earlier bundle, found other files in `{}`\n  help: name another folder",
        out.display()
    )))
}

pub(crate) fn is_empty(folder: &Path) -> bool {
    fs::read_dir(folder).map_or(!folder.exists(), |mut entries| entries.next().is_none())
}

fn old_files(folder: &Path) -> Vec<PathBuf> {
    let Ok(manifest) = manifest::read(folder) else { return Vec::new() };
    let plain = manifest.outputs.into_iter().filter(|output| mirrorstats_study::provenance::is_plain(&output.path));
    plain.map(|output| output.path.into()).chain([MANIFEST.into()]).collect()
}

pub(crate) fn write(path: &Path, bytes: impl AsRef<[u8]>) -> Result<(), PublishError> {
    make_folder(folder_of(path)).and_then(|()| fs::write(path, bytes)).map_err(PublishError::file(path))
}

//! The files that the arguments name: traces, logs, and what a recording has under way.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, UNIX_EPOCH};

use super::error::ViewError;
use crate::log::frames;
use crate::study::resolve;
use crate::trace::inputs::Input;

/// Where a recording keeps whole episodes that are not in the trace yet, and what it is writing.
const PARTS: &str = ".parts";

/// The files of some arguments.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Found {
    /// Traces, each once.
    pub traces: Vec<Input>,
    /// Traces of one episode each, which a recording has not put together yet.
    pub parts: Vec<Input>,
    /// Logs that have ended.
    pub logs: Vec<PathBuf>,
    /// Logs that are being written.
    pub unfinished: Vec<PathBuf>,
}

/// What tells that a file has changed.
pub(super) type Stamp = (PathBuf, u64, Option<Duration>);

impl Found {
    /// Looks for the files.
    ///
    /// # Errors
    /// An argument that names nothing.
    pub fn of(runs: &[OsString]) -> Result<Self, ViewError> {
        let mut found = Self::default();
        let (mut folders, mut named) = (BTreeSet::new(), Vec::new());
        for argument in runs {
            let path = Path::new(argument);
            if path.is_dir() {
                folders.extend(folders_below(path));
            }
            if is_log(path) {
                found.logs.push(path.to_owned());
            } else {
                named.push(argument.clone());
            }
        }
        for folder in &folders {
            found.look_into(folder);
        }
        found.traces = found.traces(&named)?;
        let beside: BTreeSet<PathBuf> = found.traces.iter().map(|trace| trace.path.with_extension("mcap")).collect();
        found.logs.extend(beside.into_iter().filter(|log| log.is_file()));
        found.logs.sort();
        found.logs.dedup();
        Ok(found)
    }

    /// The traces among the arguments; a folder in which a recording has only begun has none yet.
    fn traces(&self, named: &[OsString]) -> Result<Vec<Input>, ViewError> {
        if named.is_empty() {
            return Ok(Vec::new());
        }
        match resolve(named, io::empty()) {
            Ok(traces) => Ok(traces),
            Err(_) if !self.parts.is_empty() || !self.unfinished.is_empty() => {
                let some = named.iter().filter_map(|name| resolve(std::slice::from_ref(name), io::empty()).ok());
                Ok(some.flatten().collect())
            }
            Err(error) => Err(error.into()),
        }
    }

    fn look_into(&mut self, folder: &Path) {
        self.logs.extend(files(folder).into_iter().filter(|path| is_log(path)));
        for path in files(&folder.join(PARTS)) {
            match path.extension().and_then(|ending| ending.to_str()) {
                Some("parquet") => self.parts.push(Input::new(path)),
                Some("mcap") if path.with_extension("parquet").is_file() => self.logs.push(path),
                Some("lock") => {}
                _ if frames::is_log(&path) => self.unfinished.push(path),
                _ => {}
            }
        }
    }

    /// The state of every file, to be held against a later one. A file that grows under way is told apart.
    pub fn stamps(&self) -> Vec<Stamp> {
        let traces = self.traces.iter().chain(&self.parts).map(|input| &input.path);
        traces.chain(&self.logs).map(|path| stamp(path)).collect()
    }
}

/// The state of a file; of one that is gone the name alone.
pub(super) fn stamp(path: &Path) -> Stamp {
    let metadata = fs::metadata(path).ok();
    let written = metadata.as_ref().and_then(|data| data.modified().ok()?.duration_since(UNIX_EPOCH).ok());
    (path.to_owned(), metadata.map_or(0, |data| data.len()), written)
}

/// The folder and those in it, but for names that programs keep for themselves; links are not followed.
fn folders_below(folder: &Path) -> Vec<PathBuf> {
    let mut all = vec![folder.to_owned()];
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    for entry in entries {
        let name = entry.file_name();
        let is_own = name.to_string_lossy().starts_with(['.', '_']);
        if !is_own && entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            all.extend(folders_below(&entry.path()));
        }
    }
    all
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(|path| path.is_file()).collect();
    files.sort();
    files
}

fn is_log(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "mcap") && path.is_file()
}

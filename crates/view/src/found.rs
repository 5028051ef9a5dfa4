//! The files that the arguments name: traces, logs, and what a recording has under way.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, UNIX_EPOCH};

use super::error::ViewError;
use study::resolve;
use trace::inputs::Input;
use trace::log::frames;

/// The folder for whole episodes of a recording that are not in the trace yet, and for the one being written.
const PARTS: &str = ".parts";

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

/// The stamp that shows a change of a file.
pub(super) type Stamp = (PathBuf, u64, Option<Duration>);

impl Found {
    pub fn of(runs: &[OsString]) -> Result<Self, ViewError> {
        let mut found = Self::default();
        let (mut folders, mut named) = (BTreeSet::new(), Vec::new());
        for argument in runs {
            let path = Path::new(argument);
            if path.is_dir() {
                folders.extend(folders_below(path)?);
            }
            if is_log(path) {
                found.logs.push(path.to_owned());
            } else {
                named.push(argument.clone());
            }
        }
        for folder in &folders {
            found.look_into(folder)?;
        }
        found.traces = found.traces(&named)?;
        let beside: BTreeSet<PathBuf> = found.traces.iter().map(|trace| trace.path.with_extension("mcap")).collect();
        found.logs.extend(beside.into_iter().filter(|log| log.is_file()));
        found.logs.sort();
        found.logs.dedup();
        Ok(found)
    }

    fn traces(&self, named: &[OsString]) -> Result<Vec<Input>, ViewError> {
        if named.is_empty() {
            return Ok(Vec::new());
        }
        match resolve(named, io::empty()) {
            Ok(traces) => Ok(traces),
            Err(_) if !self.parts.is_empty() || !self.unfinished.is_empty() => {
                let mut some = Vec::new();
                for name in named {
                    match resolve(std::slice::from_ref(name), io::empty()) {
                        Ok(traces) => some.extend(traces),
                        Err(_) if Path::new(name).is_dir() => {}
                        Err(error) => return Err(error.into()),
                    }
                }
                Ok(some)
            }
            Err(error) => Err(error.into()),
        }
    }

    fn look_into(&mut self, folder: &Path) -> Result<(), ViewError> {
        self.logs.extend(files(folder)?.into_iter().filter(|path| is_log(path)));
        for path in files(&folder.join(PARTS))? {
            match path.extension().and_then(|ending| ending.to_str()) {
                Some("parquet") => self.parts.push(Input::new(path)),
                Some("mcap") if path.with_extension("parquet").is_file() => self.logs.push(path),
                Some("lock") => {}
                _ if frames::is_log(&path) => self.unfinished.push(path),
                _ => {}
            }
        }
        Ok(())
    }

    /// The state of every file, to be compared with a later one. A file that grows under way is distinguished.
    pub fn stamps(&self) -> Vec<Stamp> {
        let traces = self.traces.iter().chain(&self.parts).map(|input| &input.path);
        traces.chain(&self.logs).map(|path| stamp(path)).collect()
    }
}

pub(super) fn stamp(path: &Path) -> Stamp {
    let metadata = fs::metadata(path).ok();
    let written = metadata.as_ref().and_then(|data| data.modified().ok()?.duration_since(UNIX_EPOCH).ok());
    (path.to_owned(), metadata.map_or(0, |data| data.len()), written)
}

fn folders_below(folder: &Path) -> Result<Vec<PathBuf>, ViewError> {
    let mut all = vec![folder.to_owned()];
    for path in entries(folder)? {
        let is_own = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(['.', '_']));
        if !is_own && path.is_dir() && !path.is_symlink() {
            all.extend(folders_below(&path)?);
        }
    }
    Ok(all)
}

fn files(folder: &Path) -> Result<Vec<PathBuf>, ViewError> {
    Ok(entries(folder)?.into_iter().filter(|path| path.is_file()).collect())
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>, ViewError> {
    let listed = fs::read_dir(folder).and_then(|all| all.map(|entry| Ok(entry?.path())).collect());
    let mut paths: Vec<PathBuf> = match listed {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
        listed => listed.map_err(|source| ViewError::Folder { folder: folder.to_owned(), source })?,
    };
    paths.sort();
    Ok(paths)
}

fn is_log(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "mcap") && path.is_file()
}

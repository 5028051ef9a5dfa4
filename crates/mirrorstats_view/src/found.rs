//! The files that the arguments name: traces, logs, and unfinished parts of recordings.

use std::collections::BTreeSet;
use std::collections::btree_map::{BTreeMap, Entry};
use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, UNIX_EPOCH};

use super::error::{Renamed, ViewError};
use mirrorstats_exact::replace::{FolderError, folder_of};
use mirrorstats_log::frames;
use mirrorstats_study::inputs::resolve;
use mirrorstats_trace::beside::labels::list_beside;
use mirrorstats_trace::beside::lost::list_of;
use mirrorstats_trace::inputs::Input;

/// The folder for a recording's finished episodes that are not in the trace yet, and for the one being written.
const PARTS: &str = ".parts";

/// The maximum number of attempts to find files that do not change meanwhile, and the pause between them.
const ATTEMPTS: usize = 40;
const PAUSE: Duration = Duration::from_millis(50);

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Found {
    /// Traces without duplicates.
    pub traces: Vec<Input>,
    /// Traces of one episode each, which a recording has not merged yet.
    pub parts: Vec<Input>,
    /// Finished logs.
    pub logs: Vec<PathBuf>,
    /// Logs being written.
    pub unfinished: Vec<PathBuf>,
}

/// A file's path, size and modification time, to detect changes.
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
            found => Ok(found?),
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

    /// A consistent copy of the files in `folder`: a recording in progress replaces and removes its own files. Logs may
    /// be large and are hard-linked if possible. Traces are copied: a link would change a trace's state, and a
    /// concurrent reader would take it for a changed file.
    ///
    /// Errors name `page`, the export. Returns the pairs of copied and original folders.
    pub fn frozen(runs: &[OsString], folder: &Path, page: &Path) -> Result<(Self, Vec<Renamed>), ViewError> {
        let failed = |source| FolderError { path: page.to_owned(), source };
        for attempt in 0..ATTEMPTS {
            let found = Self::of(runs)?;
            let own = folder.join(attempt.to_string());
            fs::create_dir(&own).map_err(failed)?;
            match found.linked(&own) {
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                linked => {
                    let linked = linked.map_err(failed)?;
                    if Self::of(runs)?.stamps() == found.stamps() {
                        return Ok(linked);
                    }
                }
            }
            std::thread::sleep(PAUSE);
        }
        Err(ViewError::Absent(
            "expected a recording that pauses for a moment, found one that changes all the time".into(),
        ))
    }

    fn linked(&self, folder: &Path) -> io::Result<(Self, Vec<Renamed>)> {
        let (mut folders, mut renamed) = (BTreeMap::new(), Vec::new());
        let mut link = |path: &Path| -> io::Result<PathBuf> {
            let parent = fs::canonicalize(folder_of(path))?;
            let next = folder.join(folders.len().to_string());
            let own: &PathBuf = match folders.entry(parent) {
                Entry::Occupied(known) => known.into_mut(),
                Entry::Vacant(new) => {
                    fs::create_dir(&next)?;
                    // This list grows, and is not among the files found.
                    let lost = list_of(new.key());
                    if lost.is_file() {
                        fs::copy(&lost, list_of(&next))?;
                    }
                    let labels = list_beside(path);
                    if labels.is_file() {
                        fs::copy(&labels, next.join(labels.file_name().unwrap_or_default()))?;
                    }
                    renamed.push((next.clone(), folder_of(path).to_owned()));
                    new.insert(next)
                }
            };
            let to = own.join(path.file_name().unwrap_or_default());
            let linked =
                if is_log(path) { fs::hard_link(fs::canonicalize(path)?, &to) } else { fs::copy(path, &to).map(drop) };
            match linked {
                Err(error) if error.kind() == io::ErrorKind::NotFound || !is_log(path) => Err(error),
                // The existing file is a link to the same log.
                Err(_) if to.exists() => Ok(to),
                Err(_) => fs::copy(path, &to).map(|_| to),
                Ok(()) => Ok(to),
            }
        };
        let mut inputs = |inputs: &[Input]| -> io::Result<Vec<Input>> {
            inputs.iter().map(|input| Ok(Input { name: input.name.clone(), path: link(&input.path)? })).collect()
        };
        let (traces, parts) = (inputs(&self.traces)?, inputs(&self.parts)?);
        let logs = self.logs.iter().map(|log| link(log)).collect::<io::Result<_>>()?;
        Ok((Self { traces, parts, logs, unfinished: Vec::new() }, renamed))
    }

    pub fn label_stamps(&self) -> Vec<Stamp> {
        let traces = self.traces.iter().chain(&self.parts).map(|input| list_beside(&input.path));
        traces.collect::<BTreeSet<_>>().iter().map(|list| stamp(list)).collect()
    }

    /// The stamps of all files except growing ones, to compare with later stamps.
    pub fn stamps(&self) -> Vec<Stamp> {
        let traces = self.traces.iter().chain(&self.parts).map(|input| &input.path);
        traces.chain(&self.logs).map(|path| stamp(path)).collect()
    }
}

fn stamp(path: &Path) -> Stamp {
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

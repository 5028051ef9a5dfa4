//! Files of steps beside a log, one for each of its rows.
//!
//! Rule: a row without its file, or without a step in it, stays one row. Missing files are counted, the first one by name.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Seek as _};
use std::path::{Component, Path, PathBuf};

use mirrorstats_exact::escape::visible;
use mirrorstats_exact::{hash, input};
use mirrorstats_trace::inputs::Input;

use super::error::{Fault, ImportError};
use super::notes::Notes;

#[derive(Debug, Default)]
pub(super) struct Beside {
    /// The folder of the log; `None` if the log was piped in.
    folder: Option<PathBuf>,
    /// The hashes of the files that were read, by their paths in the folder.
    hashes: BTreeMap<String, String>,
    first_missing: Option<String>,
    missing: u64,
}

/// An opened file of steps, with its name in messages.
#[derive(Debug)]
pub(super) struct StepFile {
    pub(super) name: String,
    pub(super) file: File,
    pub(super) bytes: u64,
}

impl Beside {
    pub(super) fn new(folder: Option<PathBuf>) -> Self {
        Self { folder, ..Self::default() }
    }

    /// Opens the file that a row of the log names by its path in the folder; `None` if it is missing.
    pub(super) fn open(&mut self, path: &str, row: &str) -> Result<Option<StepFile>, ImportError> {
        let refused = |expected: &str, words: &str| {
            let found = format!("`{}`{words}", visible(path));
            Fault { file: row.to_owned(), ..Fault::new(expected, found, "correct the log, or copy it again") }
        };
        // A log must not make the import read any file of the user.
        if !Path::new(path).components().all(|part| matches!(part, Component::Normal(_))) {
            return Err(refused("a path below the folder of the log, with the steps of the row", "").into());
        }
        if self.hashes.contains_key(path) {
            return Err(refused("a file of steps of its own for each row", " again").into());
        }
        let Some(at) = self.folder.as_ref().map(|folder| folder.join(path)).filter(|at| at.exists()) else {
            self.missing += 1;
            self.first_missing.get_or_insert_with(|| path.to_owned());
            return Ok(None);
        };
        let name = Input::new(&at).name;
        let read = || -> io::Result<(File, u64, String)> {
            let mut file = input::open(&at)?;
            let (bytes, sha256) = (file.metadata()?.len(), hash::of_reader(&mut file)?);
            file.rewind()?;
            Ok((file, bytes, sha256))
        };
        let (file, bytes, sha256) = read().map_err(ImportError::read(&name))?;
        self.hashes.insert(path.to_owned(), sha256);
        Ok(Some(StepFile { name, file, bytes }))
    }

    /// The hash of all files that were read, with their paths; `None` if there were none.
    pub(super) fn finish(self, notes: &mut Notes) -> Option<String> {
        if let Some(first) = self.first_missing {
            notes.count(format!("files of steps that are missing, the first `{first}`"), self.missing);
        }
        let lines: Vec<String> = self.hashes.iter().map(|(path, sha256)| format!("{sha256}  {path}\n")).collect();
        (!lines.is_empty()).then(|| hash::of_bytes(lines.concat().as_bytes()))
    }
}

//! Other recordings into the same folder.
//!
//! ```text
//! OUT/.lock                          held while a trace is put together, and while a process comes or goes
//! OUT/.parts/.present                shared by every process that records here; an exclusive lock means no other process
//! OUT/.parts/E1-oracle-s1-r3.lock    held by the process that records the episode
//! ```
//!
//! Rule: all are locks of the operating system, which end with the process, however it ends. A folder that nobody records
//! into has none of these files. Only a process that finds no other clears away what a killed one has left.

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use super::super::error::StoreError;
use super::super::lock::{lock_folder, lock_of};
use exact::replace::{make_folder, sweep};

/// The folder of parts within the folder of a recording.
const PARTS: &str = ".parts";

/// The folder of parts of a recording; what is in it under a temporary name is cleared away.
pub fn parts_of(folder: &Path) -> PathBuf {
    folder.join(PARTS)
}

/// This process's share in a folder; dropping it releases the share.
#[derive(Debug)]
pub struct FolderLock {
    folder: PathBuf,
    is_new: bool,
    present: File,
}

impl FolderLock {
    /// Makes the folder if need be, and clears away what a killed process has left if nobody else is there.
    pub fn stake(folder: &Path) -> Result<Self, StoreError> {
        loop {
            let is_new = !folder.exists();
            make_folder(folder).map_err(StoreError::io("make the folder", folder))?;
            match Self::enter(folder, is_new) {
                Ok(claim) => return Ok(claim),
                // A process that recorded nothing has removed the folder that was made for it.
                Err(_) if !folder.exists() => {}
                Err(error) => {
                    if is_new {
                        let _ = fs::remove_dir(folder);
                    }
                    return Err(error);
                }
            }
        }
    }

    fn enter(folder: &Path, is_new: bool) -> Result<Self, StoreError> {
        let _lock = lock_folder(folder)?;
        let parts = parts_of(folder);
        make_folder(&parts).map_err(StoreError::io("make the folder", &parts))?;
        sweep(folder);
        let path = parts.join(".present");
        let present = File::create(&path).map_err(StoreError::io("make", &path))?;
        if is_alone(&present, &path)? {
            clear(&parts)?;
        }
        // Nobody can be alone here before the lock of the folder is given back.
        present.lock_shared().map_err(StoreError::io("lock", &path))?;
        Ok(Self { folder: folder.to_owned(), is_new, present })
    }

    pub fn folder(&self) -> &Path {
        &self.folder
    }

    pub fn parts(&self) -> PathBuf {
        parts_of(&self.folder)
    }

    /// The folder's lock, held until the file is dropped.
    pub fn lock(&self) -> Result<File, StoreError> {
        lock_folder(&self.folder)
    }

    fn leave(&self) -> Result<(), StoreError> {
        let _lock = self.lock()?;
        let parts = self.parts();
        let path = parts.join(".present");
        self.present.unlock().map_err(StoreError::io("unlock", &path))?;
        if is_alone(&self.present, &path)? {
            clear(&parts)?;
            fs::remove_file(&path).map_err(StoreError::io("remove", &path))?;
            // What is not empty stays: parts wait there for the recording to go on.
            let _ = fs::remove_dir(&parts);
            let lock = lock_of(&self.folder);
            fs::remove_file(&lock).map_err(StoreError::io("remove", &lock))?;
            if self.is_new {
                let _ = fs::remove_dir(&self.folder);
            }
        }
        Ok(())
    }
}

impl Drop for FolderLock {
    fn drop(&mut self) {
        // What cannot be cleared away now is cleared away by the next recording.
        let _ = self.leave();
    }
}

fn is_alone(present: &File, path: &Path) -> Result<bool, StoreError> {
    match present.try_lock() {
        Ok(()) => present.unlock().map(|()| true).map_err(StoreError::io("unlock", path)),
        Err(TryLockError::WouldBlock) => Ok(false),
        Err(TryLockError::Error(error)) => Err(StoreError::io("lock", path)(error)),
    }
}

fn clear(parts: &Path) -> Result<(), StoreError> {
    let entries = fs::read_dir(parts).and_then(Iterator::collect::<io::Result<Vec<_>>>);
    for entry in entries.map_err(StoreError::io("read", parts))? {
        let path = entry.path();
        if is_unfinished(&path) {
            // The frames that a program was given are a folder.
            let removed = if path.is_dir() { fs::remove_dir_all(&path) } else { fs::remove_file(&path) };
            removed.map_err(StoreError::io("remove", &path))?;
        }
    }
    Ok(())
}

/// Whether a file was being written, is the lock of an episode, or the log of one that did not get to its trace. Former
/// versions wrote logs as `.unfinished`.
fn is_unfinished(path: &Path) -> bool {
    let has_ending = |ending: &str| path.extension().is_some_and(|found| found == ending);
    let is_temporary = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(".mirrorstats-"));
    let is_without_trace = has_ending("mcap") && !path.with_extension("parquet").exists();
    is_temporary || has_ending("lock") || has_ending("unfinished") || is_without_trace
}

//! Temporary files that killed processes left behind.
//!
//! Rule: the checksum in a temporary name proves that this program chose it. The file or folder is locked while its
//! process lives, however that ends. A caller that gets the lock may remove it. If the file system has no locks,
//! everything stays.

use std::collections::BTreeSet;
use std::fs::{self, DirEntry, File};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use super::place::is_temporary;
use super::same_file::is_one_file;

/// The folders that this process has swept. Once is enough: a folder of a hundred thousand files takes time.
static SWEPT: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Locks a new temporary file or folder; `false` if another process took it for a leftover and removed it meanwhile.
pub(super) fn lock(file: &File, path: &Path) -> bool {
    // Without locks no process removes leftovers.
    cfg!(not(unix)) || file.lock().is_err() || is_at(file, path)
}

/// Removes the temporary files and folders without a living owner from `folder`, whatever their targets. Runs only the
/// first time that this process is about to write there. What cannot be removed stays and does no harm.
pub fn sweep(folder: &Path) {
    if cfg!(not(unix)) {
        return;
    }
    let Ok(place) = folder.canonicalize() else { return };
    if SWEPT.lock().unwrap_or_else(PoisonError::into_inner).insert(place) {
        remove(folder);
    }
}

fn remove(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten().filter(|entry| is_temporary(&entry.file_name())) {
        remove_unowned(&entry);
    }
}

fn remove_unowned(entry: &DirEntry) {
    let path = entry.path();
    // Opening a pipe would block, and a link leads elsewhere: neither is ours.
    let Ok(kind) = entry.file_type() else { return };
    if !kind.is_file() && !kind.is_dir() {
        return;
    }
    let Ok(file) = File::open(&path) else { return };
    if file.try_lock().is_ok() && is_at(&file, &path) {
        let _ = if kind.is_dir() { fs::remove_dir_all(&path) } else { fs::remove_file(&path) };
    }
}

fn is_at(file: &File, path: &Path) -> bool {
    is_one_file(file.metadata(), fs::symlink_metadata(path))
}

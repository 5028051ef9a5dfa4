//! Temporary files that killed processes have left behind.
//!
//! Rule: a temporary file or folder is locked for as long as its process lives, however that ends. Whoever gets the
//! lock may remove it. Where the file system has no locks, nothing is removed.

use std::ffi::OsStr;
use std::fs::{self, DirEntry, File};
use std::path::Path;

/// How many random characters `tempfile` puts behind a prefix.
const RANDOM: usize = 6;

/// Locks a temporary file or folder that was just made; `false` if another process has taken it for a leftover and
/// removed it meanwhile.
pub(super) fn lock(file: &File, path: &Path) -> bool {
    // Without locks nobody removes anything.
    cfg!(not(unix)) || file.lock().is_err() || is_at(file, path)
}

/// Removes the files and folders in `folder` that have a name of this prefix and no living owner. What cannot be
/// removed stays: it is in nobody's way.
pub(super) fn remove(folder: &Path, prefix: &OsStr) {
    if cfg!(not(unix)) {
        return;
    }
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten().filter(|entry| has_prefix(&entry.file_name(), prefix)) {
        remove_unowned(&entry);
    }
}

fn has_prefix(name: &OsStr, prefix: &OsStr) -> bool {
    let rest = name.as_encoded_bytes().strip_prefix(prefix.as_encoded_bytes());
    rest.is_some_and(|rest| rest.len() == RANDOM && rest.iter().all(u8::is_ascii_alphanumeric))
}

fn remove_unowned(entry: &DirEntry) {
    let path = entry.path();
    // A pipe would block when opened, and a link leads elsewhere: neither is ours.
    let Ok(kind) = entry.file_type() else { return };
    if !kind.is_file() && !kind.is_dir() {
        return;
    }
    let Ok(file) = File::open(&path) else { return };
    if file.try_lock().is_ok() && is_at(&file, &path) {
        let _ = if kind.is_dir() { fs::remove_dir_all(&path) } else { fs::remove_file(&path) };
    }
}

#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let place = |metadata: &fs::Metadata| (metadata.dev(), metadata.ino());
    matches!((file.metadata(), fs::metadata(path)), (Ok(ours), Ok(there)) if place(&ours) == place(&there))
}

#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}

//! The lock of a recording's folder: one process at a time records into it.
//!
//! Rule: `OUT/.lock` is locked by the operating system, so the lock ends with the process in every case. The file itself
//! exists only while a recording is in progress or after a killed one. The owner removes the remains of killed
//! recordings.

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use super::error::StoreError;
use mirrorstats_exact::replace::{make_folder, sweep};

const PARTS: &str = ".parts";
const LOCK: &str = ".lock";

/// Held while a thread of this process writes traces or lists of a folder: a person may withdraw during an assembly.
pub(crate) static WRITING: Mutex<()> = Mutex::new(());

/// The folder of parts of a recording; temporary files in it are removed.
pub fn parts_of(folder: &Path) -> PathBuf {
    folder.join(PARTS)
}

/// The exclusive right to record into a folder; dropping it releases the folder.
#[derive(Debug)]
pub struct FolderLock {
    folder: PathBuf,
    is_new: bool,
    file: File,
}

impl FolderLock {
    /// Creates the folder if necessary, and removes the remains of a killed recording.
    pub fn take(folder: &Path) -> Result<Self, StoreError> {
        loop {
            let is_new = !folder.exists();
            make_folder(folder).map_err(StoreError::io("make the folder", folder))?;
            match Self::enter(folder, is_new) {
                // The previous owner has removed the folder, which was created for it, or the file: it locks nothing.
                Ok(None) => {}
                Err(_) if !folder.exists() => {}
                Ok(Some(lock)) => return Ok(lock),
                Err(error) => {
                    if is_new {
                        let _ = fs::remove_dir(folder);
                    }
                    return Err(error);
                }
            }
        }
    }

    fn enter(folder: &Path, is_new: bool) -> Result<Option<Self>, StoreError> {
        let path = folder.join(LOCK);
        let file = File::create(&path).map_err(StoreError::io("write into the folder: cannot make", &path))?;
        match file.try_lock() {
            Ok(()) if !is_at(&file, &path) => return Ok(None),
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(StoreError::Busy { folder: folder.to_owned() }),
            Err(TryLockError::Error(error)) => return Err(StoreError::io("lock", &path)(error)),
        }
        let lock = Self { folder: folder.to_owned(), is_new, file };
        let parts = lock.parts();
        make_folder(&parts).map_err(StoreError::io("make the folder", &parts))?;
        sweep(folder);
        clear(&parts)?;
        Ok(Some(lock))
    }

    pub fn folder(&self) -> &Path {
        &self.folder
    }

    pub fn parts(&self) -> PathBuf {
        parts_of(&self.folder)
    }
}

impl Drop for FolderLock {
    fn drop(&mut self) {
        // The next recording removes what cannot be removed now. Parts wait for it in their folder.
        let parts = self.parts();
        let _ = clear(&parts);
        let _ = fs::remove_dir(&parts);
        // The file goes first: after the release, the path may belong to another process.
        let _ = fs::remove_file(self.folder.join(LOCK));
        if self.is_new {
            let _ = fs::remove_dir(&self.folder);
        }
        // A child process that is being started may still hold a copy of the file, and with it the lock.
        let _ = self.file.unlock();
    }
}

pub(crate) fn entries_of(folder: &Path) -> Result<Vec<fs::DirEntry>, StoreError> {
    fs::read_dir(folder).and_then(Iterator::collect).map_err(StoreError::io("read", folder))
}

fn clear(parts: &Path) -> Result<(), StoreError> {
    for entry in entries_of(parts)? {
        let path = entry.path();
        if is_unfinished(&path) {
            // The frames of an external program are a folder.
            let removed = if path.is_dir() { fs::remove_dir_all(&path) } else { fs::remove_file(&path) };
            removed.map_err(StoreError::io("remove", &path))?;
        }
    }
    Ok(())
}

/// Returns true for a temporary file, or the log of an episode that is not recorded.
fn is_unfinished(path: &Path) -> bool {
    let is_temporary = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(".mirrorstats-"));
    let is_log = path.extension().is_some_and(|found| found == "mcap");
    is_temporary || is_log && !path.with_extension("parquet").exists()
}

/// Returns true if this open file is the one at `path`.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let place = |metadata: &fs::Metadata| (metadata.dev(), metadata.ino());
    matches!((file.metadata(), fs::metadata(path)), (Ok(ours), Ok(there)) if place(&ours) == place(&there))
}

/// Returns true if this open file is the one at `path`; a file that is open can be neither removed nor replaced.
#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

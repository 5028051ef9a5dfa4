//! Locks of the operating system: they end with the process in every case.

use std::fs::{self, File, TryLockError};
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};

use super::super::error::StoreError;

/// The exclusive right to record an episode. Dropping it removes the file and releases the lock.
#[derive(Debug)]
pub struct EpisodeLock {
    file: File,
    path: PathBuf,
}

#[derive(Debug)]
pub enum Attempt {
    Ours(EpisodeLock),
    /// Another process has it: its id, if the file contains it.
    Theirs(Option<u32>),
}

impl EpisodeLock {
    /// Tries to lock `path` without waiting.
    pub fn attempt(path: &Path) -> Result<Attempt, StoreError> {
        loop {
            let file = File::options().read(true).write(true).create(true).truncate(false).open(path);
            let mut file = file.map_err(StoreError::io("make", path))?;
            match file.try_lock() {
                Ok(()) if is_at(&file, path) => {
                    let lock = Self { file, path: path.to_owned() };
                    lock.sign().map_err(StoreError::io("write", path))?;
                    return Ok(Attempt::Ours(lock));
                }
                // The previous owner has removed the file: another one exists, or none.
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => return Ok(Attempt::Theirs(signature(&mut file))),
                Err(TryLockError::Error(error)) => return Err(StoreError::io("lock", path)(error)),
            }
        }
    }

    fn sign(&self) -> io::Result<()> {
        self.file.set_len(0)?;
        (&self.file).write_all(std::process::id().to_string().as_bytes())
    }
}

impl Drop for EpisodeLock {
    fn drop(&mut self) {
        // The file goes first: after the release, the path may belong to another process. A file that stays is no lock.
        let _ = fs::remove_file(&self.path);
        let _ = self.file.unlock();
    }
}

fn signature(file: &mut File) -> Option<u32> {
    let mut text = String::new();
    file.read_to_string(&mut text).ok()?;
    text.parse().ok()
}

pub(in crate::record) fn lock_folder(folder: &Path) -> Result<File, StoreError> {
    let path = lock_of(folder);
    loop {
        let file = File::create(&path).map_err(StoreError::io("write into the folder: cannot make", &path))?;
        file.lock().map_err(StoreError::io("lock", &path))?;
        // The previous owner may have left last and removed the file: then it locks nothing.
        if is_at(&file, &path) {
            return Ok(file);
        }
    }
}

pub(in crate::record) fn lock_of(folder: &Path) -> PathBuf {
    folder.join(".lock")
}

/// Returns true if this open file is the one at `path`.
#[cfg(unix)]
pub(in crate::record) fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let place = |metadata: &fs::Metadata| (metadata.dev(), metadata.ino());
    matches!((file.metadata(), fs::metadata(path)), (Ok(ours), Ok(there)) if place(&ours) == place(&there))
}

/// Returns true if this open file is the one at `path`; a file that is open can be neither removed nor replaced.
#[cfg(not(unix))]
pub(in crate::record) fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

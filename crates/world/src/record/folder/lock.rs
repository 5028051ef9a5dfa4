//! The locks of a folder and of its episodes, for coordination with other recordings into the same folder.
//!
//! ```text
//! OUT/.lock                          held while a trace is put together, and while a process comes or goes
//! OUT/.parts/.present                shared by every process that records here; an exclusive lock means no other process
//! OUT/.parts/E1-oracle-s1-r3.lock    held by the process that records the episode
//! ```
//!
//! Rule: all are locks of the operating system, which end with the process in every case. A folder without recordings
//! in progress has none of these files. Only a process that is alone removes the remains of killed ones.

use std::fs::{self, File, TryLockError};
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};

use super::super::error::StoreError;
use exact::replace::{make_folder, sweep};

const PARTS: &str = ".parts";

/// The folder of parts of a recording; temporary files in it are removed.
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
    /// Creates the folder if necessary, and removes the remains of a killed process if no other process is there.
    pub fn stake(folder: &Path) -> Result<Self, StoreError> {
        loop {
            let is_new = !folder.exists();
            make_folder(folder).map_err(StoreError::io("make the folder", folder))?;
            match Self::enter(folder, is_new) {
                Ok(claim) => return Ok(claim),
                // A process that recorded nothing has removed the folder, which was created for it.
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
        // No process can find itself alone here until the folder's lock is released.
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
            // A folder that is not empty stays: its parts wait for the recording to continue.
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
        // The next recording removes what cannot be removed now.
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

pub(in crate::record) fn entries_of(folder: &Path) -> Result<Vec<fs::DirEntry>, StoreError> {
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

/// Returns true for a temporary file, an episode's lock, or the log of an episode that is not in its trace. Former
/// versions wrote logs as `.unfinished`.
fn is_unfinished(path: &Path) -> bool {
    let has_ending = |ending: &str| path.extension().is_some_and(|found| found == ending);
    let is_temporary = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(".mirrorstats-"));
    let is_without_trace = has_ending("mcap") && !path.with_extension("parquet").exists();
    is_temporary || has_ending("lock") || has_ending("unfinished") || is_without_trace
}

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

fn lock_folder(folder: &Path) -> Result<File, StoreError> {
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

fn lock_of(folder: &Path) -> PathBuf {
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

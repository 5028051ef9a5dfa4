//! Temporary files and folders. Each has a unique name, is locked while its process lives, and is removed when dropped.
//!
//! All system calls go through the standard library, so that `tests/harness/faults.c` can fail them one by one.

use std::collections::hash_map::RandomState;
use std::ffi::{OsStr, OsString};
use std::fs::{self, File, OpenOptions};
use std::hash::BuildHasher as _;
use std::io;
use std::path::{Path, PathBuf};

use super::leftover;
use super::place::{RANDOM, checksum, prefix_for};

/// The characters of random names: no capitals, since some file systems ignore case.
const CHARACTERS: &[u8; 36] = b"abcdefghijklmnopqrstuvwxyz0123456789";

/// The path of a temporary file or folder, which is removed when this is dropped, unless it got another name.
#[derive(Debug)]
struct Present(PathBuf);

impl Present {
    fn keep(&mut self) {
        self.0 = PathBuf::new();
    }
}

impl Drop for Present {
    fn drop(&mut self) {
        let path = &self.0;
        if !path.as_os_str().is_empty() {
            // A later run sweeps what stays.
            let _ = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
        }
    }
}

#[derive(Debug)]
pub(super) struct TemporaryFile {
    /// Dropped before the file, which holds the lock.
    path: Present,
    pub(super) file: File,
}

impl TemporaryFile {
    /// Creates a file in `folder`, whose name has this prefix, with the permissions of an ordinary new file.
    pub(super) fn create(folder: &Path, prefix: &OsStr) -> io::Result<Self> {
        let made = make(folder, prefix, |path| {
            OpenOptions::new().read(true).write(true).create_new(true).open(path).map(Some)
        })?;
        let (path, Some(file)) = made else { return Err(io::ErrorKind::NotFound.into()) };
        Ok(Self { path, file })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path.0
    }

    pub(super) fn rename(mut self, target: &Path) -> io::Result<()> {
        fs::rename(self.path(), target)?;
        self.path.keep();
        Ok(())
    }

    pub(super) fn rename_new(self, target: &Path) -> io::Result<()> {
        match fs::hard_link(self.path(), target) {
            // Some file systems have no links.
            Err(error) if error.kind() != io::ErrorKind::AlreadyExists && fs::symlink_metadata(target).is_err() => {
                self.rename(target)
            }
            linked => linked,
        }
    }
}

/// A temporary folder, removed with its contents.
#[derive(Debug)]
pub struct TemporaryFolder {
    path: Present,
    _lock: Option<File>,
}

impl TemporaryFolder {
    /// Creates a folder in `parent`, after removing the leftovers of killed processes there; `name` is part of its
    /// name. Others can read it like any new folder.
    pub fn create(parent: &Path, name: &str) -> io::Result<Self> {
        leftover::sweep(parent);
        Self::with_mode(parent, &prefix_for(Path::new(name)), 0o777)
    }

    /// Creates a folder among the system's temporary files that no other user can read.
    pub fn private(name: &str) -> io::Result<Self> {
        let parent = std::env::temp_dir();
        leftover::sweep(&parent);
        Self::with_mode(&parent, &prefix_for(Path::new(name)), 0o700)
    }

    pub(super) fn with_mode(parent: &Path, prefix: &OsStr, mode: u32) -> io::Result<Self> {
        let (path, lock) = make(parent, prefix, |path| {
            make_folder(path, mode)?;
            match File::open(path) {
                // Another process took it for a leftover; the next name is tried.
                Err(error) if error.kind() == io::ErrorKind::NotFound => Err(io::ErrorKind::AlreadyExists.into()),
                opened => Ok(opened.ok()),
            }
        })?;
        Ok(Self { path, _lock: lock })
    }

    pub fn path(&self) -> &Path {
        &self.path.0
    }

    pub(super) fn keep(mut self) {
        self.path.keep();
    }
}

fn make(
    folder: &Path,
    prefix: &OsStr,
    at: impl Fn(&Path) -> io::Result<Option<File>>,
) -> io::Result<(Present, Option<File>)> {
    loop {
        let path = folder.join(name(prefix));
        let file = match at(&path) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => continue,
            made => made?,
        };
        // Before it was locked, another process may have taken it for a leftover.
        if file.as_ref().is_none_or(|file| leftover::lock(file, &path)) {
            return Ok((Present(path), file));
        }
    }
}

pub(super) fn name(prefix: &OsStr) -> OsString {
    let mut drawn = RandomState::new().hash_one(std::process::id());
    let mut name = prefix.to_owned();
    for _ in 0..RANDOM {
        let at = usize::try_from(drawn % CHARACTERS.len() as u64).unwrap_or_default();
        name.push(char::from(CHARACTERS[at]).encode_utf8(&mut [0; 4]));
        drawn /= CHARACTERS.len() as u64;
    }
    let end = checksum(name.as_encoded_bytes());
    name.push(end);
    name
}

fn make_folder(path: &Path, mode: u32) -> io::Result<()> {
    let mut builder = fs::DirBuilder::new();
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, mode);
    builder.create(path)
}

//! Replaces the files of a folder together: after a crash all of them are the old ones, or all are the new ones.
//!
//! The new folder is completed beside the old one, with hard links to all that does not change, and the two exchange
//! their names in one step of the file system. Where that is impossible (see [`exchange`]), files are replaced one by
//! one: the index goes first and comes last, so that a folder which has an index is complete.

mod exchange;
mod in_place;
mod platform;

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Component, Path, PathBuf};

use tempfile::TempDir;

use super::{folder_of, leftover, prefix_for, sync_folder, without_name};

/// The files of a folder that are replaced together. All paths are inside the folder.
pub struct FolderFiles<'a> {
    /// The new files and their content.
    pub new: &'a [(&'a Path, &'a [u8])],
    /// One of the new files: who finds it may rely on the others.
    pub index: &'a Path,
    /// What of the folder at this path is to be replaced or removed. Everything else in it stays.
    pub old: &'a dyn Fn(&Path) -> Vec<PathBuf>,
}

/// Why the files of a folder cannot be replaced.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}", path.display())]
pub struct FolderError {
    /// Where.
    pub path: PathBuf,
    /// Why.
    pub source: io::Error,
}

impl FolderError {
    fn at(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self { path, source: without_name(source) }
    }
}

/// Replaces the files of the folder `out`, which is made if need be with the folders above it. What killed processes
/// have left of earlier attempts at this folder is removed.
///
/// # Errors
/// When something else is in the place of a file or folder, and whatever writing gives. The folder has its old files
/// then; where names cannot be exchanged it may instead have no index.
pub fn replace_folder(out: &Path, files: &FolderFiles<'_>) -> Result<(), FolderError> {
    // Without the slash at the end of `link/`, which would lead through the link.
    let out: &Path = &out.components().collect::<PathBuf>();
    let parent = folder_of(out);
    fs::create_dir_all(parent).map_err(FolderError::at(parent))?;
    leftover::remove(parent, &prefix_for(out));
    if !out.exists() {
        match create(out, files) {
            Err(error) if is_taken(&error.source) => {}
            result => return result,
        }
    }
    check_room(out, files)?;
    leftover::remove(out, &prefix_for(files.index));
    match exchange::replace(out, files) {
        Ok(()) => Ok(()),
        // Whatever was in the way, nothing has changed yet; if it is in the way of this too, its error is the one to tell.
        Err(_) => in_place::replace(out, files),
    }
}

/// Whether another process has made the folder meanwhile.
fn is_taken(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::AlreadyExists | io::ErrorKind::DirectoryNotEmpty)
}

/// Makes a folder that is not there.
fn create(out: &Path, files: &FolderFiles<'_>) -> Result<(), FolderError> {
    let stage = Stage::beside(out).map_err(FolderError::at(folder_of(out)))?;
    stage.write(files, out)?;
    step();
    fs::rename(stage.path(), out).map_err(FolderError::at(out))?;
    stage.keep();
    sync_folder(folder_of(out)).map_err(FolderError::at(out))
}

/// That no folder is in the place of a file, and no file in that of a folder.
fn check_room(out: &Path, files: &FolderFiles<'_>) -> Result<(), FolderError> {
    for (path, _) in files.new {
        if out.join(path).is_dir() {
            return Err(FolderError::at(&out.join(path))(io::ErrorKind::IsADirectory.into()));
        }
        let above = path.ancestors().skip(1).map(|inside| out.join(inside));
        for folder in above.filter(|folder| !folder.is_dir() && fs::symlink_metadata(folder).is_ok()) {
            return Err(FolderError::at(&folder)(io::ErrorKind::NotADirectory.into()));
        }
    }
    Ok(())
}

/// A temporary folder, locked for as long as it is open and removed when dropped.
struct Stage {
    folder: TempDir,
    _lock: Option<File>,
}

impl Stage {
    /// One that may take the place of `out`.
    fn beside(out: &Path) -> io::Result<Self> {
        Self::create(folder_of(out), out)
    }

    /// One in `parent`, named after `target`.
    fn create(parent: &Path, target: &Path) -> io::Result<Self> {
        loop {
            let mut builder = tempfile::Builder::new();
            let prefix = prefix_for(target);
            builder.prefix(&prefix);
            #[cfg(unix)]
            {
                use std::os::unix::fs::PermissionsExt as _;
                // The process's umask takes away from these, as with any other folder.
                builder.permissions(fs::Permissions::from_mode(0o777));
            }
            step();
            let folder = builder.tempdir_in(parent)?;
            let lock = File::open(folder.path()).ok();
            if lock.as_ref().is_none_or(|lock| leftover::lock(lock, folder.path())) {
                return Ok(Self { folder, _lock: lock });
            }
        }
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Leaves the folder where it is.
    fn keep(self) {
        let _ = self.folder.keep();
    }

    /// Writes the new files, on the disk when this returns; `out` is for errors.
    fn write(&self, files: &FolderFiles<'_>, out: &Path) -> Result<(), FolderError> {
        for (path, bytes) in files.new {
            write_synced(&self.path().join(path), bytes).map_err(FolderError::at(&out.join(path)))?;
        }
        sync_folders(self.path(), files).map_err(FolderError::at(out))
    }
}

fn write_synced(path: &Path, bytes: &[u8]) -> io::Result<()> {
    step();
    fs::create_dir_all(folder_of(path))?;
    let mut file = File::create(path)?;
    step();
    file.write_all(bytes)?;
    file.sync_all()
}

/// Synchronises every folder that a new file is in.
fn sync_folders(root: &Path, files: &FolderFiles<'_>) -> io::Result<()> {
    let folders: BTreeSet<_> = files.new.iter().flat_map(|(path, _)| path.ancestors().skip(1)).collect();
    folders.into_iter().try_for_each(|inside| sync_folder(&root.join(inside)))
}

/// What of the folder at `root` goes or is replaced; no path leads out of it. That is also what an attempt in place may
/// have left, and its note.
fn old_files(root: &Path, files: &FolderFiles<'_>) -> BTreeSet<PathBuf> {
    let is_inside = |path: &PathBuf| path.components().all(|part| matches!(part, Component::Normal(_)));
    let noted = fs::read_to_string(root.join(in_place::NOTE)).unwrap_or_default();
    let noted = noted.split_terminator('\0').map(PathBuf::from);
    let old = (files.old)(root).into_iter().chain(noted).filter(is_inside);
    old.chain([PathBuf::from(in_place::NOTE)]).collect()
}

/// A place where the tests end the process.
#[cfg(not(test))]
fn step() {}
#[cfg(test)]
use tests::step;

#[cfg(test)]
mod tests;

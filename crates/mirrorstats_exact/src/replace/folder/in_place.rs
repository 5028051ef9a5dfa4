//! Replaces the files of a folder one by one; meanwhile the folder has a note and no index.

use std::collections::BTreeSet;
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use super::super::new_file::replace as replace_bytes;
use super::super::place::{folder_of, sync_folder};
use super::stage::{FolderError, FolderFiles, NOTE, old_files, stage, step, sync_folders, write};

pub(super) fn replace(out: &Path, files: &FolderFiles<'_>) -> Result<(), FolderError> {
    let _lock = lock(out).map_err(FolderError::at(out))?;
    // Inside the folder, which may be a separate volume.
    let stage = stage(out, files.index.unwrap_or(out)).map_err(FolderError::at(out))?;
    write(stage.path(), files, out)?;
    let old = old_files(out, files);
    note(out, &old, files).map_err(FolderError::at(out))?;
    files.index.map_or(Ok(()), |index| remove(out, index))?;
    sync_folder(out).map_err(FolderError::at(out))?;
    let is_new = |path: &Path| files.new.iter().any(|(new, _)| *new == path);
    for path in old.iter().filter(|path| !is_new(path) && *path != Path::new(NOTE)) {
        remove(out, path)?;
        remove_empty(out, path);
    }
    for (path, _) in files.new.iter().filter(|(path, _)| Some(*path) != files.index) {
        put(stage.path(), out, path)?;
    }
    sync_folders(out, files).map_err(FolderError::at(out))?;
    files.index.map_or(Ok(()), |index| put(stage.path(), out, index))?;
    remove(out, Path::new(NOTE))?;
    step();
    sync_folder(out).map_err(FolderError::at(out))
}

fn note(out: &Path, old: &BTreeSet<PathBuf>, files: &FolderFiles<'_>) -> io::Result<()> {
    let new = files.new.iter().map(|(path, _)| *path);
    let paths: BTreeSet<&Path> = old.iter().map(PathBuf::as_path).chain(new).collect();
    let names: Vec<_> = paths.iter().map(|path| path.to_string_lossy()).collect();
    step();
    replace_bytes(&out.join(NOTE), names.join("\0").as_bytes())
}

fn put(stage: &Path, out: &Path, path: &Path) -> Result<(), FolderError> {
    let target = out.join(path);
    let folder = folder_of(&target);
    step();
    fs::create_dir_all(folder).and_then(|()| fs::rename(stage.join(path), &target)).map_err(FolderError::at(&target))
}

fn remove(out: &Path, inside: &Path) -> Result<(), FolderError> {
    let path = out.join(inside);
    step();
    match fs::remove_file(&path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(FolderError::at(&path)(error)),
        _ => Ok(()),
    }
}

/// Removes the empty folders between a removed file and `out`.
fn remove_empty(out: &Path, path: &Path) {
    let above = path.ancestors().skip(1).filter(|inside| !inside.as_os_str().is_empty());
    for inside in above {
        if fs::remove_dir(out.join(inside)).is_err() {
            break;
        }
    }
}

/// Fails while another process replaces files in the folder: their files would mix. Without file locks this goes
/// unnoticed.
fn lock(out: &Path) -> io::Result<Option<File>> {
    let Ok(folder) = File::open(out) else { return Ok(None) };
    match folder.try_lock() {
        Err(TryLockError::WouldBlock) => {
            Err(io::Error::new(io::ErrorKind::ResourceBusy, "another process writes to it"))
        }
        _ => Ok(Some(folder)),
    }
}

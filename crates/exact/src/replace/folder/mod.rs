//! Replaces the files of a folder together: after a crash all of them are the old ones, or all are the new ones.
//!
//! The new folder is completed beside the old one, with hard links to all that does not change, and the two exchange
//! their names in one step of the file system. Where that is impossible (see [`exchange`]), files are replaced one by
//! one: a note says so until all are replaced, and the index goes first and comes last, so that a folder without a note or
//! with an index is complete.

mod exchange;
mod in_place;
mod platform;
mod stage;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::leftover;
use super::place::{folder_of, make_folder, sync_folder};
pub use stage::{Content, FolderError, FolderFiles, is_unfinished};
use stage::{Stage, step};

/// Replaces the files of the folder `out`, which is made if need be with the folders above it. What killed processes
/// have left of earlier attempts at this folder is removed.
pub fn replace_folder(out: &Path, files: &FolderFiles<'_>) -> Result<(), FolderError> {
    // Without the slash at the end of `link/`, which would lead through the link.
    let out: &Path = &out.components().collect::<PathBuf>();
    let parent = folder_of(out);
    make_folder(parent).map_err(FolderError::at(parent))?;
    leftover::sweep(parent);
    if !out.exists() {
        match create(out, files) {
            Err(error) if is_taken(&error.source) => {}
            result => return result,
        }
    }
    check_room(out, files)?;
    leftover::sweep(out);
    match exchange::replace(out, files) {
        Ok(synced) => synced.map_err(FolderError::at(out)),
        // Whatever was in the way, nothing has changed yet; if it is in the way of this too, its error is the one to tell.
        Err(_) => in_place::replace(out, files),
    }
}

fn is_taken(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::AlreadyExists | io::ErrorKind::DirectoryNotEmpty)
}

fn create(out: &Path, files: &FolderFiles<'_>) -> Result<(), FolderError> {
    let stage = Stage::beside(out).map_err(FolderError::at(folder_of(out)))?;
    stage.write(files, out)?;
    step();
    fs::rename(stage.path(), out).map_err(FolderError::at(out))?;
    stage.keep();
    sync_folder(folder_of(out)).map_err(FolderError::at(out))
}

fn check_room(out: &Path, files: &FolderFiles<'_>) -> Result<(), FolderError> {
    for (path, _) in files.new {
        if out.join(path).is_dir() {
            return Err(FolderError::at(&out.join(path))(io::ErrorKind::IsADirectory.into()));
        }
        let mut above = path.ancestors().skip(1).map(|inside| out.join(inside));
        if let Some(folder) = above.find(|folder| !folder.is_dir() && fs::symlink_metadata(folder).is_ok()) {
            return Err(FolderError::at(&folder)(io::ErrorKind::NotADirectory.into()));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;

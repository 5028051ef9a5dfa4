//! Replaces the files of a folder together: after a crash either all files are old or all are new.
//!
//! The new folder is completed beside the old one, with hard links to all unchanged files. Then the two exchange names
//! in one step of the file system. If that is impossible (see [`exchange`]), files are replaced one by one. A note
//! marks the folder until all are replaced. The index is removed first and written last. So a folder without a note, or
//! with an index, is complete.

#[cfg(target_os = "linux")]
mod exchange;
mod in_place;
mod stage;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::leftover;
use super::place::{folder_of, make_folder, sync_folder};
pub use stage::{Content, FolderError, FolderFiles, is_unfinished};
use stage::{stage, step, write};

/// Replaces the files of the folder `out`, creating it and its parents if needed. Leftovers of killed processes that
/// worked on this folder are removed.
pub fn replace_folder(out: &Path, files: &FolderFiles<'_>) -> Result<(), FolderError> {
    // Without the final slash of `link/`, which would follow the link.
    let out: &Path = &out.components().collect::<PathBuf>();
    let parent = folder_of(out);
    make_folder(parent).map_err(FolderError::at(parent))?;
    leftover::sweep(parent);
    if !out.exists() {
        match create(out, files) {
            Err(FolderError { source, .. })
                if matches!(source.kind(), io::ErrorKind::AlreadyExists | io::ErrorKind::DirectoryNotEmpty) => {}
            result => return result,
        }
    }
    check_room(out, files)?;
    leftover::sweep(out);
    #[cfg(target_os = "linux")]
    if let Ok(synced) = exchange::replace(out, files) {
        return synced.map_err(FolderError::at(out));
    }
    // Nothing has changed yet. If the same obstacle stops the replacement in place, that error is reported.
    in_place::replace(out, files)
}

fn create(out: &Path, files: &FolderFiles<'_>) -> Result<(), FolderError> {
    let stage = stage(folder_of(out), out).map_err(FolderError::at(folder_of(out)))?;
    write(stage.path(), files, out)?;
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

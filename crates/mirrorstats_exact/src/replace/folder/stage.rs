//! The new files of a folder, written beside the old ones.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Component, Path, PathBuf};

use super::super::place::{folder_of, prefix_for, sync_folder};
use super::super::temporary::TemporaryFolder;

/// A file that marks a folder with old and new files; it lists what the next attempt replaces or removes.
pub(super) const NOTE: &str = ".mirrorstats-unfinished";

#[derive(Clone, Copy, Debug)]
pub enum Content<'a> {
    Bytes(&'a [u8]),
    /// The bytes of a file, which stays where it is.
    File(&'a Path),
}

/// The files of a folder that are replaced together. All paths are inside the folder.
pub struct FolderFiles<'a> {
    pub new: &'a [(&'a Path, Content<'a>)],
    /// One of the new files, if readers find the others through it.
    pub index: Option<&'a Path>,
    /// Returns the files of the folder that will be replaced or removed. Everything else stays.
    pub old: &'a dyn Fn(&Path) -> Vec<PathBuf>,
}

/// Returns true if a folder has old and new files, because a replacement in place was interrupted.
pub fn is_unfinished(folder: &Path) -> bool {
    folder.join(NOTE).is_file()
}

#[derive(Debug, thiserror::Error)]
#[error("cannot write {}", path.display())]
pub struct FolderError {
    pub path: PathBuf,
    pub source: io::Error,
}

impl FolderError {
    pub(super) fn at(path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self { path, source }
    }
}

/// Creates a folder for the new files in `parent`, named after `target`.
pub(super) fn stage(parent: &Path, target: &Path) -> io::Result<TemporaryFolder> {
    step();
    TemporaryFolder::with_mode(parent, &prefix_for(target), 0o777)
}

/// Writes the new files into `stage`; they are on the disk when this returns. `out` is for errors.
pub(super) fn write(stage: &Path, files: &FolderFiles<'_>, out: &Path) -> Result<(), FolderError> {
    for (path, content) in files.new {
        write_synced(&stage.join(path), *content).map_err(FolderError::at(&out.join(path)))?;
    }
    sync_folders(stage, files).map_err(FolderError::at(out))
}

fn write_synced(path: &Path, content: Content<'_>) -> io::Result<()> {
    step();
    fs::create_dir_all(folder_of(path))?;
    let mut file = File::create(path)?;
    step();
    match content {
        Content::Bytes(bytes) => file.write_all(bytes)?,
        Content::File(source) => io::copy(&mut File::open(source)?, &mut file).map(drop)?,
    }
    file.sync_all()
}

pub(super) fn sync_folders(root: &Path, files: &FolderFiles<'_>) -> io::Result<()> {
    let folders: BTreeSet<_> = files.new.iter().flat_map(|(path, _)| path.ancestors().skip(1)).collect();
    folders.into_iter().try_for_each(|inside| sync_folder(&root.join(inside)))
}

/// The files of the folder at `root` that are removed or replaced: the old ones, those in the note of an interrupted
/// attempt, and the note. No path leaves the folder.
pub(super) fn old_files(root: &Path, files: &FolderFiles<'_>) -> BTreeSet<PathBuf> {
    let is_inside = |path: &PathBuf| path.components().all(|part| matches!(part, Component::Normal(_)));
    let noted = fs::read_to_string(root.join(NOTE)).unwrap_or_default();
    let noted = noted.split('\0').filter(|path| !path.is_empty()).map(PathBuf::from);
    let old = (files.old)(root).into_iter().chain(noted).filter(is_inside);
    old.chain([PathBuf::from(NOTE)]).collect()
}

#[cfg(not(test))]
pub(super) fn step() {}
#[cfg(test)]
pub(super) use super::tests::step;

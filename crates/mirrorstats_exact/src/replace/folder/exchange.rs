//! Replaces a folder by exchanging its name with that of a complete new one.
//!
//! Only Linux has this. It fails, and files are replaced in place, if the file system cannot exchange names; if the
//! folder is a link or a mount point, or contains one; if it contains the current folder, which would vanish; if
//! something in it cannot be linked or would change its owner; or if it is not writable, so that the usual error appears.

use std::collections::BTreeSet;
use std::fs::{self, File, Metadata};
use std::io;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

use rustix::fs::{self as system, Access, AtFlags, CWD, RenameFlags, StatxAttributes, StatxFlags};

use super::super::place::{folder_of, sync_folder};
use super::stage::{FolderFiles, old_files, stage, step, write};

/// Replaces the files of the existing folder `out`. The inner result says whether the new names are on the disk.
pub(super) fn replace(out: &Path, files: &FolderFiles<'_>) -> io::Result<io::Result<()>> {
    check(out)?;
    let stage = stage(folder_of(out), out)?;
    write(stage.path(), files, out).map_err(|error| error.source)?;
    link_others(out, stage.path(), files)?;
    make_alike(&fs::symlink_metadata(out)?, stage.path())?;
    sync_folder(stage.path())?;
    // The old folder is this process's to remove, also under its new name. No process waits for this lock.
    let old = File::open(out)?;
    let _ = old.try_lock();
    step();
    system::renameat_with(CWD, stage.path(), CWD, out, RenameFlags::EXCHANGE)?;
    // The new files are in place now, so errors are no reason to replace them again.
    let synced = sync_folder(folder_of(out));
    step();
    // Link what others put into the old folder in the meantime.
    let _ = link_others(stage.path(), out, files);
    step();
    if synced.is_err() {
        // After a loss of power the old folder may have its name back, so it must still have its files.
        stage.keep();
    }
    Ok(synced)
}

fn check(out: &Path) -> io::Result<()> {
    let is_folder = out.file_name().is_some() && fs::symlink_metadata(out)?.is_dir();
    let here = std::env::current_dir()?;
    if !is_folder || is_mount_point(out)? || here.starts_with(out.canonicalize()?) {
        return Err(io::ErrorKind::Unsupported.into());
    }
    Ok(system::access(out, Access::WRITE_OK)?)
}

/// Returns true if another file system, or another part of one, begins at the folder. Hard links across this border are
/// impossible, and the contents behind it must never be removed with the folder.
fn is_mount_point(folder: &Path) -> io::Result<bool> {
    let found = system::statx(CWD, folder, AtFlags::SYMLINK_NOFOLLOW, StatxFlags::BASIC_STATS)?;
    // Linux before 5.8 does not report this.
    if !found.stx_attributes_mask.contains(StatxAttributes::MOUNT_ROOT) {
        return Err(io::ErrorKind::Unsupported.into());
    }
    Ok(found.stx_attributes.contains(StatxAttributes::MOUNT_ROOT))
}

/// Links everything below `from` into `to`, except old files and paths that `to` has already.
fn link_others(from: &Path, to: &Path, files: &FolderFiles<'_>) -> io::Result<()> {
    link_below(from, to, Path::new(""), &old_files(from, files))
}

fn link_below(from: &Path, to: &Path, inside: &Path, old: &BTreeSet<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(from.join(inside))? {
        let entry = entry?;
        let inside = inside.join(entry.file_name());
        let target = to.join(&inside);
        if entry.file_type()?.is_dir() {
            link_folder(from, to, &inside, old)?;
        } else if target.is_dir() {
            // `from` has a link here, and `to` a folder with new files.
            return Err(io::ErrorKind::Unsupported.into());
        } else if !old.contains(&inside) && fs::symlink_metadata(&target).is_err() {
            step();
            fs::create_dir_all(folder_of(&target))?;
            fs::hard_link(entry.path(), target)?;
        }
    }
    Ok(())
}

fn link_folder(from: &Path, to: &Path, inside: &Path, old: &BTreeSet<PathBuf>) -> io::Result<()> {
    let (source, target) = (from.join(inside), to.join(inside));
    if is_mount_point(&source)? {
        return Err(io::ErrorKind::Unsupported.into());
    }
    if fs::read_dir(&source)?.next().is_none() {
        fs::create_dir_all(&target)?;
    }
    link_below(from, to, inside, old)?;
    if !target.is_dir() {
        return Ok(());
    }
    make_alike(&fs::symlink_metadata(&source)?, &target)?;
    sync_folder(&target)
}

fn make_alike(old: &Metadata, new: &Path) -> io::Result<()> {
    let owner = |metadata: &Metadata| (metadata.uid(), metadata.gid());
    if owner(old) != owner(&fs::symlink_metadata(new)?) {
        return Err(io::ErrorKind::Unsupported.into());
    }
    fs::set_permissions(new, old.permissions())
}

//! Folder operations that only some systems support; on others they return an error.

use std::fs::Metadata;
use std::io;
use std::path::Path;

#[cfg(target_os = "linux")]
use rustix::fs::{self as system, Access, AtFlags, CWD, RenameFlags, StatxAttributes, StatxFlags};

#[cfg(target_os = "linux")]
pub(super) fn exchange(a: &Path, b: &Path) -> io::Result<()> {
    Ok(system::renameat_with(CWD, a, CWD, b, RenameFlags::EXCHANGE)?)
}

#[cfg(not(target_os = "linux"))]
pub(super) fn exchange(_: &Path, _: &Path) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

/// Returns true if another file system, or another part of one, begins at the folder. Hard links across this border are
/// impossible, and the contents behind it must never be removed with the folder.
#[cfg(target_os = "linux")]
pub(super) fn is_mount_point(folder: &Path) -> io::Result<bool> {
    let found = system::statx(CWD, folder, AtFlags::SYMLINK_NOFOLLOW, StatxFlags::BASIC_STATS)?;
    // Linux before 5.8 does not report this.
    if !found.stx_attributes_mask.contains(StatxAttributes::MOUNT_ROOT) {
        return Err(io::ErrorKind::Unsupported.into());
    }
    Ok(found.stx_attributes.contains(StatxAttributes::MOUNT_ROOT))
}

#[cfg(not(target_os = "linux"))]
pub(super) fn is_mount_point(_: &Path) -> io::Result<bool> {
    Err(io::ErrorKind::Unsupported.into())
}

#[cfg(target_os = "linux")]
pub(super) fn check_writable(folder: &Path) -> io::Result<()> {
    Ok(system::access(folder, Access::WRITE_OK)?)
}

#[cfg(not(target_os = "linux"))]
pub(super) fn check_writable(_: &Path) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

#[cfg(unix)]
pub(super) fn has_same_owner(a: &Metadata, b: &Metadata) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    (a.uid(), a.gid()) == (b.uid(), b.gid())
}

#[cfg(not(unix))]
pub(super) fn has_same_owner(_: &Metadata, _: &Metadata) -> bool {
    false
}

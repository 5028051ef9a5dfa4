//! Target paths, temporary names, and the check that a target can be replaced.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io;
use std::path::Path;

use crate::hash;

/// The start of every temporary name; programs that look for data skip names that begin with a dot.
pub(super) const PREFIX: &str = ".mirrorstats-";
pub(super) const RANDOM: usize = 6;
/// The number of characters of a checksum at the end of a temporary name.
const CHECK: usize = 10;
/// The most bytes of the target's name in a temporary name: file systems allow 255 in all.
const LONGEST_NAME: usize = 200;

pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Creates a folder and its parents. Each is on the disk when this returns, so that a loss of power cannot take away a
/// folder with synchronised files.
pub fn make_folder(folder: &Path) -> io::Result<()> {
    if folder.is_dir() {
        return Ok(());
    }
    let above = folder_of(folder);
    if above != folder {
        make_folder(above)?;
    }
    match fs::create_dir(folder) {
        // Another process has created it meanwhile.
        Err(_) if folder.is_dir() => {}
        made => made?,
    }
    sync_folder(above)
}

/// Waits until the names in a folder are on the disk.
pub fn sync_folder(folder: &Path) -> io::Result<()> {
    if cfg!(not(unix)) {
        return Ok(());
    }
    let synced = File::open(folder).and_then(|folder| folder.sync_all());
    synced.or_else(|error| match error.kind() {
        io::ErrorKind::PermissionDenied | io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported => Ok(()),
        _ => Err(error),
    })
}

/// Returns true if `target` can only be written into: a pipe, a device, or the name of an open file of the process.
pub fn is_stream(target: &Path) -> bool {
    let names_open_file = cfg!(unix)
        && (["/dev/stdout", "/dev/stderr"].iter().any(|name| target == Path::new(name))
            || folder_of(target) == Path::new("/dev/fd")
            || (target.starts_with("/proc") && folder_of(target).ends_with("fd")));
    fs::metadata(target).is_ok_and(|metadata| names_open_file || !metadata.is_file() && !metadata.is_dir())
}

pub(super) fn prefix_for(target: &Path) -> OsString {
    let name = target.file_name().unwrap_or_default();
    let mut prefix = OsString::from(PREFIX);
    if name.len() <= LONGEST_NAME {
        prefix.push(name);
    } else {
        prefix.push(name.to_string_lossy().chars().take(LONGEST_NAME / 4).collect::<String>());
    }
    prefix.push(".");
    prefix
}

pub(super) fn checksum(before: &[u8]) -> String {
    hash::of_bytes(before)[..CHECK].to_owned()
}

/// Returns true if [`temporary`](super::temporary) could have made this name.
pub(super) fn is_temporary(name: &OsStr) -> bool {
    let name = name.as_encoded_bytes();
    name.starts_with(PREFIX.as_bytes())
        && name
            .split_at_checked(name.len().saturating_sub(CHECK))
            .is_some_and(|(before, end)| checksum(before).as_bytes() == end)
}

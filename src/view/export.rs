//! The page as files, for any web server or from a disk.

use std::path::Path;

use super::View;
use super::error::ViewError;

/// What is asked of programs that collect pages.
pub const ROBOTS: &str = "# Recordings of evaluations: not for training.\nUser-agent: *\nDisallow: /\n";

/// Writes the page of everything that is whole; gives the number of files.
///
/// # Errors
/// Whatever the recordings or the disk refuse; the folder is as it was then.
pub fn write(_view: &View, _folder: &Path) -> Result<usize, ViewError> {
    Ok(0)
}

//! Whether an output would replace one of the inputs.

use std::fs;
use std::path::Path;

use super::place::is_stream;

/// A target that is one of the files which the command reads.
#[derive(Debug, thiserror::Error)]
#[error("`{target}`: expected another file to write, found {what}\n  help: give the output another name")]
pub struct TargetIsInput {
    /// The target, as typed.
    target: String,
    /// What it is to the command.
    what: String,
}

/// Refuses a target that is one of `inputs`, under whatever name, link or path; `what` says what the inputs are, such
/// as `a trace that is read`.
///
/// A device, a pipe or a standard stream is no file that is replaced, and is not refused.
///
/// # Errors
/// [`TargetIsInput`].
pub fn check_target<P: AsRef<Path>>(
    target: &Path,
    inputs: impl IntoIterator<Item = P>,
    what: &str,
) -> Result<(), TargetIsInput> {
    if !target.is_file() || is_stream(target) {
        return Ok(());
    }
    match inputs.into_iter().find(|input| is_same_file(target, input.as_ref())) {
        None => Ok(()),
        Some(_) => Err(TargetIsInput { target: target.display().to_string(), what: what.to_owned() }),
    }
}

/// Whether two paths lead to one existing file: links are followed, and hard links are one file.
#[cfg(unix)]
pub fn is_same_file(a: &Path, b: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let place = |path: &Path| fs::metadata(path).map(|metadata| (metadata.dev(), metadata.ino()));
    matches!((place(a), place(b)), (Ok(a), Ok(b)) if a == b)
}

/// Whether two paths lead to one existing file: links are followed.
#[cfg(not(unix))]
pub fn is_same_file(a: &Path, b: &Path) -> bool {
    matches!((fs::canonicalize(a), fs::canonicalize(b)), (Ok(a), Ok(b)) if a == b)
}

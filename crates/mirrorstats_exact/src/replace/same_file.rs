//! Checks that an output does not replace an input.

use std::fs::{self, Metadata};
use std::io;
#[cfg(unix)]
use std::os::unix::fs::MetadataExt;
use std::path::Path;

use super::place::is_stream;

/// The error for a target that the command also reads.
#[derive(Debug, thiserror::Error)]
#[error("`{target}`: expected another file to write, found {what}\n  help: give the output another name")]
pub struct TargetIsInput {
    target: String,
    what: String,
}

/// Refuses a target that is one of `inputs`, under any name, link or path. `what` describes the inputs, such as `a
/// trace that is read`. Devices, pipes and standard streams are not replaced, so they pass.
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

/// The error for an output folder that contains an input.
#[derive(Debug, thiserror::Error)]
#[error(
    "`{folder}`: expected a folder for outputs, found an input in it (`{input}`): both would be read together from then \
     on\n  help: name another folder; it may be a new one inside this one"
)]
pub struct FolderHoldsInput {
    folder: String,
    input: String,
}

/// Refuses an output folder that contains one of `inputs`, at any depth and under any name.
pub fn check_folder<P: AsRef<Path>>(
    folder: &Path,
    inputs: impl IntoIterator<Item = P>,
) -> Result<(), FolderHoldsInput> {
    let Ok(place) = fs::canonicalize(folder) else { return Ok(()) };
    let is_inside = |input: &P| fs::canonicalize(input).is_ok_and(|input| input.starts_with(&place));
    let Some(input) = inputs.into_iter().find(is_inside) else { return Ok(()) };
    let name = input.as_ref().file_name().unwrap_or_default().to_string_lossy().into_owned();
    Err(FolderHoldsInput { folder: folder.display().to_string(), input: name })
}

/// Returns true if two paths lead to the same existing file: links are followed, and hard links are one file.
pub fn is_same_file(a: &Path, b: &Path) -> bool {
    let is_one_path = || matches!((fs::canonicalize(a), fs::canonicalize(b)), (Ok(a), Ok(b)) if a == b);
    if cfg!(unix) { is_one_file(fs::metadata(a), fs::metadata(b)) } else { is_one_path() }
}

/// Returns true if both are of one existing file; false on systems that do not number files.
pub(super) fn is_one_file(a: io::Result<Metadata>, b: io::Result<Metadata>) -> bool {
    #[cfg(unix)]
    let number = |file: &Metadata| Some((MetadataExt::dev(file), MetadataExt::ino(file)));
    #[cfg(not(unix))]
    let number = |_: &Metadata| None::<(u64, u64)>;
    a.is_ok_and(|a| b.is_ok_and(|b| number(&a).is_some() && number(&a) == number(&b)))
}

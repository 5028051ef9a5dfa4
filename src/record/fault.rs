//! Why the folder of a recording cannot be used.

use std::io;
use std::path::{Path, PathBuf};

use crate::base::replace::without_name;
use crate::log::LogError;
use crate::trace::error::TraceError;

/// Why the folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The operating system refuses.
    #[error("cannot {doing} `{}`: {source}\n  help: is the folder writable, and the disk not full?", path.display())]
    Io {
        /// What was being done.
        doing: &'static str,
        /// To which file.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// What is there was recorded differently.
    #[error(
        "`{}` was recorded with another {what}: expected {expected}, found {found}\n  \
         help: record into another folder, or remove the file to record it anew",
        path.display()
    )]
    Different {
        /// The file.
        path: PathBuf,
        /// What differs: a key of the recording's metadata.
        what: String,
        /// What this recording has.
        expected: String,
        /// What the file has.
        found: String,
    },
    /// The log that is there is not that of the trace.
    #[error("the log `{}` does not belong to this recording: {fault}\n  help: {help}", path.display())]
    ForeignLog {
        /// The log.
        path: PathBuf,
        /// What differs.
        fault: String,
        /// What to do.
        help: String,
    },
    /// The log of an episode that is not in the log of its experiment yet is damaged.
    #[error(
        "the log `{}` is damaged: {fault}\n  \
         help: remove it and `{}`; the same command records the episode again",
        path.display(),
        path.with_extension("parquet").display()
    )]
    DamagedPart {
        /// The log.
        path: PathBuf,
        /// What was found.
        fault: String,
    },
    /// A trace cannot be read or written.
    #[error(transparent)]
    Trace(#[from] TraceError),
    /// A log cannot be read or written.
    #[error(transparent)]
    Log(#[from] LogError),
}

impl StoreError {
    pub(super) fn io(doing: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { doing, path: path.to_owned(), source: without_name(source) }
    }
}

use std::io;
use std::path::{Path, PathBuf};

use super::metadata::Difference;
use mirrorstats_agents::Lost;
use mirrorstats_log::LogError;
use mirrorstats_trace::error::TraceError;

#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    #[error(
        "another process records into `{}`\n  \
         help: wait for its end, or give each process its own --out, with --shard to divide the episodes; `record \
         study.toml` records several models in one process",
        folder.display()
    )]
    Busy { folder: PathBuf },
    #[error("cannot {doing} `{}`: {source}\n  help: is the folder writable, and the disk not full?", path.display())]
    Io { doing: &'static str, path: PathBuf, source: io::Error },
    #[error(
        "`{}` was recorded with another {what}: expected {expected}, found {found}\n  \
         help: record into another folder, or remove the file to record it anew",
        path.display()
    )]
    Different { path: PathBuf, what: String, expected: String, found: String },
    #[error(
        "the program's files changed since `{}` was recorded (agent.files: expected {expected}, found {found})\n  \
         help: put the files back as they were, or record into another folder; a file that the program writes itself is \
         named within a word, such as --log=FILE",
        path.display()
    )]
    Files { path: PathBuf, expected: String, found: String },
    #[error("the log `{}` does not belong to this recording: {fault}\n  help: {help}", path.display())]
    ForeignLog { path: PathBuf, fault: String, help: String },
    #[error(
        "the log `{}` is damaged: {fault}\n  \
         help: remove it and `{}`; the same command records the episode again",
        path.display(),
        path.with_extension("parquet").display()
    )]
    DamagedPart { path: PathBuf, fault: String },
    #[error(transparent)]
    Trace(#[from] TraceError),
    #[error(transparent)]
    Log(#[from] LogError),
}

impl StoreError {
    pub(super) fn different(path: &Path, Difference { what, expected, found }: Difference) -> Self {
        let path = path.to_owned();
        if what == "agent.files" {
            return Self::Files { path, expected, found };
        }
        Self::Different { path, what, expected, found }
    }

    pub(super) fn io(doing: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { doing, path: path.to_owned(), source }
    }
}

#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    #[error("stopped")]
    Stopped,
    #[error("{lost}")]
    Lost {
        /// The step that got no reply; `None` before the first.
        step: Option<i32>,
        lost: Lost,
    },
    /// The world, the camera or the disk failed, which would affect every episode.
    #[error(transparent)]
    Fatal(Box<dyn std::error::Error + Send + Sync>),
}

impl RecordError {
    pub(crate) fn fatal(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        Self::Fatal(error.into())
    }
}

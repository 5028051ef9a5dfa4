use std::io;
use std::path::Path;

#[derive(Debug, thiserror::Error)]
pub enum LogError {
    #[error(
        "cannot {doing} the log `{file}`: {source}\n  help: is the folder there and writable, and the disk not full?"
    )]
    Io { doing: &'static str, file: String, source: io::Error },
    #[error(
        "the log `{file}` is damaged: {fault}\n  help: `mirrorstats trace recover {file} -o TRACE.parquet` saves what can be saved"
    )]
    Damaged { file: String, fault: String },
    #[error("`{file}` is no log of a recording: {fault}")]
    Foreign { file: String, fault: String },
}

impl LogError {
    pub(super) fn io(doing: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let file = path.display().to_string();
        move |source| Self::Io { doing, file, source }
    }

    /// An error of the MCAP library while writing.
    pub(super) fn writing(path: &Path) -> impl FnOnce(mcap::McapError) -> Self {
        let file = path.display().to_string();
        move |error| {
            let source = match error {
                mcap::McapError::Io(source) => source,
                // The library reports a disk error as a record that cannot be parsed; the cause has the message.
                mcap::McapError::Parse(cause) => io::Error::other(cause.root_cause().to_string()),
                other => io::Error::other(other),
            };
            Self::Io { doing: "write", file, source }
        }
    }
}

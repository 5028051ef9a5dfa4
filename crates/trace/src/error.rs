//! Errors of reading and writing traces.

use std::io;
use std::path::Path;

use arrow::error::ArrowError;

use super::diagnostic::Finding;

/// An error of reading or writing traces.
#[derive(Debug, thiserror::Error)]
pub enum TraceError {
    /// A rule of the schema does not hold.
    #[error("{first}{}", more_findings(*.more))]
    Finding {
        /// The earliest finding by file, row group and row.
        first: Box<Finding>,
        /// The number of further findings; `validate` shows them all.
        more: usize,
    },
    /// The operating system refused to read something that is not yet known as a trace.
    #[error("cannot read {what}")]
    Read {
        /// The requested path, as the user named it.
        what: String,
        /// The reason for the refusal.
        source: io::Error,
    },
    /// An argument gives no trace.
    #[error("`{argument}`: expected {expected}, found {found}; {help}")]
    NoInput {
        /// As typed.
        argument: String,
        /// The valid arguments.
        expected: &'static str,
        /// The argument found.
        found: String,
        /// The remedy.
        help: &'static str,
    },
    /// A file cannot be taken over into another trace.
    #[error("cannot take over the episodes of `{file}`: {source}")]
    Part {
        file: String,
        /// The reason for the refusal.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// Threads could not be started.
    #[error("cannot start {threads} threads; ask for fewer with --threads")]
    Threads {
        /// The requested number.
        threads: usize,
        /// The reason for the refusal.
        source: io::Error,
    },
    /// A column was asked for that the traces cannot give.
    #[error("column `{column}`: expected {expected}, found {found}")]
    Column {
        /// The name asked for.
        column: String,
        /// The expected files.
        expected: &'static str,
        /// The files found.
        found: String,
    },
    /// Columns could not be put together in memory.
    #[error("cannot hold the rows in memory; report this as a fault of mirrorstats")]
    Memory(#[source] ArrowError),
    /// The writer's input is not an episode of the schema.
    #[error("episode `{episode}`: expected {expected}, found {found}; nothing of it was written")]
    Refused {
        /// The id of the episode.
        episode: String,
        /// The rule.
        expected: String,
        found: String,
    },
    /// The trace could not be written; no file was left behind.
    #[error("cannot write the trace {file}, and left no file behind: is the folder writable, and the disk not full?")]
    Write {
        /// The file, as named.
        file: String,
        /// The reason for the refusal.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

fn more_findings(more: usize) -> String {
    match more {
        0 => String::new(),
        more => format!("\n  and {more} more: `mirrorstats trace validate` shows them all"),
    }
}

impl TraceError {
    /// The same error, about the output at `path` if writing failed.
    #[must_use]
    pub fn writing(self, path: &Path) -> Self {
        match self {
            Self::Write { source, .. } => Self::Write { file: path.display().to_string(), source },
            other => other,
        }
    }

    /// The error of these findings, the earliest first; `None` for none.
    pub fn of(findings: Vec<Finding>) -> Option<Self> {
        let mut findings = findings.into_iter();
        let first = Box::new(findings.next()?);
        Some(Self::Finding { first, more: findings.len() })
    }
}

impl From<Finding> for TraceError {
    fn from(finding: Finding) -> Self {
        Box::new(finding).into()
    }
}

impl From<Box<Finding>> for TraceError {
    fn from(first: Box<Finding>) -> Self {
        Self::Finding { first, more: 0 }
    }
}

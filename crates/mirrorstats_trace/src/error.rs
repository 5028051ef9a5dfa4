use std::io;
use std::path::Path;

use arrow::error::ArrowError;

use super::beside::ListError;
use super::diagnostic::Finding;

#[derive(Debug, thiserror::Error)]
pub enum TraceError {
    #[error("{first}{}", more_findings(*.more))]
    Finding { first: Box<Finding>, more: usize },
    #[error("cannot read {what}")]
    Read { what: String, source: io::Error },
    #[error("`{argument}`: expected {expected}, found {found}; {help}")]
    NoInput { argument: String, expected: &'static str, found: String, help: &'static str },
    #[error(transparent)]
    List(#[from] ListError),
    #[error("cannot take over the episodes of `{file}`: {source}")]
    Part { file: String, source: Box<dyn std::error::Error + Send + Sync> },
    #[error("cannot start the threads of --threads {threads}; use fewer")]
    Threads { threads: usize, source: io::Error },
    #[error("column `{column}`: expected {expected}, found {found}")]
    Column { column: String, expected: &'static str, found: String },
    #[error("cannot hold the rows in memory; report this as a fault of mirrorstats")]
    Memory(#[source] ArrowError),
    #[error("episode `{episode}`: expected {expected}, found {found}; the episode was not written")]
    Refused { episode: String, expected: String, found: String },
    #[error("cannot write the trace {file}, and left no file behind: is the folder writable, and the disk not full?")]
    Write { file: String, source: Box<dyn std::error::Error + Send + Sync> },
}

fn more_findings(more: usize) -> String {
    match more {
        0 => String::new(),
        more => format!("\n  and {more} more: `mirrorstats trace validate` shows them all"),
    }
}

impl TraceError {
    pub fn write(file: impl AsRef<Path>, source: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        Self::Write { file: file.as_ref().display().to_string(), source: source.into() }
    }

    pub fn from_findings(findings: Vec<Finding>) -> Option<Self> {
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

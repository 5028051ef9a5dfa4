//! The private folder of one submission: its request and the driver's answer.

use std::fs;
use std::path::PathBuf;

use super::SparkError;
use exact::replace::TemporaryFolder;

pub(super) struct Place(TemporaryFolder);

impl Place {
    pub(super) fn new() -> Result<Self, SparkError> {
        // The request may hold secrets.
        let made = TemporaryFolder::private("spark");
        made.map(Self).map_err(|source| SparkError::System { what: "make a temporary folder".into(), source })
    }

    pub(super) fn table(&self) -> PathBuf {
        self.0.path().join("table.jsonl")
    }

    pub(super) fn answer(&self) -> PathBuf {
        self.0.path().join("answer.json")
    }

    /// The default path of Spark's log.
    pub(super) fn log(&self) -> PathBuf {
        self.0.path().join("log")
    }

    pub(super) fn file(&self, name: &str, bytes: &[u8]) -> Result<PathBuf, SparkError> {
        let path = self.0.path().join(name);
        fs::write(&path, bytes)
            .map_err(|source| SparkError::System { what: "write a temporary file".into(), source })?;
        Ok(path)
    }
}

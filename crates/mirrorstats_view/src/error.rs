//! The errors of the viewer.

use std::error::Error as _;
use std::io;
use std::path::PathBuf;

use mirrorstats_exact::escape::{visible, visible_lines};
use mirrorstats_log::LogError;
use mirrorstats_study::StudyError;
use mirrorstats_toml_spec::Faults;
use mirrorstats_trace::beside::ListError;
use mirrorstats_trace::error::TraceError;

/// A folder of copies, and the folder of their originals.
pub(super) type Renamed = (PathBuf, PathBuf);

/// An error of the viewer.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    #[error(transparent)]
    Study(Box<StudyError>),
    #[error(transparent)]
    Trace(#[from] TraceError),
    #[error(transparent)]
    Labels(#[from] ListError),
    #[error(transparent)]
    Log(#[from] LogError),
    #[error("cannot list the folder `{}`: {source}", visible(&folder.to_string_lossy()))]
    Folder { folder: PathBuf, source: io::Error },
    #[cfg(feature = "sim")]
    #[error("no frames: {0}")]
    Replay(#[from] Box<mirrorstats_record::replay::error::ReplayError>),
    #[error("{0}")]
    Absent(String),
    #[error("{0}")]
    Request(String),
    #[error("cannot write the page: {0}\n  help: is the folder there and writable, and the disk not full?")]
    Write(#[from] mirrorstats_exact::replace::FolderError),
}

impl From<StudyError> for ViewError {
    fn from(error: StudyError) -> Self {
        Self::Study(Box::new(error))
    }
}

impl ViewError {
    /// The same error with the names of the originals instead of their copies.
    pub(super) fn renamed(self, folders: &[Renamed]) -> Self {
        let (words, shown) = (self.words(), |path: &std::path::Path| path.display().to_string());
        let renamed = |words: String, (own, original): &Renamed| words.replace(&shown(own), &shown(original));
        let found = folders.iter().fold(words.clone(), renamed);
        if found == words { self } else { Self::Absent(found) }
    }

    pub(super) fn words(&self) -> String {
        if let Some(faults) = Faults::of(self) {
            return faults.render(false);
        }
        let mut words = visible_lines(&self.to_string());
        let mut cause = self.source();
        while let Some(error) = cause {
            let text = visible_lines(&error.to_string());
            if !words.contains(&text) {
                words.push('\n');
                words.push_str(&text);
            }
            cause = error.source();
        }
        words
    }
}

//! The local web application: a study as a page, each episode step by step, and two episodes side by side.
//!
//! ```text
//! found ──► snapshot ──► filter ──► list, overview, episode, map, compare, changes   (answers: JSON, PNG)
//! (files)   (one scan)              │
//!           live                    ├──► routes   (a server for one machine, behind `web`)
//!           (a newer snapshot)      └──► export   (the same answers as files)
//! ```
//!
//! Rule: the program computes and the page shows: no number is made in the browser. Ids in requests are looked up among
//! the open episodes and never become part of a path. With a coder the server adds lines to `labels.jsonl` beside the
//! traces; it writes nothing else into the input folders.
//!
//! ```
//! use mirrorstats_view::{Options, View};
//!
//! # let paper = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/paper");
//! let view = View::open(Options {
//!     runs: vec![paper.into()],
//!     question: mirrorstats_study::question::Question::default(),
//!     against: None,
//!     style: "default".to_owned(),
//!     coder: None,
//!     threads: std::num::NonZeroUsize::MIN,
//! })?;
//! assert_eq!(view.episodes(), 840);
//! # Ok::<(), mirrorstats_view::ViewError>(())
//! ```

#![warn(clippy::print_stdout, clippy::print_stderr)]

mod answers;
mod error;
pub mod export;
mod filter;
mod found;
mod logs;
mod page;
pub mod picture;
mod recent;
#[cfg(feature = "sim")]
mod rendered;
pub mod routes;
mod snapshot;

use std::ffi::OsString;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError, RwLock};

use mirrorstats_study::question::Question;

use answers::{Answer, answer, live};
pub use error::ViewError;
use snapshot::Snapshot;

/// The inputs and options.
#[derive(Clone, Debug)]
pub struct Options {
    /// Traces, logs, and folders of them.
    pub runs: Vec<OsString>,
    /// Definitions, a filter and groups, as for a report.
    pub question: Question,
    /// Definitions to compare with, by name or path.
    pub against: Option<PathBuf>,
    /// The style of tables.
    pub style: String,
    /// The name of the coder; without it, the page is read-only.
    pub coder: Option<String>,
    /// The number of threads.
    pub threads: NonZeroUsize,
}

/// The open recordings and their newest state.
#[derive(Debug)]
pub struct View {
    options: Options,
    newest: RwLock<Arc<Snapshot>>,
    watch: Mutex<live::Watch>,
}

impl View {
    pub fn open(options: Options) -> Result<Self, ViewError> {
        let snapshot = Arc::new(Snapshot::open(&options, 0)?);
        Ok(Self { options, newest: RwLock::new(snapshot), watch: Mutex::default() })
    }

    /// The number of episodes.
    pub fn episodes(&self) -> usize {
        self.newest().episodes()
    }

    /// Returns true if the episode is present, finished or under way.
    pub fn has_episode(&self, id: &str) -> bool {
        self.newest().has(id)
    }

    /// The bytes of an answer as the server returns them: JSON, PNG or a page; `None` if the query is unknown.
    pub fn ask(&self, name: &str, query: &[(String, String)]) -> Option<Result<Vec<u8>, ViewError>> {
        let bytes = |answer| match answer {
            Answer::Json(bytes) | Answer::Png(bytes) => bytes,
            Answer::Page(page) => page.into_bytes(),
        };
        answer(self, name, query).map(|answer| answer.map(bytes))
    }

    fn newest(&self) -> Arc<Snapshot> {
        Arc::clone(&self.newest.read().unwrap_or_else(PoisonError::into_inner))
    }
}

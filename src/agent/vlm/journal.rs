//! Every request and every answer of an episode, on disk before anything is done with them.
//!
//! One file per episode, one JSON object per line. A line is written and synchronised before the request goes out, and
//! another when its answer is whole; only then does the agent act on it. So a recording that was killed asks for no
//! answer twice that it had, and a journal kept is a cassette: it plays the episode again without a network.
//!
//! A line that was cut off by the end of a process is dropped when the file is opened again: nothing was done with it.
//! Nothing here holds a key: answers are written after [`Secrets`](super::secrets) were taken out.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::agent::Status;

/// One line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum Entry {
    /// A request that is about to go out.
    Request {
        /// The step.
        t: i32,
        /// Which attempt, from 1.
        attempt: u32,
        /// SHA-256 of the request's body, its frame left out.
        question: String,
        /// SHA-256 of the frame as PNG.
        frame: String,
    },
    /// An answer in the provider's language.
    Answer {
        /// The step.
        t: i32,
        /// Which attempt, from 1.
        attempt: u32,
        /// As in the request.
        question: String,
        /// From sending to the whole answer, ms.
        latency_ms: i32,
        /// The model that answered, as the provider names it; it need not be the one that was asked.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        model: Option<String>,
        /// The body, as it came.
        body: String,
    },
    /// An attempt that gave no answer.
    Failure {
        /// The step.
        t: i32,
        /// Which attempt, from 1.
        attempt: u32,
        /// What it counts as.
        status: String,
        /// What happened.
        detail: String,
        /// The step was given up, and the episode went on without a decision.
        is_final: bool,
        /// As in the request.
        question: String,
    },
}

/// What an episode has of a step.
#[derive(Clone, Debug, PartialEq)]
pub enum Recorded {
    /// An answer.
    Answer {
        /// The request's hash.
        question: String,
        /// From sending to the whole answer, ms.
        latency_ms: i32,
        /// The body.
        body: String,
    },
    /// The step was given up with this status.
    GivenUp {
        /// The request's hash.
        question: String,
        /// What it counts as.
        status: Status,
    },
}

impl Recorded {
    /// The hash of the request that this belongs to.
    pub fn question(&self) -> &str {
        match self {
            Self::Answer { question, .. } | Self::GivenUp { question, .. } => question,
        }
    }
}

/// What was spent on an episode.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Requests {
    /// Requests that went out.
    pub sent: u64,
}

/// The journal of one episode.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    /// `None` for a cassette, which is not written to.
    file: Option<File>,
    recorded: BTreeMap<i32, Recorded>,
    requests: Requests,
}

/// A journal that cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say it")]
pub enum JournalError {
    #[error("cannot use the journal `{}`: {source}", path.display())]
    Io { path: PathBuf, source: io::Error },
    #[error("line {line} of the journal `{}` is damaged: {fault}\n  help: remove the file to ask the model again", path.display())]
    Damaged { path: PathBuf, line: usize, fault: serde_json::Error },
    #[error("the cassette has no `{}`\n  help: record the episode with its model first, or choose fewer episodes", path.display())]
    Missing { path: PathBuf },
}

impl Journal {
    /// Opens the journal of an episode, for going on with it.
    ///
    /// # Errors
    /// When the file cannot be read or written, or a whole line of it is damaged.
    pub fn open(path: &Path) -> Result<Self, JournalError> {
        let failed = |source| JournalError::Io { path: path.to_owned(), source };
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(failed)?;
        }
        let mut file = OpenOptions::new().create(true).append(true).open(path).map_err(failed)?;
        let text = fs::read(path).map_err(failed)?;
        let whole = text.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
        if whole < text.len() {
            file.set_len(whole as u64).map_err(failed)?;
            file.flush().map_err(failed)?;
        }
        let (recorded, requests) = read(path, &text[..whole])?;
        Ok(Self { path: path.to_owned(), file: Some(file), recorded, requests })
    }

    /// Opens the journal of an episode as a cassette, for reading alone.
    ///
    /// # Errors
    /// When there is none, it cannot be read, or a whole line of it is damaged.
    pub fn cassette(path: &Path) -> Result<Self, JournalError> {
        let text = fs::read(path).map_err(|source| match source.kind() {
            io::ErrorKind::NotFound => JournalError::Missing { path: path.to_owned() },
            _ => JournalError::Io { path: path.to_owned(), source },
        })?;
        let whole = text.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
        let (recorded, requests) = read(path, &text[..whole])?;
        Ok(Self { path: path.to_owned(), file: None, recorded, requests })
    }

    /// What there is of a step.
    pub fn recorded(&self, t: i32) -> Option<&Recorded> {
        self.recorded.get(&t)
    }

    /// All answers, in the order of the steps.
    pub fn answers(&self) -> impl Iterator<Item = &Recorded> {
        self.recorded.values()
    }

    /// What was sent for the episode so far.
    pub fn requests(&self) -> Requests {
        self.requests
    }

    /// Adds a line and waits until it is on the disk.
    ///
    /// # Errors
    /// Whatever writing gives; a cassette refuses.
    pub fn append(&mut self, entry: &Entry) -> Result<(), JournalError> {
        let failed = |source| JournalError::Io { path: self.path.clone(), source };
        let Some(file) = &mut self.file else {
            return Err(failed(io::Error::other("a cassette is played, not written")));
        };
        let mut line = serde_json::to_vec(entry).map_err(|fault| failed(fault.into()))?;
        line.push(b'\n');
        file.write_all(&line).and_then(|()| file.sync_data()).map_err(failed)?;
        note(&mut self.recorded, &mut self.requests, entry);
        Ok(())
    }
}

fn read(path: &Path, text: &[u8]) -> Result<(BTreeMap<i32, Recorded>, Requests), JournalError> {
    let (mut recorded, mut requests) = (BTreeMap::new(), Requests::default());
    for (at, line) in text.split(|byte| *byte == b'\n').enumerate().filter(|(_, line)| !line.is_empty()) {
        let entry = serde_json::from_slice(line).map_err(|fault| JournalError::Damaged {
            path: path.to_owned(),
            line: at + 1,
            fault,
        })?;
        note(&mut recorded, &mut requests, &entry);
    }
    Ok((recorded, requests))
}

fn note(recorded: &mut BTreeMap<i32, Recorded>, requests: &mut Requests, entry: &Entry) {
    match entry {
        Entry::Request { .. } => requests.sent += 1,
        Entry::Answer { t, question, latency_ms, body, .. } => {
            let answer = Recorded::Answer { question: question.clone(), latency_ms: *latency_ms, body: body.clone() };
            recorded.insert(*t, answer);
        }
        Entry::Failure { t, status, is_final: true, question, .. } => {
            let status = Status::named(status).unwrap_or(Status::ServerError);
            recorded.insert(*t, Recorded::GivenUp { question: question.clone(), status });
        }
        Entry::Failure { .. } => {}
    }
}

//! The requests and answers of an episode, on disk before they take effect.
//!
//! One file per episode, one JSON object per line. A line is written and synchronised before the request is sent, and
//! another when its answer is complete; only then does the agent act on it. So a killed recording never repeats a
//! request that was answered. A kept journal is a cassette: it replays the episode without a network.
//!
//! A last line that was cut off, or that a power loss left as zeros, is dropped when the file is opened again: it had
//! no effect yet. Only one process at a time writes a journal: the owner of the recording's folder.
//!
//! Journals hold no keys: [`Secrets`](mirrorstats_agents::secrets) are removed from answers before they are written.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use mirrorstats_agents::json_lines;
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::input;
use mirrorstats_exact::replace::{folder_of, make_folder, sync_folder};

/// The maximum answer of a provider has 4 MiB; as JSON in JSON a byte may take six.
const LONGEST_LINE: Limit = Limit::new("bytes in a line of a journal", 32 << 20);

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum Entry {
    Request {
        t: i32,
        attempt: u32,
        /// SHA-256 of the request's body without its frame.
        question: String,
        /// SHA-256 of the frame as PNG.
        frame: String,
        /// The maximum tokens of the request and of its reply.
        at_most: [u64; 2],
    },
    /// An answer in the provider's wire format.
    Answer {
        t: i32,
        attempt: u32,
        question: String,
        /// From sending to the complete answer, ms.
        latency_ms: i32,
        /// The answering model's name from the provider; it may differ from the requested one.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        model: Option<String>,
        body: String,
    },
    Failure {
        t: i32,
        attempt: u32,
        status: String,
        detail: String,
        /// The provider may have made an answer, and may bill it.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        may_be_paid: bool,
        question: String,
    },
}

#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    pub question: String,
    pub latency_ms: i32,
    pub body: String,
    /// `None` without its request.
    pub at_most: Option<[u64; 2]>,
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Requests {
    pub sent: u64,
    /// The maximum tokens of unanswered requests that may have been billed.
    pub unanswered: Vec<[u64; 2]>,
    open: Option<[u64; 2]>,
}

impl Requests {
    fn close(&mut self, may_be_paid: bool) -> Option<[u64; 2]> {
        let open = self.open.take();
        self.unanswered.extend(open.filter(|_| may_be_paid));
        open
    }
}

#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    /// `None` for a cassette, which is read-only, and after a line that could not be written.
    file: Option<File>,
    recorded: BTreeMap<i32, Recorded>,
    requests: Requests,
}

#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    #[error("cannot use the journal `{}`: {source}", path.display())]
    Io { path: PathBuf, source: io::Error },
    #[error("line {line} of the journal `{}` is damaged: {fault}\n  help: remove the file to ask the model again", path.display())]
    Damaged { path: PathBuf, line: usize, fault: serde_json::Error },
    #[error("the cassette has no `{}`\n  help: record the episode with its model first, or choose fewer episodes", path.display())]
    Missing { path: PathBuf },
}

impl Journal {
    pub fn open(path: &Path) -> Result<Self, JournalError> {
        let failed = |source| JournalError::Io { path: path.to_owned(), source };
        make_folder(folder_of(path)).map_err(failed)?;
        let mut file = OpenOptions::new().create(true).append(true).open(path).map_err(failed)?;
        let (mut journal, whole) = Self::read(path)?;
        if whole < file.metadata().map_err(failed)?.len() {
            file.set_len(whole).map_err(failed)?;
        }
        // The last writes of a killed process may not be on disk yet, and must be before they are used.
        file.flush().and_then(|()| file.sync_all()).and_then(|()| sync_folder(folder_of(path))).map_err(failed)?;
        journal.file = Some(file);
        Ok(journal)
    }

    pub fn cassette(path: &Path) -> Result<Self, JournalError> {
        match Self::read(path) {
            Ok((journal, _)) => Ok(journal),
            Err(JournalError::Io { source, path }) if source.kind() == io::ErrorKind::NotFound => {
                Err(JournalError::Missing { path })
            }
            Err(other) => Err(other),
        }
    }

    pub fn recorded(&self, t: i32) -> Option<&Recorded> {
        self.recorded.get(&t)
    }

    pub fn answers(&self) -> impl Iterator<Item = &Recorded> {
        self.recorded.values()
    }

    /// The requests for the episode so far; one without an outcome may have been billed.
    pub fn requests(&self) -> Requests {
        let mut requests = self.requests.clone();
        requests.close(true);
        requests
    }

    /// Adds a line and waits until it is on disk. After a failed write no further lines are added: they would follow an
    /// incomplete line and be unreadable.
    pub fn append(&mut self, entry: &Entry) -> Result<(), JournalError> {
        let failed = |source| JournalError::Io { path: self.path.clone(), source };
        let Some(mut file) = self.file.take() else {
            return Err(failed(io::Error::other("a cassette is played, not written")));
        };
        let line = json_lines::line(entry).map_err(|fault| failed(fault.into()))?;
        let before = file.metadata().map_err(failed)?.len();
        if let Err(error) = file.write_all(&line).and_then(|()| file.sync_data()) {
            // If the partial line cannot be removed, it is dropped when the file is opened again.
            let _ = file.set_len(before);
            return Err(failed(error));
        }
        self.file = Some(file);
        self.note(entry);
        Ok(())
    }

    /// The read-only journal of a file, and the number of bytes in its whole lines.
    fn read(path: &Path) -> Result<(Self, u64), JournalError> {
        let failed = |source| JournalError::Io { path: path.to_owned(), source };
        let mut journal =
            Self { path: path.to_owned(), file: None, recorded: BTreeMap::new(), requests: Requests::default() };
        let mut whole = 0;
        let mut lines = input::lines(path, LONGEST_LINE).map_err(failed)?.enumerate().peekable();
        while let Some((at, line)) = lines.next() {
            let line = line.map_err(failed)?;
            let Some(text) = line.strip_suffix(b"\n") else { break };
            // JSON contains no zero byte; a disk may, if it stored a file's length before its bytes.
            if text.contains(&0) && lines.peek().is_none() {
                break;
            }
            whole += line.len() as u64;
            if text.is_empty() {
                continue;
            }
            let damaged = |fault| JournalError::Damaged { path: path.to_owned(), line: at + 1, fault };
            journal.note(&serde_json::from_slice(text).map_err(damaged)?);
        }
        Ok((journal, whole))
    }

    fn note(&mut self, entry: &Entry) {
        let Self { recorded, requests, .. } = self;
        match entry {
            Entry::Request { at_most, .. } => {
                requests.close(true);
                requests.sent += 1;
                requests.open = Some(*at_most);
            }
            Entry::Answer { t, question, latency_ms, body, .. } => {
                let (at_most, question, body) = (requests.close(false), question.clone(), body.clone());
                recorded.insert(*t, Recorded { question, latency_ms: *latency_ms, body, at_most });
            }
            Entry::Failure { may_be_paid, .. } => {
                requests.close(*may_be_paid);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::{Path, PathBuf};

    use super::{Entry, Journal, JournalError};

    fn answer(t: i32) -> Entry {
        let (question, body) = (format!("question {t}"), format!("answer {t}"));
        Entry::Answer { t, attempt: 1, question, latency_ms: 1, model: None, body }
    }

    fn answered(journal: &Journal) -> Vec<String> {
        journal.answers().map(|recorded| recorded.body.clone()).collect()
    }

    fn with_lines(folder: &Path, count: i32) -> PathBuf {
        let path = folder.join("deep/E1-m-s1-r1.jsonl");
        let mut journal = Journal::open(&path).unwrap();
        (1..=count).for_each(|t| journal.append(&answer(t)).unwrap());
        path
    }

    #[test]
    fn a_last_line_cut_by_a_loss_of_power_is_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let path = with_lines(folder.path(), 2);
        let whole = fs::read(&path).unwrap();
        // Half a line, only zeros, and zeros for the first page of a line.
        for torn in [&b"{\"kind\":\"ans"[..], b"\0\0\0", b"\0\0\0\n", b"\0\0\0\0nswer\"}\n", b"{\"kind\":\0\0\0\n"] {
            fs::write(&path, [&whole, torn].concat()).unwrap();
            assert_eq!(answered(&Journal::cassette(&path).unwrap()), ["answer 1", "answer 2"]);
            let mut journal = Journal::open(&path).unwrap();
            assert_eq!(answered(&journal), ["answer 1", "answer 2"], "{torn:?}");
            assert_eq!(fs::read(&path).unwrap(), whole);
            journal.append(&answer(3)).unwrap();
            assert_eq!(answered(&Journal::cassette(&path).unwrap()).len(), 3);
        }
    }

    #[test]
    fn requests_without_an_outcome_may_have_been_paid() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("E1-m-s1-r1.jsonl");
        let mut journal = Journal::open(&path).unwrap();
        let request = |most| {
            let (question, frame) = (String::new(), String::new());
            Entry::Request { t: 1, attempt: 1, question, frame, at_most: [most, 10] }
        };
        let failure = |may_be_paid| {
            let (status, detail, question) = ("timeout".to_owned(), String::new(), String::new());
            Entry::Failure { t: 1, attempt: 1, status, detail, may_be_paid, question }
        };
        let entries = [
            [request(1), failure(false)],
            [request(2), failure(true)],
            // Killed and restarted.
            [request(3), request(4)],
        ];
        entries.iter().flatten().for_each(|entry| journal.append(entry).unwrap());
        let unanswered = [[2, 10], [3, 10], [4, 10]];
        assert_eq!((journal.requests().sent, journal.requests().unanswered), (4, unanswered.to_vec()));
        journal.append(&answer(1)).unwrap();
        let read = Journal::cassette(&path).unwrap().requests();
        assert_eq!((read.sent, read.unanswered), (4, unanswered[..2].to_vec()));
    }

    #[test]
    fn a_damaged_line_is_reported() {
        let folder = tempfile::tempdir().unwrap();
        let path = with_lines(folder.path(), 3);
        let text = fs::read_to_string(&path).unwrap();
        for (damaged, line) in
            [(text.replacen("\"kind\"", "\"k\\u0000d\"", 1), 1), (text.replace("\"t\":3", "\"t\":x"), 3)]
        {
            fs::write(&path, &damaged).unwrap();
            let error = Journal::open(&path).unwrap_err();
            assert!(matches!(error, JournalError::Damaged { line: found, .. } if found == line), "{error}");
            assert_eq!(fs::read_to_string(&path).unwrap(), damaged);
        }
    }
}

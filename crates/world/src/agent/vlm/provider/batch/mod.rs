//! Batches: the requests of many episodes are sent as one, at half the price.
//!
//! Rule: a batch is on disk once it is submitted. A restarted recording fetches its results from the provider, so that
//! nothing is paid twice.

mod service;

use std::collections::{HashMap, HashSet};
use std::fs::OpenOptions;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration, Instant};

use reqwest::{Client, Url};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use tokio::sync::oneshot;
use tokio::time::sleep;

use super::failure::{Failure, failed, no_answer, server};
use super::{Patience, Received, received};
use crate::agent::locked;
use crate::agent::vlm::secrets::Secret;
use crate::agent::vlm::wire_format::Dialect;
use crate::json_lines;
use exact::budget::Limit;
use exact::replace::{folder_of, make_folder, sync_folder};
use service::{Ended, Service, unpaid};

/// The maximum requests of a batch, below every provider's limit.
const MOST: usize = 1_000;
/// A batch of `MOST` requests takes about 50 kB in its line.
const LONGEST_LINE: Limit = Limit::new("bytes in a line of batches", 1 << 20);

type Outcome = Result<Received, Failure>;

#[derive(Debug, Serialize, Deserialize)]
struct Note {
    batch: String,
    /// In the order of the batch.
    requests: Vec<String>,
}

#[derive(Debug)]
pub(super) struct Batches {
    service: Service,
    secret: Option<Secret>,
    patience: Patience,
    notes: OnceLock<PathBuf>,
    state: Mutex<BatchState>,
}

#[derive(Debug, Default)]
struct BatchState {
    queue: Vec<(String, Value)>,
    is_gathering: bool,
    waiting: HashMap<String, oneshot::Sender<Outcome>>,
    earlier: HashMap<String, Arc<Note>>,
    under_way: HashSet<String>,
    kept: HashMap<String, Outcome>,
}

impl Batches {
    pub(super) fn new(
        client: Client,
        url: Url,
        dialect: Dialect,
        secret: Option<Secret>,
        patience: Patience,
    ) -> Arc<Self> {
        let service = Service { client, url, dialect, largest_answer: patience.largest_answer };
        Arc::new(Self { service, secret, patience, notes: OnceLock::new(), state: Mutex::default() })
    }

    pub(super) fn share(&self, path: &Path) -> io::Result<()> {
        make_folder(folder_of(path))?;
        let notes: Vec<Note> = json_lines::read(path, LONGEST_LINE)?;
        let mut state = locked(&self.state);
        for note in notes.into_iter().map(Arc::new) {
            state.earlier.extend(note.requests.iter().map(|id| (id.clone(), Arc::clone(&note))));
        }
        let _ = self.notes.set(path.to_owned());
        Ok(())
    }

    pub(super) async fn ask(self: &Arc<Self>, id: &str, body: &Value) -> Outcome {
        let (sender, outcome) = oneshot::channel();
        if let Some(outcome) = self.enqueue(id, body, sender) {
            return outcome;
        }
        outcome.await.unwrap_or_else(|_| Err(server("the batch broke off".to_owned())))
    }

    fn enqueue(self: &Arc<Self>, id: &str, body: &Value, sender: oneshot::Sender<Outcome>) -> Option<Outcome> {
        let mut state = locked(&self.state);
        if let Some(outcome) = state.kept.remove(id) {
            return Some(outcome);
        }
        state.waiting.insert(id.to_owned(), sender);
        if let Some(note) = state.earlier.get(id).cloned() {
            // Requests that were sent again since belong to a later batch.
            let is_last = |id: &&String| state.earlier.get(*id).is_some_and(|last| Arc::ptr_eq(last, &note));
            let ids: Vec<String> = note.requests.iter().filter(is_last).cloned().collect();
            for id in &ids {
                state.earlier.remove(id);
            }
            state.under_way.extend(ids.iter().cloned());
            tokio::spawn(Arc::clone(self).follow(note, ids));
        } else if !state.under_way.contains(id) {
            state.queue.push((id.to_owned(), body.clone()));
            if !std::mem::replace(&mut state.is_gathering, true) {
                tokio::spawn(Arc::clone(self).gather());
            }
        }
        None
    }

    async fn gather(self: Arc<Self>) {
        let mut before = 0;
        loop {
            sleep(self.patience.first_delay).await;
            let count = locked(&self.state).queue.len();
            if count == before {
                break;
            }
            before = count;
        }
        let requests = {
            let mut state = locked(&self.state);
            state.is_gathering = false;
            std::mem::take(&mut state.queue)
        };
        for some in split(requests, self.service.most_bytes()) {
            tokio::spawn(Arc::clone(&self).submit(some));
        }
    }

    async fn submit(self: Arc<Self>, requests: Vec<(String, Value)>) {
        let submitted = self.service.submit(&requests).await;
        let requests: Vec<String> = requests.into_iter().map(|(id, _)| id).collect();
        match submitted {
            Ok(batch) => {
                let note = Note { batch, requests: requests.clone() };
                self.note(&note);
                self.follow(Arc::new(note), requests).await;
            }
            Err(failure) => requests.iter().for_each(|id| self.give(id, Err(failure.clone()))),
        }
    }

    async fn follow(self: Arc<Self>, note: Arc<Note>, ids: Vec<String>) {
        let (start, mut wait) = (Instant::now(), self.patience.first_delay);
        let ended = loop {
            sleep(wait).await;
            wait = (wait * 3 / 2).min(self.patience.longest_delay);
            match self.service.ended(&note.batch, &note.requests).await {
                Ok(None) => {}
                Ok(Some(ended)) => break Ok(ended),
                Err(failure) if failure.kind.may_pass() => {}
                Err(failure) => break Err(failure),
            }
        };
        let latency = start.elapsed();
        for id in &ids {
            let outcome = match &ended {
                Ok(ended) => ended.get(id).map_or_else(
                    || Err(unpaid("the batch has no result of this request")),
                    |ended| self.outcome(ended.clone(), latency),
                ),
                Err(failure) => Err(failure.clone()),
            };
            self.give(id, outcome);
        }
    }

    fn outcome(&self, ended: Ended, latency: Duration) -> Outcome {
        let (status, body) = ended?;
        match self.service.dialect.answer(&body) {
            Some(answer) => Ok(received(self.secret.as_ref(), answer, body.to_string(), latency)),
            None if status.is_success() => Err(no_answer(&body.to_string())),
            None => Err(failed(status, None, &body.to_string())),
        }
    }

    fn give(&self, id: &str, outcome: Outcome) {
        let mut state = locked(&self.state);
        state.under_way.remove(id);
        let unheard = match state.waiting.remove(id) {
            Some(step) => step.send(outcome).err(),
            None => Some(outcome),
        };
        if let Some(outcome) = unheard {
            state.kept.insert(id.to_owned(), outcome);
        }
    }

    /// If the note cannot be written, this start still gets its answers; the journal reports the disk.
    fn note(&self, note: &Note) {
        let Some(path) = self.notes.get() else { return };
        let Ok(line) = json_lines::line(note) else { return };
        let file = OpenOptions::new().create(true).append(true).open(path);
        let _ = file.and_then(|mut file| {
            file.write_all(&line).and_then(|()| file.sync_data()).and_then(|()| sync_folder(folder_of(path)))
        });
    }
}

/// Splits requests, in order, into batches within both limits. A larger request is a batch on its own.
fn split(requests: Vec<(String, Value)>, most_bytes: usize) -> Vec<Vec<(String, Value)>> {
    let (mut batches, mut left): (Vec<Vec<_>>, _) = (Vec::new(), 0);
    for request in requests {
        let bytes = request.1.to_string().len();
        if let Some(batch) = batches.last_mut().filter(|batch| batch.len() < MOST && bytes <= left) {
            left -= bytes;
            batch.push(request);
        } else {
            left = most_bytes.saturating_sub(bytes);
            batches.push(vec![request]);
        }
    }
    batches
}

#[cfg(test)]
mod tests {
    use super::{MOST, split};

    #[test]
    fn batches_are_limited_in_bytes_and_requests() {
        let of = |text: &str| (String::new(), text.into());
        // With its quotes a one-letter text has three bytes.
        let sizes = |texts: Vec<&str>| -> Vec<usize> {
            split(texts.into_iter().map(of).collect(), 6).iter().map(Vec::len).collect()
        };
        assert_eq!(sizes(vec!["a", "b", "c", "longer than all", "d", ""]), [2, 1, 1, 2]);
        assert_eq!(split(vec![of("a"); MOST + 1], usize::MAX).len(), 2);
        assert!(split(Vec::new(), 6).is_empty());
    }
}

//! Anthropic's message batches: the requests of many episodes go out as one, at half the price.
//!
//! Rule: a batch is on the disk when it is submitted. A recording that is started again takes its results from the provider,
//! so that nothing is paid twice. <https://platform.claude.com/docs/en/build-with-claude/batch-processing>

use std::collections::{HashMap, HashSet};
use std::fs::OpenOptions;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use reqwest::{Client, RequestBuilder, StatusCode, Url};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use tokio::sync::oneshot;
use tokio::time::sleep;

use super::failure::{Failure, broken, failed, server, shortened};
use super::rate_limit::retry_after;
use super::{Patience, Received, received, whole};
use crate::agent::vlm::secrets::Secret;
use crate::agent::vlm::wire_format::Dialect;
use exact::budget::Limit;
use exact::input;
use exact::replace::{folder_of, make_folder, sync_folder};

/// Requests of a batch, below what the provider takes (100,000, and 256 MB).
const MOST: usize = 1_000;
/// A batch of `MOST` requests takes some 50 kB of its line.
const LONGEST_LINE: Limit = Limit::new("bytes in a line of batches", 1 << 20);

type Outcome = Result<Received, Failure>;

/// A batch that was submitted.
#[derive(Debug, Serialize, Deserialize)]
struct Note {
    batch: String,
    requests: Vec<String>,
}

/// The batches of one account.
#[derive(Clone, Debug)]
pub(super) struct Batches(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    client: Client,
    url: Url,
    secret: Option<Secret>,
    patience: Patience,
    notes: OnceLock<PathBuf>,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    queue: Vec<(String, Value)>,
    is_gathering: bool,
    waiting: HashMap<String, oneshot::Sender<Outcome>>,
    earlier: HashMap<String, String>,
    under_way: HashSet<String>,
    kept: HashMap<String, Outcome>,
}

impl Batches {
    pub(super) fn new(client: Client, url: Url, secret: Option<Secret>, patience: Patience) -> Self {
        let (notes, state) = (OnceLock::new(), Mutex::default());
        Self(Arc::new(Inner { client, url, secret, patience, notes, state }))
    }

    pub(super) fn share(&self, path: &Path) -> io::Result<()> {
        make_folder(folder_of(path))?;
        let lines = match input::lines(path, LONGEST_LINE) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            lines => Some(lines?),
        };
        let mut state = self.0.state();
        for line in lines.into_iter().flatten() {
            // A line that was cut off by the end of a process has no batch that is known.
            let Ok(note) = serde_json::from_slice::<Note>(&line?) else { continue };
            state.earlier.extend(note.requests.into_iter().map(|id| (id, note.batch.clone())));
        }
        let _ = self.0.notes.set(path.to_owned());
        Ok(())
    }

    pub(super) async fn ask(&self, id: &str, body: &Value) -> Outcome {
        let (sender, outcome) = oneshot::channel();
        if let Some(outcome) = self.0.enqueue(id, body, sender) {
            return outcome;
        }
        outcome.await.unwrap_or_else(|_| Err(server("the batch broke off".to_owned())))
    }
}

impl Inner {
    fn enqueue(self: &Arc<Self>, id: &str, body: &Value, sender: oneshot::Sender<Outcome>) -> Option<Outcome> {
        let mut state = self.state();
        if let Some(outcome) = state.kept.remove(id) {
            return Some(outcome);
        }
        state.waiting.insert(id.to_owned(), sender);
        if let Some(batch) = state.earlier.get(id).cloned() {
            let ids: Vec<String> =
                state.earlier.iter().filter(|(_, of)| **of == batch).map(|(id, _)| id.clone()).collect();
            state.earlier.retain(|_, of| *of != batch);
            state.under_way.extend(ids.iter().cloned());
            tokio::spawn(Arc::clone(self).follow(batch, ids));
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
            let count = self.state().queue.len();
            if count == before {
                break;
            }
            before = count;
        }
        let requests = {
            let mut state = self.state();
            state.is_gathering = false;
            std::mem::take(&mut state.queue)
        };
        for some in requests.chunks(MOST) {
            tokio::spawn(Arc::clone(&self).submit(some.to_vec()));
        }
    }

    async fn submit(self: Arc<Self>, requests: Vec<(String, Value)>) {
        let all: Vec<Value> =
            requests.iter().map(|(id, params)| json!({ "custom_id": id, "params": params })).collect();
        let ids: Vec<String> = requests.into_iter().map(|(id, _)| id).collect();
        let post = self.client.post(self.url.clone()).json(&json!({ "requests": all }));
        let submitted = self.fetch(post, 1).await.and_then(|text| {
            let batch: Value = serde_json::from_str(&text).unwrap_or_default();
            let id = batch["id"].as_str().map(str::to_owned);
            id.ok_or_else(|| server(format!("expected a batch with an id, found: {}", shortened(&text))))
        });
        match submitted {
            Ok(batch) => {
                self.note(&Note { batch: batch.clone(), requests: ids.clone() });
                self.follow(batch, ids).await;
            }
            Err(failure) => ids.iter().for_each(|id| self.give(id, Err(failure.clone()))),
        }
    }

    async fn follow(self: Arc<Self>, batch: String, ids: Vec<String>) {
        let (start, mut wait) = (Instant::now(), self.patience.first_delay);
        let results = loop {
            sleep(wait).await;
            wait = (wait * 3 / 2).min(self.patience.longest_delay);
            match self.results(&batch, ids.len()).await {
                Ok(None) => {}
                Ok(Some(results)) => break Ok(results),
                Err(failure) if failure.kind.may_pass() => {}
                Err(failure) => break Err(failure),
            }
        };
        let latency = start.elapsed();
        let outcomes: HashMap<String, Outcome> = match &results {
            Ok(text) => text.lines().filter_map(|line| self.outcome(line, latency)).collect(),
            Err(_) => HashMap::new(),
        };
        let absent =
            || results.as_ref().err().cloned().unwrap_or_else(|| unpaid("the batch has no result of this request"));
        for id in &ids {
            self.give(id, outcomes.get(id).cloned().unwrap_or_else(|| Err(absent())));
        }
    }

    /// The results of a batch, a line each; `None` while it is under way.
    async fn results(&self, batch: &str, requests: usize) -> Result<Option<String>, Failure> {
        let of_batch = |rest: &[&str]| {
            let mut url = self.url.clone();
            if let Ok(mut path) = url.path_segments_mut() {
                path.push(batch).extend(rest);
            }
            self.client.get(url)
        };
        let status: Value = serde_json::from_str(&self.fetch(of_batch(&[]), 1).await?).unwrap_or_default();
        if status["processing_status"] != "ended" {
            return Ok(None);
        }
        self.fetch(of_batch(&["results"]), requests).await.map(Some)
    }

    async fn fetch(&self, request: RequestBuilder, answers: usize) -> Result<String, Failure> {
        let response = request.send().await.map_err(broken)?;
        let (status, after) = (response.status(), retry_after(response.headers()));
        let bytes = whole(response, self.patience.largest_answer.saturating_mul(answers)).await?;
        let text = String::from_utf8_lossy(&bytes).into_owned();
        if status.is_success() { Ok(text) } else { Err(failed(status, after, &text)) }
    }

    fn outcome(&self, line: &str, latency: Duration) -> Option<(String, Outcome)> {
        let line: Value = serde_json::from_str(line).ok()?;
        let result = &line["result"];
        let body = match result["type"].as_str() {
            Some("errored") => &result["error"],
            _ => &result["message"],
        };
        let outcome = match (Dialect::AnthropicMessages.answer(body), result["type"].as_str()) {
            (Some(answer), _) => Ok(received(self.secret.as_ref(), answer, body.to_string(), latency)),
            (None, Some("errored")) => Err(failed(status_of(body), None, &body.to_string())),
            (None, how) => Err(unpaid(&format!("a request of the batch ended as {}", how.unwrap_or("nothing known")))),
        };
        Some((line["custom_id"].as_str()?.to_owned(), outcome))
    }

    fn give(&self, id: &str, outcome: Outcome) {
        let mut state = self.state();
        state.under_way.remove(id);
        let unheard = match state.waiting.remove(id) {
            Some(step) => step.send(outcome).err(),
            None => Some(outcome),
        };
        if let Some(outcome) = unheard {
            state.kept.insert(id.to_owned(), outcome);
        }
    }

    /// A note that cannot be written leaves this start its answers; the journal tells of the disk.
    fn note(&self, note: &Note) {
        let Some(path) = self.notes.get() else { return };
        let mut line = serde_json::json!(note).to_string();
        line.push('\n');
        let file = OpenOptions::new().create(true).append(true).open(path);
        let _ = file.and_then(|mut file| {
            file.write_all(line.as_bytes()).and_then(|()| file.sync_data()).and_then(|()| sync_folder(folder_of(path)))
        });
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A failure that the provider does not bill.
fn unpaid(detail: &str) -> Failure {
    Failure { may_be_paid: false, ..server(detail.to_owned()) }
}

/// The status that an error has outside of batches: <https://platform.claude.com/docs/en/api/errors>.
fn status_of(error: &Value) -> StatusCode {
    match error["error"]["type"].as_str() {
        Some("authentication_error") => StatusCode::UNAUTHORIZED,
        Some("permission_error") => StatusCode::FORBIDDEN,
        Some("not_found_error") => StatusCode::NOT_FOUND,
        Some("rate_limit_error") => StatusCode::TOO_MANY_REQUESTS,
        Some("api_error") => StatusCode::INTERNAL_SERVER_ERROR,
        Some("overloaded_error") => StatusCode::from_u16(529).unwrap_or(StatusCode::SERVICE_UNAVAILABLE),
        _ => StatusCode::BAD_REQUEST,
    }
}

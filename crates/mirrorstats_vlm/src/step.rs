//! One step's question: sent, journaled, retried, and given up.

use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};

use serde_json::Value;

use super::journal::{Entry, Journal};
use super::limits::Reached;
use super::model::{Vlm, tokens};
use super::provider::failure::{Failure, FailureKind};
use super::provider::{Provider, Received, Waiting};
use super::wire_format::ModelAnswer;
use mirrorstats_agents::{Lost, locked, milliseconds};

pub(super) struct Step {
    pub(super) vlm: Arc<Vlm>,
    pub(super) journal: Arc<Mutex<Journal>>,
    pub(super) t: i32,
    pub(super) frame: String,
    pub(super) body: Value,
    pub(super) question: String,
    pub(super) at_most: [u64; 2],
}

pub(super) struct Asked {
    pub(super) answer: ModelAnswer,
    pub(super) latency_ms: i32,
}

/// A request's answer or its failure; the error ends the episode.
type Exchanged = Result<Result<Asked, Failure>, Lost>;

impl Step {
    pub(super) async fn ask(self) -> Result<Asked, Lost> {
        let Some((provider, _)) = &self.vlm.online else {
            return Err(Lost::because("nothing is sent from a cassette".to_owned()));
        };
        let longest_wait = provider.patience().longest_wait;
        let is_too_long =
            |failure: &Failure| failure.kind.is_busy() && failure.after.is_some_and(|asked| asked > longest_wait);
        let mut waiting = Waiting::new(provider.patience());
        let mut attempt = 0;
        loop {
            attempt += 1;
            let failure = match self.attempt(provider, attempt).await? {
                Ok(asked) => return Ok(asked),
                Err(failure) if !failure.kind.may_pass(self.vlm.has_answered.load(Ordering::Relaxed)) => {
                    return Err(self.rejected(&failure));
                }
                Err(failure) => failure,
            };
            match waiting.next(&failure) {
                Some(wait) => self.vlm.unless_stopped(tokio::time::sleep(wait)).await?,
                None if is_too_long(&failure) => return Err(self.put_off(&failure)),
                None => return Err(self.lost(attempt, &failure)),
            }
        }
    }

    fn put_off(&self, failure: &Failure) -> Lost {
        let seconds = failure.after.unwrap_or_default().as_secs();
        let (detail, help) = (&failure.detail, "the same command continues then; what was answered is not asked again");
        let reason = format!("the provider asks to wait {seconds} s: {detail}\n  help: {help}");
        self.vlm.halt(Lost::because(reason))
    }

    /// A rejected request costs its episode if the model has answered others; any other rejection ends the recording.
    fn rejected(&self, failure: &Failure) -> Lost {
        if failure.kind == FailureKind::Rejected && self.vlm.has_answered.load(Ordering::Relaxed) {
            return Lost::because(format!("step {}: the provider rejects this request: {}", self.t, failure.detail));
        }
        self.vlm.halt(Lost::because(failure.explained(&self.vlm.choice.name)))
    }

    async fn attempt(&self, provider: &Provider, attempt: u32) -> Exchanged {
        let first = self.vlm.turn_of_first().await;
        let ended = self.exchange(provider, attempt).await;
        self.vlm.is_known.store(true, Ordering::Relaxed);
        drop(first);
        ended
    }

    async fn exchange(&self, provider: &Provider, attempt: u32) -> Exchanged {
        let turn = self.vlm.unless_stopped(provider.turn()).await?;
        let reserved = self.vlm.account.reserve(self.vlm.cost_of(self.at_most));
        let reserved = self.vlm.unless_stopped(reserved).await?;
        let over = |reached: Reached| self.vlm.halt(Lost::by_limit(reached.to_string()));
        let reserved = reserved.map_err(over)?;
        let (t, question) = (self.t, self.question.clone());
        let (frame, at_most) = (self.frame.clone(), self.at_most);
        if let Err(lost) = self.write(&Entry::Request { t, attempt, question: question.clone(), frame, at_most }) {
            reserved.refused();
            return Err(lost);
        }
        match provider.ask(turn, &self.body).await {
            Ok(received) => {
                let Received { answer, body, latency, .. } = received;
                self.vlm.learn_from(&answer);
                reserved.answered(tokens(&answer), self.vlm.choice.cost_usd(&answer));
                let latency_ms = milliseconds(latency);
                let model = answer.model.clone();
                self.write(&Entry::Answer { t, attempt, question, latency_ms, model, body })?;
                self.vlm.note_answered();
                self.vlm.check_model(answer.model.as_deref())?;
                self.vlm.check_cost(&answer)?;
                Ok(Ok(Asked { answer, latency_ms }))
            }
            Err(failure) => {
                if !failure.may_be_paid {
                    reserved.refused();
                }
                let status = failure.kind.status().name().to_owned();
                let (detail, may_be_paid) = (failure.detail.clone(), failure.may_be_paid);
                self.write(&Entry::Failure { t, attempt, status, detail, may_be_paid, question })?;
                Ok(Err(failure))
            }
        }
    }

    /// An episode without an answer to a step is lost: in no trace, and recorded when the command runs again.
    fn lost(&self, attempt: u32, failure: &Failure) -> Lost {
        let status = failure.kind.status();
        let (t, name, detail) = (self.t, status.name(), &failure.detail);
        Lost::counted_as(status, format!("step {t}: {name} after {attempt} attempts: {detail}"))
    }

    /// A failed write of the journal ends the run: continuing would repeat requests, and pay twice.
    fn write(&self, entry: &Entry) -> Result<(), Lost> {
        let written = tokio::task::block_in_place(|| locked(&self.journal).append(entry));
        written.map_err(|error| self.vlm.halt(Lost::because(error.to_string())))
    }
}

//! Agents that are models behind a provider.
//!
//! ```text
//! observation ──► prompt + frame ──► dialect (body) ──► journal ──► provider ──► journal ──► reply
//!                                                          │ recorded already: no request │
//!                                                          └──────────────────────────────┘
//! ```
//!
//! | file | what it knows |
//! |---|---|
//! | [`models`] | the models, who serves them, what they cost |
//! | [`dialect`] | what requests and answers look like |
//! | [`provider`] | sending one request, and the names of what can go wrong |
//! | [`pace`] | how many requests are out at once |
//! | [`limits`] | what a run may spend |
//! | [`estimate`] | what requests will take |
//! | [`journal`] | what was asked and answered, on disk |
//! | [`secrets`] | keys, and words without them |
//!
//! Rule: what was answered once is never asked again, nothing is acted on that is not on disk, and no key is in
//! anything that leaves this room but the header of a request.

pub mod dialect;
pub mod estimate;
pub mod journal;
pub mod limits;
pub mod models;
pub mod pace;
pub mod provider;
pub mod secrets;

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use backon::{ExponentialBuilder, Retryable as _};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::Value;
use tokio::runtime::Handle;

use self::dialect::{Answer, Question};
use self::journal::{Entry, Journal, JournalError, Recorded};
use self::limits::{Account, Spend};
use self::models::{Choice, Contract};
use self::provider::{Failure, FailureKind, Provider};
use super::prompt::Prompt;
use super::reply;
use super::{Agent, Decision, Lost, Observation, Reply, Status, Task, Usage, Words};
use crate::base::hash;

/// The sampling temperature (paper, Panel A).
pub const TEMPERATURE: f64 = 0.2;

/// What is done when the attempts for a step are used up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnOutage {
    /// The episode is lost: it is counted apart, not written to the trace, and recorded when the command runs again.
    #[default]
    Lose,
    /// The step counts, without a decision and under the name of the failure, and the episode goes on.
    StandStill,
}

/// Where the answers of earlier requests are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Memory {
    /// A folder of journals that are gone on with.
    Journals(PathBuf),
    /// A folder of journals that are played; nothing is sent.
    Cassette(PathBuf),
}

impl Memory {
    fn path(&self, episode: &str) -> PathBuf {
        match self {
            Self::Journals(folder) | Self::Cassette(folder) => folder.join(format!("{episode}.jsonl")),
        }
    }
}

/// A model and everything that its episodes share.
#[derive(Debug)]
pub struct Vlm {
    choice: Choice,
    /// `None` where answers come from a cassette alone.
    provider: Option<Provider>,
    network: Option<Handle>,
    memory: Memory,
    account: Arc<Account>,
    on_outage: OnOutage,
    max_output_tokens: u32,
    /// Why no further request makes sense, once there is such a reason.
    stop: OnceLock<String>,
}

impl Vlm {
    /// A model that is asked over the network; requests run on `network`.
    pub fn online(
        choice: Choice,
        provider: Provider,
        network: Handle,
        journals: PathBuf,
        account: Arc<Account>,
        on_outage: OnOutage,
        max_output_tokens: u32,
    ) -> Self {
        Self {
            choice,
            provider: Some(provider),
            network: Some(network),
            memory: Memory::Journals(journals),
            account,
            on_outage,
            max_output_tokens,
            stop: OnceLock::new(),
        }
    }

    /// A model whose answers are played from journals; no key is needed and nothing is sent.
    pub fn cassette(choice: Choice, folder: PathBuf, max_output_tokens: u32) -> Self {
        Self {
            choice,
            provider: None,
            network: None,
            memory: Memory::Cassette(folder),
            account: Arc::default(),
            on_outage: OnOutage::default(),
            max_output_tokens,
            stop: OnceLock::new(),
        }
    }

    /// The model that was chosen.
    pub fn choice(&self) -> &Choice {
        &self.choice
    }

    /// Why no further request makes sense: a refused key, a limit that is reached, a full disk.
    pub fn stopped(&self) -> Option<&str> {
        self.stop.get().map(String::as_str)
    }

    /// The most tokens that a reply may have.
    pub fn max_output_tokens(&self) -> u32 {
        self.max_output_tokens
    }

    /// How many steps of an episode have their answer already.
    ///
    /// # Errors
    /// When the episode's journal cannot be read; none is no error.
    pub fn answered(&self, episode: &str) -> Result<u64, JournalError> {
        match Journal::cassette(&self.memory.path(episode)) {
            Ok(journal) => Ok(journal.answers().count() as u64),
            Err(JournalError::Missing { .. }) => Ok(0),
            Err(error) => Err(error),
        }
    }

    /// What was spent, over all starts of the run.
    pub fn spend(&self) -> Spend {
        self.account.spend()
    }

    /// What goes into recordings: everything that shapes the requests.
    pub fn description(&self) -> Value {
        serde_json::json!({
            "model": self.choice.name,
            "id": self.choice.model.id,
            "backend": self.choice.model.backend,
            "contract": self.choice.model.contract.name(),
            "temperature": TEMPERATURE,
            "max_output_tokens": self.max_output_tokens,
            "prompts": super::prompt::hashes(),
            "identification_version": super::identification::VERSION,
        })
    }

    /// The agent of one episode.
    ///
    /// # Errors
    /// When the episode's journal cannot be used.
    pub fn agent(self: &Arc<Self>, task: Task, episode: &str) -> Result<VlmAgent, JournalError> {
        let path = self.memory.path(episode);
        let journal = match self.memory {
            Memory::Journals(_) => Journal::open(&path)?,
            Memory::Cassette(_) => Journal::cassette(&path)?,
        };
        Ok(VlmAgent { vlm: Arc::clone(self), task, journal: Arc::new(Mutex::new(journal)) })
    }

    /// What a body says, and what it cost.
    fn read(&self, body: &str) -> Option<(Answer, Option<f64>)> {
        let answer = self.choice.backend.dialect.answer(&serde_json::from_str(body).ok()?)?;
        let cost = answer
            .cost_usd
            .or_else(|| Some(self.choice.model.prices?.cost_usd(answer.prompt_tokens?, answer.completion_tokens?)));
        Some((answer, cost))
    }

    fn question<'a>(&'a self, words: &'a super::prompt::Rendered, schema: &'a Value, png: &'a str) -> Question<'a> {
        Question {
            model: &self.choice.model.id,
            system: &words.system,
            user: &words.user,
            png_base64: png,
            schema: (self.choice.model.contract == Contract::Schema).then_some(schema),
            temperature: TEMPERATURE,
            max_output_tokens: self.max_output_tokens,
        }
    }

    /// No further request is sent, for this reason.
    fn halt(&self, reason: &str) -> Lost {
        let reason = self.stop.get_or_init(|| reason.to_owned());
        Lost::because(reason.clone())
    }
}

/// What journals say was spent, for the account of a run that is started again.
///
/// # Errors
/// When the folder or a journal in it cannot be read.
pub fn spent(vlm: &Vlm, folder: &Path) -> Result<Spend, JournalError> {
    let mut spend = Spend::default();
    let entries = match std::fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(spend),
        Err(source) => return Err(JournalError::Io { path: folder.to_owned(), source }),
    };
    for entry in entries {
        let path = entry.map_err(|source| JournalError::Io { path: folder.to_owned(), source })?.path();
        if path.extension().is_none_or(|ending| ending != "jsonl") {
            continue;
        }
        let journal = Journal::cassette(&path)?;
        spend.requests += journal.requests().sent;
        for recorded in journal.answers() {
            let Recorded::Answer { body, .. } = recorded else { continue };
            let read = vlm.read(body);
            let tokens = read.as_ref().map_or(0, |(answer, _)| tokens(answer));
            spend.tokens += tokens;
            match read.and_then(|(_, cost)| cost) {
                Some(cost) => spend.cost_usd += cost,
                None => spend.uncosted += 1,
            }
        }
    }
    Ok(spend)
}

fn tokens(answer: &Answer) -> u64 {
    u64::from(answer.prompt_tokens.unwrap_or(0)) + u64::from(answer.completion_tokens.unwrap_or(0))
}

/// A model in one episode.
#[derive(Debug)]
pub struct VlmAgent {
    vlm: Arc<Vlm>,
    task: Task,
    journal: Arc<Mutex<Journal>>,
}

impl Agent for VlmAgent {
    fn decide<'a>(&'a mut self, observation: &'a Observation) -> Decision<'a> {
        Box::pin(self.step(observation))
    }
}

impl VlmAgent {
    async fn step(&mut self, observation: &Observation) -> Result<Reply, Lost> {
        let words = Prompt::of(self.task.family)
            .and_then(|prompt| prompt.render(&self.task, observation))
            .map_err(|fault| self.vlm.halt(&format!("the prompt cannot be made: {fault}")))?;
        let schema = reply::schema(self.task.family);
        let dialect = self.vlm.choice.backend.dialect;
        // Pixels differ between machines, words do not: a cassette plays on any.
        let question = hash::of_bytes(dialect.body(&self.vlm.question(&words, &schema, "")).to_string().as_bytes());
        let recorded = locked(&self.journal).recorded(observation.t).cloned();
        if let Some(recorded) = recorded {
            return self.reply_to(observation.t, &question, &recorded);
        }
        let (Some(network), Some(_)) = (&self.vlm.network, &self.vlm.provider) else {
            return Err(Lost::because(format!("the cassette has no answer for step {}", observation.t)));
        };
        let png = observation
            .frame
            .to_png()
            .map_err(|fault| Lost::because(format!("the frame cannot be encoded: {fault}")))?;
        let step = Step {
            vlm: Arc::clone(&self.vlm),
            journal: Arc::clone(&self.journal),
            t: observation.t,
            frame: hash::of_bytes(png),
            body: dialect.body(&self.vlm.question(&words, &schema, &STANDARD.encode(png))),
            question: question.clone(),
        };
        let recorded = network
            .spawn(step.ask())
            .await
            .map_err(|fault| Lost::because(format!("a request broke off: {fault}")))??;
        self.reply_to(observation.t, &question, &recorded)
    }

    /// The reply in what is recorded, which must belong to this question.
    fn reply_to(&self, t: i32, question: &str, recorded: &Recorded) -> Result<Reply, Lost> {
        if recorded.question() != question {
            let reason = format!(
                "the recorded answer of step {t} belongs to another request: the prompt, the model's settings or the world changed\n  help: record into another folder, or remove the episode's journal"
            );
            return Err(Lost::because(reason));
        }
        match recorded {
            Recorded::GivenUp { status, .. } => Ok(without_decision(*status)),
            Recorded::Answer { body, latency_ms, .. } => {
                let (answer, cost_usd) = self
                    .vlm
                    .read(body)
                    .ok_or_else(|| Lost::because(format!("the recorded answer of step {t} cannot be read")))?;
                let count = |tokens: Option<u32>| tokens.and_then(|tokens| i32::try_from(tokens).ok());
                let usage = Usage {
                    latency_ms: Some(*latency_ms),
                    prompt_tokens: count(answer.prompt_tokens),
                    completion_tokens: count(answer.completion_tokens),
                    cost_usd,
                };
                Ok(reply::read(&answer.text, self.task.family, answer.ending).into_reply(answer.text, usage))
            }
        }
    }
}

fn without_decision(status: Status) -> Reply {
    Reply {
        status,
        repairs: Vec::new(),
        action: None,
        self_color: None,
        selected_cube: None,
        words: Words::default(),
        raw: None,
        usage: Usage::default(),
    }
}

/// Journals stay usable when a thread that held one ended badly: every line in them is whole.
fn locked(journal: &Mutex<Journal>) -> MutexGuard<'_, Journal> {
    journal.lock().unwrap_or_else(PoisonError::into_inner)
}

/// One step's question, on its way.
struct Step {
    vlm: Arc<Vlm>,
    journal: Arc<Mutex<Journal>>,
    t: i32,
    frame: String,
    body: Value,
    question: String,
}

/// Why an attempt ended without an answer.
enum Ended {
    Failed(Failure),
    Stopped(Lost),
}

impl Step {
    /// Asks until there is an answer, the attempts are used up, or there is no point in asking.
    async fn ask(self) -> Result<Recorded, Lost> {
        let Some(provider) = &self.vlm.provider else {
            return Err(Lost::because("nothing is sent from a cassette".to_owned()));
        };
        let patience = provider.patience();
        let backoff = ExponentialBuilder::default()
            .with_min_delay(patience.first_delay)
            .with_max_delay(patience.longest_delay)
            .with_max_times(patience.attempts.saturating_sub(1) as usize)
            .with_jitter();
        let mut attempt = 0;
        let asked = (|| {
            attempt += 1;
            self.attempt(provider, attempt)
        })
        .retry(backoff)
        .when(|ended| matches!(ended, Ended::Failed(failure) if failure.kind != FailureKind::Rejected))
        .adjust(|ended, delay| match ended {
            Ended::Failed(Failure { after: Some(after), .. }) => {
                delay.map(|_| (*after).min(patience.longest_asked_delay))
            }
            _ => delay,
        })
        .await;
        match asked {
            Ok(recorded) => Ok(recorded),
            Err(Ended::Stopped(lost)) => Err(lost),
            Err(Ended::Failed(failure)) if failure.kind == FailureKind::Rejected => {
                Err(self.vlm.halt(&format!("the provider refuses the request: {}", failure.detail)))
            }
            Err(Ended::Failed(failure)) => self.give_up(attempt, &failure),
        }
    }

    async fn attempt(&self, provider: &Provider, attempt: u32) -> Result<Recorded, Ended> {
        if let Some(reason) = self.vlm.stopped() {
            return Err(Ended::Stopped(Lost::because(reason.to_owned())));
        }
        self.vlm.account.request().map_err(|reached| Ended::Stopped(self.vlm.halt(&reached.to_string())))?;
        let (t, question) = (self.t, self.question.clone());
        self.write(&Entry::Request { t, attempt, question: question.clone(), frame: self.frame.clone() })?;
        match provider.ask(&self.body).await {
            Ok(received) => {
                let cost = self.vlm.read(&received.body).and_then(|(_, cost)| cost);
                self.vlm.account.answer(tokens(&received.answer), cost);
                let latency_ms = i32::try_from(received.latency.as_millis()).unwrap_or(i32::MAX);
                let (body, model, answered) = (received.body, received.answer.model, question.clone());
                self.write(&Entry::Answer { t, attempt, question, latency_ms, model, body: body.clone() })?;
                Ok(Recorded::Answer { question: answered, latency_ms, body })
            }
            Err(failure) => {
                let status = failure.kind.status().name().to_owned();
                let detail = failure.detail.clone();
                self.write(&Entry::Failure { t, attempt, status, detail, is_final: false, question })?;
                Err(Ended::Failed(failure))
            }
        }
    }

    fn give_up(&self, attempt: u32, failure: &Failure) -> Result<Recorded, Lost> {
        let status = failure.kind.status();
        if self.vlm.on_outage == OnOutage::Lose {
            let name = status.name();
            let cause = format!("step {}: {name} after {attempt} attempts: {}", self.t, failure.detail);
            return Err(Lost { status: Some(status), cause });
        }
        let entry = Entry::Failure {
            t: self.t,
            attempt,
            status: status.name().to_owned(),
            detail: failure.detail.clone(),
            is_final: true,
            question: self.question.clone(),
        };
        match self.write(&entry) {
            Ok(()) => Ok(Recorded::GivenUp { question: self.question.clone(), status }),
            Err(Ended::Stopped(lost)) => Err(lost),
            Err(Ended::Failed(failure)) => Err(Lost::because(failure.detail)),
        }
    }

    /// A journal that cannot be written ends the run: going on would ask, and pay, twice.
    fn write(&self, entry: &Entry) -> Result<(), Ended> {
        let written = tokio::task::block_in_place(|| locked(&self.journal).append(entry));
        written.map_err(|error| Ended::Stopped(self.vlm.halt(&error.to_string())))
    }
}

//! A model and the shared state of its episodes: source of answers, spending limits, reason to stop.

use std::path::PathBuf;
use std::pin::pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock};

use serde_json::Value;
use tokio::runtime::Handle;
use tokio::sync::Notify;

use super::estimate;
use super::limits::Account;
use super::models::{Choice, Model};
use super::provider::{Provider, Unreachable};
use super::wire_format::ModelAnswer;
use crate::limits::Spend;
use mirrorstats_agents::reply::Ending;
use mirrorstats_agents::{Lost, locked};

/// The costs of answers as stated by the provider, for models without prices.
#[derive(Clone, Copy, Debug, Default)]
struct Learned {
    usd: f64,
    prompt_tokens: f64,
    completion_tokens: f64,
}

impl Learned {
    fn add(&mut self, answer: &ModelAnswer) {
        let counted = [answer.prompt_tokens, answer.completion_tokens];
        let (Some(usd), [Some(prompt), Some(completion)]) = (answer.cost_usd, counted) else { return };
        self.usd += usd;
        // Tokens from a cache have a lower price.
        self.prompt_tokens += f64::from(prompt.saturating_sub(answer.cached_tokens.unwrap_or(0)));
        self.completion_tokens += f64::from(completion);
    }

    #[expect(clippy::cast_precision_loss, reason = "nobody pays for 2^53 tokens")]
    fn cost_at_most(self, [prompt, completion]: [u64; 2]) -> Option<f64> {
        let is_known = self.prompt_tokens > 0.0 && self.completion_tokens > 0.0;
        let share = prompt as f64 / self.prompt_tokens + completion as f64 / self.completion_tokens;
        is_known.then_some(self.usd * share)
    }
}

#[derive(Debug)]
pub struct Vlm {
    pub(super) choice: Choice,
    /// `None` if all answers come from a cassette.
    pub(super) online: Option<(Provider, Handle)>,
    /// A journal per episode, to continue or to replay.
    pub(super) folder: PathBuf,
    pub(super) account: Arc<Account>,
    stop: OnceLock<Lost>,
    stopped: Notify,
    pub(super) is_known: AtomicBool,
    first: tokio::sync::Mutex<()>,
    learned: Mutex<Learned>,
    /// True once the model has answered a request of this recording; later rejections are specific to a request.
    pub(super) has_answered: AtomicBool,
}

impl Vlm {
    /// A model accessed over the network; requests run on `network`.
    pub fn online(
        choice: Choice,
        provider: Provider,
        network: Handle,
        journals: PathBuf,
        account: Arc<Account>,
    ) -> Self {
        Self { online: Some((provider, network)), account, ..Self::cassette(choice, journals) }
    }

    /// A model whose answers are replayed from journals; it needs no key and sends nothing.
    pub fn cassette(choice: Choice, folder: PathBuf) -> Self {
        Self {
            choice,
            online: None,
            folder,
            account: Arc::default(),
            stop: OnceLock::new(),
            stopped: Notify::new(),
            is_known: AtomicBool::new(false),
            first: tokio::sync::Mutex::default(),
            learned: Mutex::default(),
            has_answered: AtomicBool::new(false),
        }
    }

    pub(super) fn path(&self, episode: &str) -> PathBuf {
        self.folder.join(format!("{episode}.jsonl"))
    }

    pub fn choice(&self) -> &Choice {
        &self.choice
    }

    /// The reason why further requests are pointless: a rejected key, a limit that is reached, a full disk.
    pub fn stopped(&self) -> Option<&str> {
        self.stop.get().map(|lost| lost.cause.as_str())
    }

    /// Notes that the model has answered: from now on a rejected request costs its episode, not the recording.
    pub fn note_answered(&self) {
        self.has_answered.store(true, Ordering::Relaxed);
    }

    pub(super) async fn turn_of_first(&self) -> Option<tokio::sync::MutexGuard<'_, ()>> {
        let is_bounded = || !self.account.limits_cost() || self.cost_of([1, 1]).is_some();
        let has_come = || self.is_known.load(Ordering::Relaxed) || self.has_answered.load(Ordering::Relaxed);
        let is_over = || has_come() && is_bounded();
        if is_over() {
            return None;
        }
        let turn = self.first.lock().await;
        (!is_over()).then_some(turn)
    }

    pub(super) fn check_model(&self, returned: Option<&str>) -> Result<(), Lost> {
        let Some(other) = returned.filter(|returned| !self.choice.model.takes_answer_of(returned)) else {
            return Ok(());
        };
        let (id, name) = (&self.choice.model.id, &self.choice.name);
        Err(self.halt(Lost::because(format!(
            "another model answers: asked for `{id}`, found an answer by `{other}`\n  help: `--accept-model {other}` records \
             it under the name `{name}`; if it is the same model, add its id to `answers_as` of the model in a file for --models"
        ))))
    }

    /// Ends a recording that has a cost limit if neither prices nor answers state the cost.
    pub(super) fn check_cost(&self, answer: &ModelAnswer) -> Result<(), Lost> {
        let is_unknown = answer.ending != Ending::Refused && self.cost_of([1, 1]).is_none();
        match self.choice.check_prices() {
            Err(error) if is_unknown && self.account.limits_cost() => Err(self.halt(Lost::because(error.to_string()))),
            _ => Ok(()),
        }
    }

    pub fn connect(&self) -> Result<(), Unreachable> {
        self.online.as_ref().map_or(Ok(()), |(provider, _)| provider.connect())
    }

    pub fn max_output_tokens(&self) -> u32 {
        self.choice.model.max_output_tokens()
    }

    pub fn spend(&self) -> Spend {
        self.account.spend()
    }

    pub fn description(&self) -> Value {
        let mut description = serde_json::json!({
            "model": self.choice.name,
            "id": self.choice.model.id,
            "backend": self.choice.model.backend,
            "contract": self.choice.model.contract.name(),
            "temperature": self.choice.temperature().map_or_else(|| "default".into(), Value::from),
            "max_output_tokens": self.max_output_tokens(),
            "identification_version": mirrorstats_identification::VERSION,
        });
        let Model { reasoning_effort, answers_as, accepted, .. } = &self.choice.model;
        if let Some(effort) = reasoning_effort {
            description["reasoning_effort"] = effort.name().into();
        }
        let extra = self.choice.extra_body();
        if !extra.is_empty() {
            description["extra_body"] = extra.into();
        }
        if !answers_as.is_empty() && answers_as != &["*"] {
            description["answers_as"] = answers_as.clone().into();
        }
        if !accepted.is_empty() {
            description["accepted_models"] = accepted.clone().into();
        }
        description
    }

    pub(super) fn read(&self, body: &str) -> Option<ModelAnswer> {
        self.choice.backend.wire_format.read(body).ok()?
    }

    /// The maximum tokens of a request with this many bytes of words, and of its reply. A token of words has at least
    /// one byte; for a frame, providers have counted up to twice the documented tokens.
    pub(super) fn at_most(&self, bytes: usize, view: [u32; 2]) -> [u64; 2] {
        let frame = estimate::frame_tokens(self.choice.backend.wire_format, view);
        [bytes as u64 + 2 * frame, self.max_output_tokens().into()]
    }

    pub(super) fn cost_of(&self, [prompt, completion]: [u64; 2]) -> Option<f64> {
        let by_price = self.choice.model.prices.cost_of(prompt, completion);
        by_price.or_else(|| locked(&self.learned).cost_at_most([prompt, completion]))
    }

    pub(super) fn learn_from(&self, answer: &ModelAnswer) {
        locked(&self.learned).add(answer);
    }

    pub(super) fn halt(&self, lost: Lost) -> Lost {
        let first = self.stop.get_or_init(|| lost).clone();
        self.stopped.notify_waiters();
        first
    }

    /// Waits for `work`, unless the recording ends first.
    pub(super) async fn unless_stopped<T>(&self, work: impl Future<Output = T>) -> Result<T, Lost> {
        let stopped = pin!(self.stopped.notified());
        if let Some(lost) = self.stop.get() {
            return Err(lost.clone());
        }
        tokio::select! {
            biased;
            () = stopped => Err(self.stop.get().cloned().unwrap_or_else(|| Lost::because("the recording was stopped"))),
            done = work => Ok(done),
        }
    }
}

pub(super) fn tokens(answer: &ModelAnswer) -> u64 {
    u64::from(answer.prompt_tokens.unwrap_or(0)) + u64::from(answer.completion_tokens.unwrap_or(0))
}

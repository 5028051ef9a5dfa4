//! A model, and what all of its episodes share: where answers come from, what may be spent, why to stop.

use std::path::{Path, PathBuf};
use std::pin::pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use serde_json::Value;
use tokio::runtime::Handle;
use tokio::sync::Notify;

use super::estimate;
use super::journal::{Journal, JournalError, Recorded};
use super::limits::{Account, Spend};
use super::models::{Choice, Contract, merge};
use super::preflight::Unreachable;
use super::provider::Provider;
use super::wire_format::{Answer, Question};
use crate::agent::{Lost, prompt};

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
    pub(super) fn path(&self, episode: &str) -> PathBuf {
        match self {
            Self::Journals(folder) | Self::Cassette(folder) => folder.join(format!("{episode}.jsonl")),
        }
    }
}

/// A model and everything that its episodes share.
#[derive(Debug)]
pub struct Vlm {
    pub(super) choice: Choice,
    /// `None` where answers come from a cassette alone.
    pub(super) provider: Option<Provider>,
    pub(super) network: Option<Handle>,
    pub(super) memory: Memory,
    pub(super) account: Arc<Account>,
    pub(super) on_outage: OnOutage,
    max_output_tokens: u32,
    stop: OnceLock<Lost>,
    stopped: Notify,
    is_known: AtomicBool,
    first: tokio::sync::Mutex<()>,
    /// Whether the model has answered a request of this recording, so that one that is rejected is wrong by itself.
    pub(super) has_answered: AtomicBool,
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
    ) -> Self {
        Self {
            max_output_tokens: choice.model.max_output_tokens(),
            choice,
            provider: Some(provider),
            network: Some(network),
            memory: Memory::Journals(journals),
            account,
            on_outage,
            stop: OnceLock::new(),
            stopped: Notify::new(),
            is_known: AtomicBool::new(false),
            first: tokio::sync::Mutex::default(),
            has_answered: AtomicBool::new(false),
        }
    }

    /// A model whose answers are played from journals; no key is needed and nothing is sent.
    pub fn cassette(choice: Choice, folder: PathBuf) -> Self {
        Self {
            max_output_tokens: choice.model.max_output_tokens(),
            choice,
            provider: None,
            network: None,
            memory: Memory::Cassette(folder),
            account: Arc::default(),
            on_outage: OnOutage::default(),
            stop: OnceLock::new(),
            stopped: Notify::new(),
            is_known: AtomicBool::new(false),
            first: tokio::sync::Mutex::default(),
            has_answered: AtomicBool::new(false),
        }
    }

    /// The model that was chosen.
    pub fn choice(&self) -> &Choice {
        &self.choice
    }

    /// Why no further request makes sense: a refused key, a limit that is reached, a full disk.
    pub fn stopped(&self) -> Option<&str> {
        self.stop.get().map(|lost| lost.cause.as_str())
    }

    /// What an episode is lost to that wants to send a request after the end.
    pub(super) fn end(&self) -> Option<Lost> {
        self.stop.get().cloned()
    }

    /// Notes that the model has answered: a request that is rejected from now on costs its episode, not the recording.
    pub fn note_answered(&self) {
        self.has_answered.store(true, Ordering::Relaxed);
    }

    pub(super) async fn turn_of_first(&self) -> Option<tokio::sync::MutexGuard<'_, ()>> {
        let is_over = || self.is_known.load(Ordering::Relaxed) || self.has_answered.load(Ordering::Relaxed);
        if is_over() {
            return None;
        }
        let turn = self.first.lock().await;
        (!is_over()).then_some(turn)
    }

    pub(super) fn note_known(&self) {
        self.is_known.store(true, Ordering::Relaxed);
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

    /// Whether the provider can be reached; a cassette needs none.
    pub fn connect(&self) -> Result<(), Unreachable> {
        self.provider.as_ref().map_or(Ok(()), Provider::connect)
    }

    /// The most tokens that a reply may have.
    pub fn max_output_tokens(&self) -> u32 {
        self.max_output_tokens
    }

    /// How many steps of an episode have their answer already.
    pub fn answered(&self, episode: &str) -> Result<u64, JournalError> {
        match Journal::cassette(&self.memory.path(episode)) {
            Ok(journal) => Ok(journal.answers().count() as u64),
            Err(JournalError::Missing { .. }) => Ok(0),
            Err(error) => Err(error),
        }
    }

    /// Counts what is spent with other processes that record the model into the same folder, by the ledger at this path.
    /// `slug` is the model's name in the names of episodes.
    pub fn share_account(&self, ledger: &Path, slug: &str) -> Result<(), Box<dyn std::error::Error>> {
        let (Memory::Journals(folder), Some(provider)) = (&self.memory, &self.provider) else { return Ok(()) };
        let journals = || spent(self, folder, slug).map_err(Box::<dyn std::error::Error>::from);
        self.account.share(ledger, provider.patience().timeout, journals)
    }

    /// What was spent, over all starts of the run.
    pub fn spend(&self) -> Spend {
        self.account.spend()
    }

    /// What goes into recordings: everything that shapes the requests.
    pub fn description(&self) -> Value {
        let mut description = serde_json::json!({
            "model": self.choice.name,
            "id": self.choice.model.id,
            "backend": self.choice.model.backend,
            "contract": self.choice.model.contract.name(),
            "temperature": self.choice.model.temperature.map_or_else(|| "default".into(), Value::from),
            "max_output_tokens": self.max_output_tokens,
            "identification_version": trace::identification::VERSION,
        });
        if let Some(effort) = self.choice.model.reasoning_effort {
            description["reasoning_effort"] = effort.name().into();
        }
        let extra = self.choice.extra_body();
        if !extra.is_empty() {
            description["extra_body"] = extra.into();
        }
        let (patterns, accepted) = (&self.choice.model.answers_as, &self.choice.model.accepted);
        if !patterns.is_empty() && patterns != &["*"] {
            description["answers_as"] = patterns.clone().into();
        }
        if !accepted.is_empty() {
            description["accepted_models"] = accepted.clone().into();
        }
        description
    }

    pub(super) fn read(&self, body: &str) -> Option<Answer> {
        self.choice.backend.dialect.read(body).ok()?
    }

    /// What an answer cost, US dollars: as the provider says, else by its tokens.
    pub(super) fn cost_usd(&self, answer: &Answer) -> Option<f64> {
        answer.cost_usd.or_else(|| self.choice.model.prices.cost_usd(answer))
    }

    /// What a request of so many bytes of words takes at most: tokens of the request and of the reply. No token of words is
    /// less than a byte; of a frame, providers have counted up to twice what they document.
    pub(super) fn at_most(&self, bytes: usize, view: [u32; 2]) -> [u64; 2] {
        let frame = estimate::frame_tokens(self.choice.backend.dialect, view);
        [bytes as u64 + 2 * frame, self.max_output_tokens.into()]
    }

    /// What these tokens of a request and a reply cost, US dollars.
    pub(super) fn cost_of(&self, [prompt, completion]: [u64; 2]) -> Option<f64> {
        self.choice.model.prices.cost_of(prompt, completion)
    }

    /// The body of a request with this frame, as PNG in base64.
    pub(super) fn body(&self, words: &prompt::Rendered, schema: &Value, png: &str) -> Value {
        let mut body = self.choice.backend.dialect.body(&self.question(words, schema, png));
        merge(&mut body, &self.choice.extra_body().into());
        body
    }

    fn question<'a>(&'a self, words: &'a prompt::Rendered, schema: &'a Value, png: &'a str) -> Question<'a> {
        Question {
            model: &self.choice.model.id,
            system: &words.system,
            user: &words.user,
            png_base64: png,
            schema: (self.choice.model.contract == Contract::Schema).then_some(schema),
            temperature: self.choice.model.temperature,
            max_output_tokens: self.max_output_tokens,
            reasoning_effort: self.choice.model.reasoning_effort,
        }
    }

    pub(super) fn halt(&self, lost: Lost) -> Lost {
        let first = self.stop.get_or_init(|| lost).clone();
        self.stopped.notify_waiters();
        first
    }

    /// Waits for this, unless the recording ends first.
    pub(super) async fn unless_stopped<T>(&self, work: impl Future<Output = T>) -> Result<T, Lost> {
        let stopped = pin!(self.stopped.notified());
        if let Some(lost) = self.end() {
            return Err(lost);
        }
        tokio::select! {
            biased;
            () = stopped => Err(self.end().unwrap_or_else(|| Lost::because("the recording was stopped".to_owned()))),
            done = work => Ok(done),
        }
    }
}

/// What journals say was spent on this model, for the account of a run that is started again. `slug` is the model's name in
/// the names of episodes; the journals of other models in the folder have other prices and limits.
pub fn spent(vlm: &Vlm, folder: &Path, slug: &str) -> Result<Spend, JournalError> {
    let mut spend = Spend::default();
    let entries = match std::fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(spend),
        Err(source) => return Err(JournalError::Io { path: folder.to_owned(), source }),
    };
    for entry in entries {
        let path = entry.map_err(|source| JournalError::Io { path: folder.to_owned(), source })?.path();
        let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
        if path.extension().is_none_or(|ending| ending != "jsonl") || model_of(stem) != Some(slug) {
            continue;
        }
        let journal = Journal::cassette(&path)?;
        add_journal(vlm, &journal, &mut spend);
    }
    Ok(spend)
}

fn add_journal(vlm: &Vlm, journal: &Journal, spend: &mut Spend) {
    let usd = |at_most: Option<[u64; 2]>| at_most.and_then(|tokens| vlm.cost_of(tokens)).unwrap_or(0.0);
    let requests = journal.requests();
    spend.requests += requests.sent;
    for at_most in requests.unanswered {
        spend.add_unanswered(usd(at_most));
    }
    for recorded in journal.answers() {
        let Recorded::Answer { body, at_most, .. } = recorded else { continue };
        let answer = vlm.read(body);
        let cost = answer.as_ref().and_then(|answer| vlm.cost_usd(answer));
        spend.add_answer(answer.as_ref().map_or(0, tokens), cost, usd(*at_most));
    }
}

/// The model in the name of an episode's journal: `slug` in `E1-slug-s1-r3`, and in `E1-slug@near-s1-r3-x2`.
fn model_of(stem: &str) -> Option<&str> {
    let without_last = |name, mark: char| {
        let (rest, last): (&str, &str) = str::rsplit_once(name, '-')?;
        let number = last.strip_prefix(mark)?;
        (!number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit())).then_some(rest)
    };
    let first = without_last(stem, 'x').unwrap_or(stem);
    let (_, subject) = without_last(without_last(first, 'r')?, 's')?.split_once('-')?;
    Some(subject.split_once('@').map_or(subject, |(model, _)| model))
}

pub(super) fn tokens(answer: &Answer) -> u64 {
    u64::from(answer.prompt_tokens.unwrap_or(0)) + u64::from(answer.completion_tokens.unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::model_of;

    #[test]
    fn a_journal_names_its_model() {
        for (stem, expected) in [
            ("E1-gpt-5-1-s1-r3", Some("gpt-5-1")),
            ("E1-gpt-5-s1-r3-x2", Some("gpt-5")),
            ("E5-a@near-s1-s2-r10", Some("a")),
            ("E1-a-s1-r1-s2-r3", Some("a-s1-r1")),
            ("E1-s2-r3", None),
            ("E1-a-s2", None),
            ("notes", None),
            ("", None),
        ] {
            assert_eq!(model_of(stem), expected, "{stem}");
        }
    }
}

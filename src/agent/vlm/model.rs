//! A model, and what all of its episodes share: where answers come from, what may be spent, why to stop.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use serde_json::Value;
use tokio::runtime::Handle;

use super::journal::{Journal, JournalError, Recorded};
use super::limits::{Account, Spend};
use super::models::{Choice, Contract};
use super::provider::Provider;
use super::wire_format::{Answer, Question};
use crate::agent::{Lost, prompt};

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
    /// Why no further request makes sense, once there is such a reason.
    stop: OnceLock<String>,
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
            has_answered: AtomicBool::new(false),
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
            has_answered: AtomicBool::new(false),
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

    /// Notes that the model has answered: a request that is rejected from now on costs its episode, not the recording.
    pub fn note_answered(&self) {
        self.has_answered.store(true, Ordering::Relaxed);
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
            "identification_version": crate::trace::identification::VERSION,
        })
    }

    /// What a body says, and what it cost.
    pub(super) fn read(&self, body: &str) -> Option<(Answer, Option<f64>)> {
        let answer = self.choice.backend.dialect.read(body).ok()??;
        let cost = answer
            .cost_usd
            .or_else(|| self.choice.model.prices.cost_usd(answer.prompt_tokens?, answer.completion_tokens?));
        Some((answer, cost))
    }

    pub(super) fn question<'a>(&'a self, words: &'a prompt::Rendered, schema: &'a Value, png: &'a str) -> Question<'a> {
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
    pub(super) fn halt(&self, reason: &str) -> Lost {
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

/// The tokens that an answer counts.
pub(super) fn tokens(answer: &Answer) -> u64 {
    u64::from(answer.prompt_tokens.unwrap_or(0)) + u64::from(answer.completion_tokens.unwrap_or(0))
}

//! A model behind a provider: its arguments and its player.

use std::num::{NonZeroU32, NonZeroUsize};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use super::AnyPlayer;
use crate::cli::{Failure, output};
use mirrorstats_agents::secrets::Secret;
use mirrorstats_exact::escape::visible;
use mirrorstats_record::plan::slug;
use mirrorstats_trace::footers::model_id::OWN_SERVER;
use mirrorstats_vlm::limits::{Account, Limits};
use mirrorstats_vlm::models::{Choice, Models};
use mirrorstats_vlm::provider::{Patience, Provider, check_transport};
use mirrorstats_vlm::wire_format::{Effort, WireFormat};
use mirrorstats_vlm::{Vlm, VlmPlayer};

/// A model, who serves it, and what a recording with it may spend.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "With --agent vlm")]
pub struct VlmArgs {
    /// The model: a name of the paper's table, an id, or a name in --models; for any other agent, its name in tables.
    /// Several are recorded one after the other
    #[arg(long, value_name = "NAME|ID")]
    pub(super) model: Vec<String>,
    /// A file with more models, in the shape of assets/models.toml
    #[arg(long, value_name = "FILE")]
    models: Option<PathBuf>,
    /// The provider, overriding the file of models: openai, openrouter, google, anthropic, compatible
    #[arg(long, value_name = "NAME")]
    backend: Option<String>,
    /// The address of a server that takes OpenAI's chat completions, such as `http://localhost:8000/v1`
    #[arg(long, value_name = "URL")]
    base_url: Option<String>,
    /// Accept answers of this model too, by the id that the provider returns; otherwise an answer by another model than
    /// requested stops the recording
    #[arg(long, value_name = "ID")]
    accept_model: Vec<String>,
    /// Stop before the model's cost in this folder, over all starts, exceeds this many US dollars; needs both prices of
    /// the model, or a router that reports the cost of an answer
    #[arg(long, value_name = "USD", value_parser = amount)]
    max_cost: Option<f64>,
    /// Stop before the model's tokens in this folder, over all starts, exceed this number
    #[arg(long, value_name = "N")]
    max_tokens: Option<u64>,
    /// Stop before the model's requests in this folder, over all starts, exceed this number
    #[arg(long, value_name = "N")]
    max_requests: Option<u64>,
    /// The most tokens of a reply, including hidden reasoning [default: from the file of models, else 2048, or 16384
    /// for a model that is asked to reason]
    #[arg(long, value_name = "N")]
    max_output_tokens: Option<NonZeroU32>,
    /// The reasoning effort: none, minimal, low, medium, high, xhigh or max, if the model supports it [default: from
    /// the file of models, else the provider's]
    #[arg(long, value_name = "EFFORT", value_parser = effort)]
    reasoning_effort: Option<Effort>,
    /// The account's limit of requests per minute [default: the limit that the provider reports]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(super) requests_per_minute: Option<u32>,
    /// Attempts for one step
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u32).range(1..=50))]
    attempts: u32,
    /// A service tier at half the price: flex of OpenAI and Google, whose answers take minutes
    #[arg(long, value_name = "flex", value_parser = ["flex"])]
    tier: Option<String>,
    /// Seconds for one answer [default: 180, or 900 with --tier flex]
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u64).range(1..=3_600))]
    timeout: Option<u64>,
    /// Replay the answers in an earlier recording's journals; nothing is sent
    #[arg(long, value_name = "DIR")]
    cassette: Option<PathBuf>,
}

/// Episodes in flight, and so requests, if --in-flight is absent; fewer if the provider reports too many.
const IN_FLIGHT: usize = 64;

const JOURNALS: &str = "journal";

impl VlmArgs {
    pub fn name(&self) -> Option<&str> {
        self.model.first().map(String::as_str)
    }

    /// The same arguments for each of the typed models; one copy if none was typed.
    pub fn each(&self) -> Vec<Self> {
        match self.model.as_slice() {
            [] | [_] => vec![self.clone()],
            several => several.iter().map(|model| Self { model: vec![model.clone()], ..self.clone() }).collect(),
        }
    }

    /// The player, with its journals in the recording's folder; it sends at most `in_flight` requests at once.
    pub fn player(&self, out: &Path, in_flight: Option<NonZeroUsize>) -> Result<AnyPlayer, Failure> {
        let choice = self.choice()?;
        if let Some(folder) = &self.cassette {
            return Ok(of_journals(choice, folder.clone(), 1));
        }
        // A router reports the cost of an answer; for others it is unknown without prices.
        let may_say = choice.backend.wire_format == WireFormat::OpenaiCompatible && choice.model.backend != OWN_SERVER;
        if self.max_cost.is_some() && !may_say {
            choice.check_prices()?;
        }
        let network = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build();
        let network = network.map_err(|error| Failure::input(format!("cannot start the network thread: {error}")))?;
        let provider = self.provider(&choice, in_flight.map_or(IN_FLIGHT, NonZeroUsize::get))?;
        let slug = slug(&choice.name);
        let limits = Limits { cost_usd: self.max_cost, tokens: self.max_tokens, requests: self.max_requests };
        let account = Arc::new(Account::new(limits));
        let vlm = Vlm::online(choice, provider, network.handle().clone(), out.join(JOURNALS), account);
        vlm.count_spent(&slug)?;
        Ok(AnyPlayer::Model(VlmPlayer { vlm: Arc::new(vlm), in_flight: IN_FLIGHT, network: Some(network) }))
    }

    /// The player of a forecast: it reads the journals in the recording's folder, but has no key and sends no requests.
    pub fn forecaster(&self, out: &Path) -> Result<AnyPlayer, Failure> {
        Ok(of_journals(self.choice()?, out.join(JOURNALS), IN_FLIGHT))
    }

    /// Returns true if requests are sent, and not answered from an earlier recording.
    pub fn sends(&self) -> bool {
        self.cassette.is_none()
    }

    fn choice(&self) -> Result<Choice, Failure> {
        let Some(name) = self.name() else {
            return Err(Failure::input("--agent vlm needs --model, such as --model \"Claude Sonnet 4.6\""));
        };
        let models = Models::load(self.models.as_deref())?;
        let backend = self.backend.as_deref().or(self.base_url.is_some().then_some(OWN_SERVER));
        let mut choice = models.choose(name, backend)?;
        if !choice.is_known && choice.model.backend != OWN_SERVER {
            output::say(&format!(
                "warning: no file of models has `{}`: its prices are not known, and it is asked with the temperature of the paper; \
                 a file for --models says more",
                visible(name)
            ));
        }
        if let Some(url) = &self.base_url {
            choice.backend.base_url = Some(url.clone());
        }
        if self.tier.is_some() {
            choice.use_flex_tier()?;
        }
        choice.model.accepted.clone_from(&self.accept_model);
        choice.model.max_output_tokens = self.max_output_tokens.or(choice.model.max_output_tokens);
        choice.model.reasoning_effort = self.reasoning_effort.or(choice.model.reasoning_effort);
        Ok(choice)
    }

    fn provider(&self, choice: &Choice, in_flight: usize) -> Result<Provider, Failure> {
        let Some(url) = &choice.backend.base_url else {
            return Err(Failure::input(format!("the backend of `{}` has no address; give --base-url", choice.name)));
        };
        let secret = Secret::from_environment(&choice.backend.key);
        let secret = match (secret, choice.backend.wire_format) {
            (Ok(secret), _) => Some(secret),
            // The user's own servers mostly need no key.
            (Err(_), WireFormat::OpenaiCompatible) if self.base_url.is_some() => None,
            (Err(missing), _) => return Err(Failure::input(missing)),
        };
        if secret.is_some() {
            check_transport(url, &choice.backend)?;
        }
        let patience = Patience {
            attempts: self.attempts,
            timeout: Duration::from_secs(self.timeout.unwrap_or(if self.tier.is_some() { 900 } else { 180 })),
            interval: self.requests_per_minute.map_or(Duration::ZERO, |count| Duration::from_mins(1) / count),
            ..Patience::default()
        };
        Provider::new(url, choice.backend.wire_format, &choice.model.id, secret, patience, in_flight)
            .map_err(Failure::input)
    }
}

fn of_journals(choice: Choice, folder: PathBuf, in_flight: usize) -> AnyPlayer {
    AnyPlayer::Model(VlmPlayer { vlm: Arc::new(Vlm::cassette(choice, folder)), in_flight, network: None })
}

fn amount(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().map_err(|fault| fault.to_string())?;
    if value.is_finite() && value >= 0.0 { Ok(value) } else { Err("expected a finite number from 0".to_owned()) }
}

fn effort(text: &str) -> Result<Effort, String> {
    Effort::named(text).ok_or_else(|| format!("expected one of {}", Effort::ALL.map(Effort::name).join(", ")))
}

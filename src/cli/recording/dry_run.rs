//! What `record --dry-run` says: what would be recorded, and what that may take. Nothing is written or sent.

use std::io::{self, Write as _};

use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::recording::dollars;
use crate::cli::text_table::counted;
use crate::cli::vlm::VlmPlayer;
use exact::escape::visible;
use world::agent::vlm::estimate;
use world::record::plan::{Key, Subject};
use world::sim::config::WorldConfig;

/// The answer of `record --dry-run --json`.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ForecastAnswer {
    /// The model's name as shown in tables.
    pub model: String,
    /// Episodes asked for, those of other shards not among them.
    pub asked: usize,
    /// Episodes that are there already.
    pub found: usize,
    /// The ids of the episodes that would be recorded.
    pub episodes: Vec<String>,
    /// Their steps, if all of them use up their budget.
    pub steps_at_most: u64,
    /// What would be sent to a provider; null for agents that send nothing.
    pub requests: Option<RequestForecast>,
}

/// What would be sent to a provider, and come back.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct RequestForecast {
    /// Requests, if all episodes use up their budget; attempts after failures are not counted.
    pub at_most: u64,
    /// Steps of these episodes that an earlier start has the answer of: they are not sent again.
    pub answered: u64,
    /// Tokens of these requests, estimated from the prompt's length and the frame's size.
    pub prompt_tokens: u64,
    /// Tokens of the replies, if each is as long as it may be.
    pub completion_tokens_at_most: u64,
    /// US dollars for the requests alone; null if nobody knows the price.
    pub prompt_cost_usd: Option<f64>,
    /// US dollars with the longest replies; null if nobody knows the price.
    pub cost_usd_at_most: Option<f64>,
}

impl ForecastAnswer {
    /// What recording the episodes that are still to do would come to.
    pub fn of(
        subject: &Subject,
        asked: usize,
        todo: &[Key],
        config: &WorldConfig,
        requests: Option<RequestForecast>,
    ) -> Self {
        Self {
            model: subject.model.clone(),
            asked,
            found: asked - todo.len(),
            episodes: todo.iter().map(|key| key.episode_id(subject)).collect(),
            steps_at_most: todo.iter().map(|key| u64::from(config.of(key.experiment).episode.steps)).sum(),
            requests,
        }
    }
}

impl RequestForecast {
    /// What a model would be asked in these episodes.
    pub fn of(
        player: &VlmPlayer,
        subject: &Subject,
        todo: &[Key],
        config: &WorldConfig,
    ) -> Result<Self, Box<dyn std::error::Error + Send + Sync>> {
        let vlm = player.vlm();
        let view = [config.eye.width, config.eye.height_px];
        let mut forecast = Self {
            at_most: 0,
            answered: 0,
            prompt_tokens: 0,
            completion_tokens_at_most: 0,
            prompt_cost_usd: None,
            cost_usd_at_most: None,
        };
        for key in todo {
            let answered = vlm.answered(&key.file_stem(subject))?;
            let left = u64::from(config.of(key.experiment).episode.steps).saturating_sub(answered);
            forecast.answered += answered;
            forecast.at_most += left;
            forecast.prompt_tokens += left * estimate::prompt_tokens(vlm.choice(), key.experiment, view)?;
        }
        forecast.completion_tokens_at_most = forecast.at_most * u64::from(vlm.max_output_tokens());
        let prices = vlm.choice().model.prices;
        forecast.prompt_cost_usd = prices.cost_of_requests(forecast.prompt_tokens);
        forecast.cost_usd_at_most = prices.cost_of(forecast.prompt_tokens, forecast.completion_tokens_at_most);
        Ok(forecast)
    }
}

/// Prints what would be recorded, for people.
pub(crate) fn print(answer: &ForecastAnswer) -> io::Result<()> {
    let mut out = io::stdout().lock();
    let (to_do, steps) = (counted(answer.episodes.len() as u64, "episode"), counted(answer.steps_at_most, "step"));
    write!(out, "{}: would record {to_do}, at most {steps}", visible(&answer.model))?;
    match answer.found {
        0 => writeln!(out)?,
        found => writeln!(out, "; {found} of {} are there already", answer.asked)?,
    }
    let Some(requests) = &answer.requests else { return Ok(()) };
    let sent = counted(requests.at_most, "request");
    write!(out, "requests: at most {sent}, and more where attempts fail")?;
    match requests.answered {
        0 => writeln!(out)?,
        answered => writeln!(out, "; {} more have their answers already", counted(answered, "step"))?,
    }
    let (prompt, completion) = (requests.prompt_tokens, requests.completion_tokens_at_most);
    writeln!(out, "tokens: about {prompt} in requests, at most {completion} in replies")?;
    match (requests.prompt_cost_usd, requests.cost_usd_at_most) {
        (Some(prompt), Some(most)) => writeln!(
            out,
            "cost: about {} for the requests, at most {} with the longest replies",
            dollars(prompt),
            dollars(most)
        ),
        (Some(prompt), None) => writeln!(
            out,
            "cost: about {} for the requests, unknown for the replies: the model has no output price; --models FILE gives it",
            dollars(prompt)
        ),
        _ => writeln!(out, "cost: unknown, the model has no price for requests; --models FILE gives prices"),
    }
}

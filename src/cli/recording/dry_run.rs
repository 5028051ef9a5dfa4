//! What `record --dry-run` says: what would be recorded, and what that may take. Nothing is written or sent.

use std::io;

use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::recording::dollars;
use crate::cli::text_table::counted;
use crate::cli::vlm::VlmPlayer;
use exact::escape::visible;
use world::agent::vlm::estimate;
use world::record::plan::{Key, Subject};
use world::sim::config::WorldConfig;

/// Tokens of a reply, hidden reasoning left out, before any is seen: the keys of the paper's object with a sentence each.
const TYPICAL_REPLY: u64 = 250;

/// The answer of `record --dry-run --json`; a list of them for a study or several models.
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
    /// US dollars with replies of 250 tokens, a prior, or as many as they may have; null if nobody knows the price.
    pub typical_cost_usd: Option<f64>,
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
            typical_cost_usd: None,
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
        let typical = TYPICAL_REPLY.min(vlm.max_output_tokens().into());
        forecast.typical_cost_usd = prices.cost_of(forecast.prompt_tokens, forecast.at_most * typical);
        forecast.cost_usd_at_most = prices.cost_of(forecast.prompt_tokens, forecast.completion_tokens_at_most);
        Ok(forecast)
    }
}

/// Tells what would be recorded of several models, and of all together.
pub(crate) fn tell_all(out: &mut impl io::Write, answers: &[ForecastAnswer]) -> io::Result<()> {
    answers.iter().try_for_each(|answer| tell(out, answer))?;
    let requests: Vec<_> = answers.iter().filter_map(|answer| answer.requests).collect();
    let episodes: usize = answers.iter().map(|answer| answer.episodes.len()).sum();
    let sent: u64 = requests.iter().map(|requests| requests.at_most).sum();
    let sum = |cost: fn(&RequestForecast) -> Option<f64>| dollars(requests.iter().filter_map(cost).sum());
    let unknown = requests.iter().filter(|requests| requests.cost_usd_at_most.is_none()).count();
    let (typical, most) = (sum(|requests| requests.typical_cost_usd), sum(|requests| requests.cost_usd_at_most));
    write!(out, "together: {}, at most {}; ", counted(episodes as u64, "episode"), counted(sent, "request"))?;
    write!(out, "about {typical} with replies of {TYPICAL_REPLY} tokens, at most {most}")?;
    match unknown {
        0 => writeln!(out),
        models => writeln!(out, ", and what {} without prices cost", counted(models as u64, "model")),
    }
}

/// Tells what would be recorded, for people.
pub(crate) fn tell(out: &mut impl io::Write, answer: &ForecastAnswer) -> io::Result<()> {
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
    match (requests.prompt_cost_usd, requests.typical_cost_usd.zip(requests.cost_usd_at_most)) {
        (Some(prompt), Some((typical, most))) => writeln!(
            out,
            "cost: about {} for the requests, {} with replies of {TYPICAL_REPLY} tokens, at most {} with the longest replies",
            dollars(prompt),
            dollars(typical),
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

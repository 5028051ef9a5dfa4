//! The forecast of a recording's requests: how many, their tokens, cost and time.
//!
//! Rule: the upper bounds assume all steps and the longest replies. The typical values follow the finished episodes.

use schemars::JsonSchema;
use serde::Serialize;

use super::answered::Typical;
use super::estimate;
use super::model::Vlm;
use mirrorstats_experiment::Experiment;

/// The expected tokens of a reply without hidden reasoning, before any reply: the paper's keys with a sentence each.
pub const PRIOR_REPLY: u64 = 250;
/// The expected seconds for an answer, before any answer.
pub const PRIOR_SECONDS: f64 = 5.0;

/// An episode to record, and the steps that it has at most.
#[derive(Clone, Debug)]
pub struct Remaining<'e> {
    /// The stem of its journal.
    pub stem: String,
    pub experiment: &'e Experiment,
    pub steps: u64,
}

/// The requests to a provider, and its answers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, JsonSchema)]
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
    /// Finished episodes that `typical_cost_usd` and `seconds` are estimated from; 0 if they follow a prior: all steps, replies of
    /// 250 tokens, 5 s for an answer.
    pub finished_episodes: u64,
    /// Requests, if episodes are as long as the finished ones.
    pub typical_requests: u64,
    /// US dollars for these requests; null if nobody knows the price.
    pub typical_cost_usd: Option<f64>,
    /// Seconds for these requests, as many at once as there may be, and no more in a minute than `--requests-per-minute` allows.
    pub seconds: f64,
    /// US dollars with the longest replies; null if nobody knows the price.
    pub cost_usd_at_most: Option<f64>,
}

impl RequestForecast {
    /// The forecast for the remaining episodes, from the journals of the finished ones.
    pub fn of(
        vlm: &Vlm,
        finished: &[String],
        todo: &[Remaining<'_>],
        view: [u32; 2],
        (in_flight, per_minute): (usize, Option<u32>),
    ) -> Result<Self, Box<dyn std::error::Error + Send + Sync>> {
        let typical = vlm.typical(finished.iter().map(String::as_str))?;
        let mut forecast = Self::default();
        for Remaining { stem, experiment, steps } in todo {
            let answered = vlm.answered(stem)?;
            let left = steps.saturating_sub(answered);
            forecast.answered += answered;
            forecast.at_most += left;
            forecast.prompt_tokens += left * estimate::prompt_tokens(vlm.choice(), experiment, view)?;
            forecast.typical_requests +=
                typical.map_or(left, |typical| left.min(rounded(typical.steps).saturating_sub(answered)));
        }
        forecast.add_costs(vlm, typical);
        let each = typical.map_or(PRIOR_SECONDS, |typical| typical.seconds);
        let requests = float(forecast.typical_requests);
        let at_rate = per_minute.map_or(0.0, |count| 60.0 * requests / f64::from(count));
        forecast.seconds = at_rate.max(each * requests / float(in_flight.min(todo.len()).max(1) as u64));
        Ok(forecast)
    }

    fn add_costs(&mut self, vlm: &Vlm, typical: Option<Typical>) {
        let (prices, longest) = (vlm.choice().model.prices, u64::from(vlm.max_output_tokens()));
        let requests = self.typical_requests;
        let reply = typical.and_then(|typical| typical.completion_tokens).map_or(PRIOR_REPLY, rounded).min(longest);
        let by_prices = prices.cost_of(self.prompt_tokens * requests / self.at_most.max(1), requests * reply);
        let by_answers = typical.and_then(|typical| typical.cost_usd).map(|cost| cost * float(requests));
        self.finished_episodes = typical.map_or(0, |typical| typical.episodes);
        self.completion_tokens_at_most = self.at_most * longest;
        self.prompt_cost_usd = prices.cost_of_requests(self.prompt_tokens);
        self.typical_cost_usd = by_answers.or(by_prices);
        self.cost_usd_at_most = prices.cost_of(self.prompt_tokens, self.completion_tokens_at_most);
    }
}

#[expect(clippy::cast_precision_loss, reason = "nobody sends 2^53 requests")]
const fn float(count: u64) -> f64 {
    count as f64
}

/// A mean of small counts, or of seconds, as a whole number.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a mean of small counts")]
pub fn rounded(mean: f64) -> u64 {
    mean.round() as u64
}

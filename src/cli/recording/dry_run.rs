//! The answer of `record --dry-run`: the episodes to record, and their cost; nothing is recorded or sent.

use std::io;

use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::recording::dollars;
use crate::cli::vlm::VlmPlayer;
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::format::counted;
use mirrorstats_record::plan::{Key, Subject};
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_vlm::{Typical, Vlm, estimate};

/// The expected tokens of a reply without hidden reasoning, before any reply: the paper's keys with a sentence each.
const PRIOR_REPLY: u64 = 250;
/// The expected seconds for an answer, before any answer.
const PRIOR_SECONDS: f64 = 5.0;

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
    /// The requests to a provider; null for agents that send nothing.
    pub requests: Option<RequestForecast>,
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

impl ForecastAnswer {
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
            steps_at_most: todo.iter().map(|key| u64::from(config.for_experiment(&key.experiment).episode.steps)).sum(),
            requests,
        }
    }
}

impl RequestForecast {
    /// The forecast of a model's requests for the remaining episodes, from the finished ones.
    pub fn of(
        player: &VlmPlayer,
        subject: &Subject,
        (finished, todo): (&[Key], &[Key]),
        config: &WorldConfig,
        (in_flight, per_minute): (usize, Option<u32>),
    ) -> Result<Self, Box<dyn std::error::Error + Send + Sync>> {
        let vlm = &player.vlm;
        let view = [config.eye.width, config.eye.height_px];
        let finished: Vec<String> = finished.iter().map(|key| key.file_stem(subject)).collect();
        let typical = vlm.typical(finished.iter().map(String::as_str))?;
        let mut forecast = Self::default();
        for key in todo {
            let answered = vlm.answered(&key.file_stem(subject))?;
            let left = u64::from(config.for_experiment(&key.experiment).episode.steps).saturating_sub(answered);
            forecast.answered += answered;
            forecast.at_most += left;
            forecast.prompt_tokens += left * estimate::prompt_tokens(vlm.choice(), &key.experiment, view)?;
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

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a mean of small counts")]
fn rounded(mean: f64) -> u64 {
    mean.round() as u64
}

/// Prints the forecasts of several models, and their total.
pub(crate) fn write_all(out: &mut impl io::Write, answers: &[ForecastAnswer]) -> io::Result<()> {
    answers.iter().try_for_each(|answer| write_one(out, answer))?;
    let requests: Vec<_> = answers.iter().filter_map(|answer| answer.requests).collect();
    let episodes: usize = answers.iter().map(|answer| answer.episodes.len()).sum();
    let sent: u64 = requests.iter().map(|requests| requests.at_most).sum();
    let sum = |cost: fn(&RequestForecast) -> Option<f64>| dollars(requests.iter().filter_map(cost).sum());
    let unknown = requests.iter().filter(|requests| requests.cost_usd_at_most.is_none()).count();
    let (typical, most) = (sum(|requests| requests.typical_cost_usd), sum(|requests| requests.cost_usd_at_most));
    write!(out, "together: {}, at most {}; ", counted(episodes as u64, "episode"), counted(sent, "request"))?;
    write!(out, "about {typical}, at most {most}")?;
    match unknown {
        0 => {}
        models => write!(out, " and what {} without prices cost", counted(models as u64, "model"))?,
    }
    writeln!(out, "; about {}, one model after the other", time(requests.iter().map(|requests| requests.seconds).sum()))
}

pub(crate) fn write_one(out: &mut impl io::Write, answer: &ForecastAnswer) -> io::Result<()> {
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
    let basis = match requests.finished_episodes {
        0 => format!("as a prior: all steps, replies of {PRIOR_REPLY} tokens, {PRIOR_SECONDS} s for an answer"),
        episodes => format!("as in {}", counted(episodes, "finished episode")),
    };
    let (count, time) = (counted(requests.typical_requests, "request"), time(requests.seconds));
    writeln!(out, "typical: {count}, about {time}, {basis}")?;
    let cost = match (requests.prompt_cost_usd, requests.typical_cost_usd, requests.cost_usd_at_most) {
        (_, Some(typical), Some(most)) => {
            format!("typical {}, at most {} with the longest replies", dollars(typical), dollars(most))
        }
        (_, Some(typical), None) => {
            let why = "the model has no prices; --models FILE gives them";
            format!("typical {}, at most unknown: {why}", dollars(typical))
        }
        (Some(prompt), None, _) => {
            let why = "the model has no output price; --models FILE gives it";
            format!("about {} for the requests, unknown for the replies: {why}", dollars(prompt))
        }
        _ => "unknown, the model has no price for requests; --models FILE gives prices".to_owned(),
    };
    writeln!(out, "cost: {cost}")
}

fn time(seconds: f64) -> String {
    match rounded(seconds) {
        seconds @ 0..120 => format!("{seconds} s"),
        seconds @ 120..7_200 => format!("{} min", seconds.div_ceil(60)),
        seconds => format!("{} h", seconds.div_ceil(3_600)),
    }
}

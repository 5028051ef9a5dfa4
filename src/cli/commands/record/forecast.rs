//! The answer of `record --dry-run`: the episodes to record, and their cost; nothing is recorded or sent.

use std::io;

use schemars::JsonSchema;
use serde::Serialize;

use super::answer::dollars;
use crate::cli::Failure;
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::format::counted;
use mirrorstats_record::plan::{Episodes, Key, Subject};
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_vlm::Vlm;
use mirrorstats_vlm::forecast::{PRIOR_REPLY, PRIOR_SECONDS, Remaining, RequestForecast, rounded};

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

impl ForecastAnswer {
    pub fn of(subject: &Subject, episodes: &Episodes, config: &WorldConfig, requests: Option<RequestForecast>) -> Self {
        let Episodes { planned, todo } = episodes;
        Self {
            model: subject.model.clone(),
            asked: planned.len(),
            found: planned.len() - todo.len(),
            episodes: todo.iter().map(|key| key.episode_id(subject)).collect(),
            steps_at_most: todo.iter().map(|key| steps_of(key, config)).sum(),
            requests,
        }
    }
}

/// The forecast of a model's requests; `limits` are those of requests at once and in a minute.
pub fn requests(
    vlm: &Vlm,
    subject: &Subject,
    episodes: &Episodes,
    config: &WorldConfig,
    limits: (usize, Option<u32>),
) -> Result<RequestForecast, Failure> {
    let finished: Vec<String> = episodes.found().iter().map(|key| key.file_stem(subject)).collect();
    let todo = episodes.todo.iter().map(|key| Remaining {
        stem: key.file_stem(subject),
        experiment: &key.experiment,
        steps: steps_of(key, config),
    });
    let view = [config.eye.width, config.eye.height_px];
    RequestForecast::of(vlm, &finished, &todo.collect::<Vec<_>>(), view, limits).map_err(Failure::input)
}

fn steps_of(key: &Key, config: &WorldConfig) -> u64 {
    u64::from(config.for_experiment(&key.experiment).episode.steps)
}

/// Prints the forecasts of several models, and their total.
pub(super) fn write_all(out: &mut impl io::Write, answers: &[ForecastAnswer]) -> io::Result<()> {
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

pub(super) fn write_one(out: &mut impl io::Write, answer: &ForecastAnswer) -> io::Result<()> {
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

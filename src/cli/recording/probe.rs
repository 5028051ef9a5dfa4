//! The answer of `record --probe` about a model.

use std::io;

use crate::cli::recording::dollars;
use mirrorstats_exact::escape::{visible, visible_lines};
use mirrorstats_exact::format::counted;
use mirrorstats_vlm::probe::{ProbeAnswer, ProbedParameter};
use mirrorstats_vlm::provider::rate_limit::RateLimit;

pub(crate) fn write(out: &mut impl io::Write, answer: &ProbeAnswer) -> io::Result<()> {
    let (model, id) = (visible(&answer.model), visible(&answer.id));
    let requests = counted(u64::from(answer.requests), "request");
    match &answer.fault {
        Some(fault) => writeln!(out, "{model} ({id}): no answer after {requests}: {}", visible_lines(fault))?,
        None => writeln!(out, "{model} ({id}): {} after {requests}", answered(answer))?,
    }
    for limit in &answer.rate_limits {
        let RateLimit { counts, remaining, limit, renewed } = limit;
        let of = limit.map_or_else(String::new, |limit| format!(" of {limit}"));
        let renewed = renewed.as_ref().map_or_else(String::new, |at| format!(", renewed: {}", visible(at)));
        writeln!(out, "  rate limit: {remaining}{of} {counts} left{renewed}")?;
    }
    let with_line = |parameter: &&ProbedParameter| parameter.line.is_some();
    if answer.parameters.iter().any(|parameter| with_line(&parameter)) {
        writeln!(out, "  the entry [model.\"{model}\"] of a file for --models needs the lines below")?;
    }
    answer.parameters.iter().try_for_each(|parameter| {
        let taken = match (parameter.taken, parameter.name.as_str()) {
            (Some(true), "contract") => schema(answer.enforces_schema).to_owned(),
            (Some(true), _) => "taken".to_owned(),
            (Some(false), _) => format!("refused: {}", parameter.line.as_deref().unwrap_or_default()),
            (None, _) => "unknown".to_owned(),
        };
        writeln!(out, "  {} = {}: {taken}", visible(&parameter.name), visible(&parameter.value.to_string()))
    })
}

fn answered(answer: &ProbeAnswer) -> String {
    let by = match (&answer.answered_by, answer.is_model) {
        (None, _) => "an answer that names no model".to_owned(),
        (Some(id), true) => format!("answered by `{}`", visible(id)),
        (Some(id), false) => format!("another model answers, `{0}`: --accept-model {0} records it,", visible(id)),
    };
    let count = |tokens: Option<u32>| tokens.map_or_else(|| "unknown".to_owned(), |count| count.to_string());
    let (prompt, completion) = (count(answer.prompt_tokens), count(answer.completion_tokens));
    let cost = answer.cost_usd.map_or_else(|| "an unknown cost".to_owned(), dollars);
    format!(
        "{by} in {} ms, for {cost}: tokens sent {prompt}, received {completion},",
        answer.latency_ms.unwrap_or_default()
    )
}

fn schema(is_enforced: Option<bool>) -> &'static str {
    match is_enforced {
        Some(true) => "taken and enforced",
        Some(false) => "taken, and not enforced: the prompt alone asks for the shape of replies",
        None => "taken; the answer does not show whether it is enforced",
    }
}

//! Properties of a model, determined by a request: parameters, schema, model behind the id, cost and time.
//!
//! A rejected request costs nothing. It is sent again without the rejected parameter, so one probe reports all of them,
//! and at most one answer is billed.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

use super::models::{Choice, Contract};
use super::provider::failure::Failure;
use super::provider::rate_limit::RateLimit;
use super::provider::{Mend, Provider, Received, Waiting, refused};
use mirrorstats_agents::prompt::Rendered;
use mirrorstats_agents::{Status, reply};
use mirrorstats_experiment::Spec;
use mirrorstats_trace::episodes::frame::Frame;

/// The answer of `record --probe --json`, for one model.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct ProbeAnswer {
    /// The model's name as shown in tables.
    pub model: String,
    /// The id that was asked for.
    pub id: String,
    /// The id of the model that answered; null without an answer, or if the answer names none.
    pub answered_by: Option<String>,
    /// False if a recording would stop at this answer, because another model gave it.
    pub is_model: bool,
    /// The parameters of the request besides the protocol.
    pub parameters: Vec<ProbedParameter>,
    /// Whether the provider enforced the schema against a prompt that asks for another reply; null if it was not asked to, or
    /// the answer does not show it.
    pub enforces_schema: Option<bool>,
    /// Tokens of the request; null if nobody counted them.
    pub prompt_tokens: Option<u32>,
    /// Tokens of the reply, hidden reasoning included; null if nobody counted them.
    pub completion_tokens: Option<u32>,
    /// US dollars for the answer; null if nobody knows the price.
    pub cost_usd: Option<f64>,
    /// From sending the answered request to the whole answer, ms; null without an answer.
    pub latency_ms: Option<u64>,
    /// The limits of the account that the answer's headers state; none if the provider states them elsewhere.
    pub rate_limits: Vec<RateLimit>,
    /// Requests that went out.
    pub requests: u32,
    /// The reason why there is no answer, and what to do; null if there is one.
    pub fault: Option<String>,
}

/// A parameter of a probe.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ProbedParameter {
    /// Its key in a file for --models.
    pub name: String,
    /// The sent value.
    pub value: Value,
    /// True if the provider takes it; null without an answer.
    pub taken: Option<bool>,
    /// The line of a file for --models that mends it; null unless it was refused.
    pub line: Option<String>,
}

impl ProbeAnswer {
    pub fn is_good(&self) -> bool {
        self.fault.is_none() && self.is_model && self.parameters.iter().all(|parameter| parameter.taken == Some(true))
    }

    fn new(choice: &Choice) -> Self {
        let model = &choice.model;
        let sent = [
            ("temperature", model.temperature.map(Value::from)),
            ("max_output_tokens", Some(model.max_output_tokens().into())),
            ("reasoning_effort", model.reasoning_effort.map(|effort| effort.name().into())),
            ("contract", (model.contract == Contract::Schema).then(|| "schema".into())),
        ];
        let own = sent.into_iter().filter_map(|(name, value)| Some((name.to_owned(), value?)));
        let extra = choice.extra_body().into_iter().map(|(key, value)| (format!("extra_body.{key}"), value));
        let parameters =
            own.chain(extra).map(|(name, value)| ProbedParameter { name, value, taken: None, line: None }).collect();
        Self { model: choice.name.clone(), id: model.id.clone(), is_model: true, parameters, ..Self::default() }
    }

    fn note_answer(&mut self, received: Received, choice: &Choice, experiment: &Spec) {
        let Received { answer, latency, rate_limits, .. } = received;
        for parameter in &mut self.parameters {
            parameter.taken.get_or_insert(true);
        }
        self.enforces_schema = match reply::read(&answer.text, experiment, answer.ending).status {
            _ if choice.model.contract == Contract::Prompt => None,
            Status::Ok | Status::Repaired => Some(true),
            Status::ParseFailed | Status::SchemaInvalid => Some(false),
            _ => None,
        };
        self.is_model = answer.model.as_deref().is_none_or(|returned| choice.model.takes_answer_of(returned));
        (self.prompt_tokens, self.completion_tokens) = (answer.prompt_tokens, answer.completion_tokens);
        self.cost_usd = choice.cost_usd(&answer);
        self.latency_ms = u64::try_from(latency.as_millis()).ok();
        (self.answered_by, self.rate_limits) = (answer.model, rate_limits);
    }

    fn note_refused(&mut self, mend: &Mend) {
        let refused = |parameter: &&mut ProbedParameter| parameter.name == mend.key;
        if let Some(parameter) = self.parameters.iter_mut().find(refused) {
            (parameter.taken, parameter.line) = (Some(false), Some(mend.line.to_owned()));
        }
    }
}

pub async fn probe(mut choice: Choice, provider: &Provider, experiment: &Spec, view: [u32; 2]) -> ProbeAnswer {
    let schema = reply::structure(experiment);
    let words = Rendered {
        system: "You test a connection.".to_owned(),
        user: "The image is a test. Reply with the single word ready, and with no JSON.".to_owned(),
    };
    let mut probed = ProbeAnswer::new(&choice);
    if let Err(fault) = provider.connect() {
        return ProbeAnswer { fault: Some(fault.to_string()), ..probed };
    }
    let png = match grey(view) {
        Ok(png) => png,
        Err(fault) => return ProbeAnswer { fault: Some(format!("the frame cannot be encoded: {fault}")), ..probed },
    };
    let mut waiting = Waiting::new(provider.patience());
    loop {
        probed.requests += 1;
        let turn = provider.turn().await;
        let failure = match provider.ask(turn, &choice.body(&words, &schema, &png)).await {
            Ok(received) => {
                probed.note_answer(received, &choice, experiment);
                return probed;
            }
            Err(failure) => failure,
        };
        let wait = failure.kind.may_pass().then(|| waiting.next(&failure)).flatten();
        if let Some(wait) = wait {
            tokio::time::sleep(wait).await;
        } else if let Some(mend) = left_out(&failure, &mut choice) {
            probed.note_refused(mend);
        } else {
            probed.fault = Some(failure.explained(&choice.name));
            return probed;
        }
    }
}

fn left_out(failure: &Failure, choice: &mut Choice) -> Option<&'static Mend> {
    let mend = refused(&failure.detail).filter(|_| !failure.kind.may_pass())?;
    let before = choice.clone();
    (mend.leave_out)(&mut choice.model);
    (before != *choice).then_some(mend)
}

fn grey([width, height]: [u32; 2]) -> Result<String, Box<dyn std::error::Error>> {
    let [width, height] = [usize::try_from(width)?, usize::try_from(height)?];
    let frame = Frame::new(width, height, vec![128; 3 * width * height]);
    Ok(STANDARD.encode(frame.to_png()?))
}

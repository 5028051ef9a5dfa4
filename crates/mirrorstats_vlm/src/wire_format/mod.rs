//! The wire formats of providers: requests as JSON, and the content of answers.
//!
//! Rule: pure. A wire format knows the shape of bodies and the names of headers; it sends nothing and holds no key. Bodies
//! contain exactly what the provider's own client library sends for the same call. The frame follows the words of the
//! user prompt, in the order in which the paper lists the inputs of a step.

mod anthropic;
mod gemini;
mod openai;
mod refusal;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::models::Model;
use mirrorstats_agents::prompt::Rendered;
use mirrorstats_agents::reply::{Ending, Repair, has_object, without_lone_surrogates};
use mirrorstats_exact::names;

/// The shape of requests and answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum WireFormat {
    /// `OpenAI`'s chat completions.
    OpenaiChat,
    /// The same as other servers take it: with the older name of the limit of tokens.
    OpenaiCompatible,
    /// Google's `generateContent`.
    Gemini,
    /// Anthropic's Messages.
    AnthropicMessages,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Question<'a> {
    pub model: &'a Model,
    /// The temperature to send, if any.
    pub temperature: Option<f64>,
    pub words: &'a Rendered,
    /// The frame as PNG in base64.
    pub png: &'a str,
    /// The JSON Schema for the provider to enforce; `None` if only the prompt describes it.
    pub schema: Option<&'a Value>,
}

/// The effort of a model's reasoning before it replies. Not every model takes every effort.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Effort {
    /// Not at all.
    None,
    /// As little as it can.
    Minimal,
    /// Little.
    Low,
    /// Some.
    Medium,
    /// Much.
    High,
    /// More than that.
    Xhigh,
    /// As much as it can.
    Max,
}

names!(Effort {
    None: "none",
    Minimal: "minimal",
    Low: "low",
    Medium: "medium",
    High: "high",
    Xhigh: "xhigh",
    Max: "max"
});

#[derive(Clone, Debug, Default, PartialEq)]
pub struct ModelAnswer {
    /// The text of the reply; empty if there is none.
    pub text: String,
    /// True if the only text is the model's reasoning.
    pub is_reasoning_alone: bool,
    /// Repairs of the text's container: a lone surrogate in the body, for which the text has U+FFFD; a function call or
    /// an object in place of a text, whose JSON is the text.
    pub repairs: Vec<Repair>,
    pub ending: Ending,
    /// Tokens of the request, including cached ones, if counted.
    pub prompt_tokens: Option<u32>,
    /// Cached tokens of the request, if counted.
    pub cached_tokens: Option<u32>,
    /// Tokens of the reply, including hidden reasoning, if counted.
    pub completion_tokens: Option<u32>,
    pub cost_usd: Option<f64>,
    pub model: Option<String>,
}

impl WireFormat {
    /// The path of a request, after the base address.
    pub fn path(self, model: &str) -> String {
        match self {
            Self::OpenaiChat | Self::OpenaiCompatible => "chat/completions".to_owned(),
            Self::Gemini => format!("models/{model}:generateContent"),
            Self::AnthropicMessages => "messages".to_owned(),
        }
    }

    /// The name of the header with the key, and the prefix of its value.
    pub(crate) const fn key_header(self) -> (&'static str, &'static str) {
        match self {
            Self::OpenaiChat | Self::OpenaiCompatible => ("authorization", "Bearer "),
            Self::Gemini => ("x-goog-api-key", ""),
            Self::AnthropicMessages => ("x-api-key", ""),
        }
    }

    /// The service tier's key, for `flex` at half price: <https://platform.openai.com/docs/guides/flex-processing>,
    /// <https://ai.google.dev/gemini-api/docs/flex-inference>.
    pub(crate) const fn tier_key(self) -> Option<&'static str> {
        match self {
            Self::OpenaiChat => Some("service_tier"),
            Self::Gemini => Some("serviceTier"),
            Self::OpenaiCompatible | Self::AnthropicMessages => None,
        }
    }

    pub const fn headers(self) -> &'static [(&'static str, &'static str)] {
        match self {
            Self::OpenaiChat | Self::OpenaiCompatible | Self::Gemini => &[],
            // The next version, 2026-10-21, rejects a temperature, which the study needs.
            Self::AnthropicMessages => &[("anthropic-version", "2023-06-01")],
        }
    }

    pub(crate) fn body(self, question: &Question<'_>) -> Value {
        match self {
            Self::OpenaiChat => openai::body(question, "max_completion_tokens"),
            Self::OpenaiCompatible => openai::body(question, "max_tokens"),
            Self::Gemini => gemini::body(question),
            Self::AnthropicMessages => anthropic::body(question),
        }
    }

    /// The content of a body's text; lone surrogates are replaced, since strict JSON rejects them. `None` if it has
    /// another format.
    pub fn read(self, body: &str) -> serde_json::Result<Option<ModelAnswer>> {
        let fault = match serde_json::from_str(body) {
            Ok(value) => return Ok(self.answer(&value)),
            Err(fault) => fault,
        };
        let value = without_lone_surrogates(body).and_then(|body| serde_json::from_str(&body).ok()).ok_or(fault)?;
        Ok(self.answer(&value).map(|mut answer| {
            if answer.text.contains('\u{fffd}') {
                answer.repairs.push(Repair::Surrogate);
            }
            answer
        }))
    }

    /// The answer in an error's body: a refusal, or a reply that the provider could not validate.
    pub(crate) fn declined(self, body: &str) -> Option<ModelAnswer> {
        let answer = self.read(body).ok()??;
        let is_reply = || serde_json::from_str(body).is_ok_and(|body| refusal::answer(&body).is_some());
        (answer.ending == Ending::Refused || is_reply()).then_some(answer)
    }

    /// The content of an answer's body; `None` if it has another format. An error that refuses the request's content is
    /// an answer, too, and so is one with the model's text.
    pub fn answer(self, body: &Value) -> Option<ModelAnswer> {
        let answer = match self {
            Self::OpenaiChat | Self::OpenaiCompatible => openai::answer(body),
            Self::Gemini => gemini::answer(body),
            Self::AnthropicMessages => anthropic::answer(body),
        };
        let answer = answer.or_else(|| refusal::answer(body));
        answer.map(|answer| ModelAnswer { is_reasoning_alone: answer.text.is_empty() && has_reasoning(body), ..answer })
    }
}

/// Returns true if a body of any wire format has reasoning.
fn has_reasoning(body: &Value) -> bool {
    let message = &body["choices"][0]["message"];
    let parts = [&message["content"], &body["content"], &body["candidates"][0]["content"]["parts"]];
    let is_kind = |kind: &str| kind.contains("thinking") || kind.starts_with("reasoning");
    let is_thought = |part: &Value| part.get("thought").is_some() || part["type"].as_str().is_some_and(is_kind);
    let has_text = |key| message[key].as_str().is_some_and(|text| !text.trim().is_empty());
    ["reasoning_content", "reasoning"].into_iter().any(has_text)
        || parts.into_iter().filter_map(Value::as_array).flatten().any(is_thought)
}

/// The error in a body; some providers put it into a list.
pub(crate) fn error_of(body: &Value) -> Option<&Value> {
    body.get("error").or_else(|| body.get(0)?.get("error"))
}

/// A text, or the arguments of the only call of a function: an object, or its JSON as a string. The text beside a call
/// precedes its arguments, unless it has an object of its own.
fn text_or_call<'a>(text: String, arguments: impl Iterator<Item = &'a Value>) -> (String, Vec<Repair>) {
    let calls: Vec<_> = arguments.filter(|arguments| !arguments.is_null()).collect();
    let [arguments] = calls[..] else { return (text, Vec::new()) };
    let arguments = arguments.as_str().map_or_else(|| arguments.to_string(), str::to_owned);
    match text.trim() {
        "" => (arguments, vec![Repair::ToolCall]),
        beside if has_object(beside) => (text, Vec::new()),
        beside => (format!("{beside}\n{arguments}"), vec![Repair::ToolCall]),
    }
}

/// A count, which some servers write as `100.0`.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a whole number below 2^32")]
fn tokens(value: &Value) -> Option<u32> {
    let count = value.as_f64().filter(|count| count.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(count));
    count.map(|count| count as u32)
}

fn text(value: &Value) -> Option<String> {
    value.as_str().map(str::to_owned)
}

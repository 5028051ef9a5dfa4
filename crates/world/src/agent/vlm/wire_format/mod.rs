//! The languages that providers speak: a request as JSON, and what their answer says.
//!
//! Rule: pure. A dialect knows the shape of bodies and the names of headers; it sends nothing and holds no key.
//! A body has what the provider's own client library sends for the same call, and nothing else. In all of them the frame
//! comes before the words of the user prompt: the paper's prompt names it first, and Anthropic and Google advise it.

mod anthropic;
mod gemini;
mod openai;
mod refusal;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::agent::reply::{Ending, Repair, without_lone_surrogates};
use exact::names;

/// A language.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Dialect {
    /// `OpenAI`'s chat completions.
    OpenaiChat,
    /// The same as other servers take it: with the older name of the limit of tokens.
    OpenaiCompatible,
    /// Google's `generateContent`.
    Gemini,
    /// Anthropic's Messages.
    AnthropicMessages,
}

/// The content of one request.
#[derive(Clone, Copy, Debug)]
pub struct Question<'a> {
    /// The provider's id of the model.
    pub model: &'a str,
    pub system: &'a str,
    pub user: &'a str,
    /// The frame as PNG in base64.
    pub png_base64: &'a str,
    /// The JSON Schema that the provider is asked to enforce; `None` if the prompt alone has to do.
    pub schema: Option<&'a Value>,
    /// The sampling temperature (0.2 in the paper); `None` leaves it to the provider.
    pub temperature: Option<f64>,
    /// The most tokens that a reply may have, those of hidden reasoning included.
    pub max_output_tokens: u32,
    /// The requested reasoning effort; `None` leaves it to the provider.
    pub reasoning_effort: Option<Effort>,
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

/// The content of an answer.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// The text of the reply; empty without one.
    pub text: String,
    /// Repairs of what carried the text: a lone surrogate in the body, for which the text has U+FFFD; a call of a function,
    /// whose arguments are the text.
    pub repairs: Vec<Repair>,
    pub ending: Ending,
    /// Tokens of the request, where counted; those from the provider's cache included.
    pub prompt_tokens: Option<u32>,
    /// Those of them that came from the provider's cache, where counted.
    pub cached_tokens: Option<u32>,
    /// Tokens of the reply, where counted; those of hidden reasoning included.
    pub completion_tokens: Option<u32>,
    /// The cost in US dollars, if the provider says it.
    pub cost_usd: Option<f64>,
    /// The model that answered, as the provider names it.
    pub model: Option<String>,
}

impl Dialect {
    /// The path of a request, after the base address.
    pub fn path(self, model: &str) -> String {
        match self {
            Self::OpenaiChat | Self::OpenaiCompatible => "chat/completions".to_owned(),
            Self::Gemini => format!("models/{model}:generateContent"),
            Self::AnthropicMessages => "messages".to_owned(),
        }
    }

    /// The header that carries the key, and what stands before the key in it.
    pub const fn key_header(self) -> (&'static str, &'static str) {
        match self {
            Self::OpenaiChat | Self::OpenaiCompatible => ("authorization", "Bearer "),
            Self::Gemini => ("x-goog-api-key", ""),
            Self::AnthropicMessages => ("x-api-key", ""),
        }
    }

    /// The key of the service tier, of providers that have `flex` at half price: <https://platform.openai.com/docs/guides/flex-processing>,
    /// <https://ai.google.dev/gemini-api/docs/flex-inference>.
    pub const fn tier_key(self) -> Option<&'static str> {
        match self {
            Self::OpenaiChat => Some("service_tier"),
            Self::Gemini => Some("serviceTier"),
            Self::OpenaiCompatible | Self::AnthropicMessages => None,
        }
    }

    /// The other headers that the language asks for.
    pub const fn headers(self) -> &'static [(&'static str, &'static str)] {
        match self {
            Self::OpenaiChat | Self::OpenaiCompatible | Self::Gemini => &[],
            // The next version, 2026-10-21, refuses a temperature, and the study has one.
            Self::AnthropicMessages => &[("anthropic-version", "2023-06-01")],
        }
    }

    /// The body of a request.
    pub fn body(self, question: &Question<'_>) -> Value {
        match self {
            Self::OpenaiChat => openai::body(question, "max_completion_tokens"),
            Self::OpenaiCompatible => openai::body(question, "max_tokens"),
            Self::Gemini => gemini::body(question),
            Self::AnthropicMessages => anthropic::body(question),
        }
    }

    /// What the text of a body says; lone surrogates in it are replaced, which strict JSON does not have. `None` if it is
    /// not of this language.
    pub fn read(self, body: &str) -> serde_json::Result<Option<Answer>> {
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

    /// What the body of an answer says; `None` if it is not of this language. An error that refuses what the request is
    /// about is an answer, too.
    pub fn answer(self, body: &Value) -> Option<Answer> {
        let answer = match self {
            Self::OpenaiChat | Self::OpenaiCompatible => openai::answer(body),
            Self::Gemini => gemini::answer(body),
            Self::AnthropicMessages => anthropic::answer(body),
        };
        answer.or_else(|| refusal::answer(body))
    }
}

fn text_or_call(text: String, calls: &[String]) -> (String, Vec<Repair>) {
    match calls {
        [arguments] if text.trim().is_empty() => (arguments.clone(), vec![Repair::ToolCall]),
        _ => (text, Vec::new()),
    }
}

fn tokens(value: &Value) -> Option<u32> {
    value.as_u64().and_then(|count| u32::try_from(count).ok())
}

fn text(value: &Value) -> Option<String> {
    value.as_str().map(str::to_owned)
}

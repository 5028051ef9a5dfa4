//! Failures: their kinds, and the mapping from statuses and connection errors.

use std::time::Duration;

use reqwest::StatusCode;
use serde_json::{Value, json};

use super::parameter;
use crate::wire_format::{WireFormat, error_of};
use mirrorstats_agents::Status;

const SEES: &str = "\n  help: choose a model that sees; a server of one's own may have to be started with the model's part \
                    for images (llama.cpp: --mmproj FILE)";

const TOMORROW: &str = "\n  help: the same command continues when the quota is renewed, or with a higher one; what was \
                        answered is not asked again";

const ADDRESS: &str = "\n  help: check `--base-url` and the backend's `wire_format`, and that nothing asks for a stream; the request may have \
                       been paid";

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    pub kind: FailureKind,
    pub detail: String,
    pub after: Option<Duration>,
    /// The provider may have made an answer, and may bill it.
    pub may_be_paid: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FailureKind {
    RateLimited,
    DailyQuota,
    /// The provider is overloaded and will take the request later.
    Overloaded,
    /// The provider failed, the connection broke, or the response is not an answer.
    Server,
    Timeout,
    /// The provider rejects this request permanently; it may take others.
    Rejected,
    /// The provider takes no request with this key, from this account, or for this model.
    Denied,
    /// The answer has a shape that a repeated request would not change, such as a page or a stream.
    OtherShape,
    /// The model or its server takes no images, but every request has one.
    NoImages,
}

impl FailureKind {
    pub const fn status(self) -> Status {
        match self {
            Self::RateLimited | Self::DailyQuota => Status::RateLimited,
            Self::Timeout => Status::Timeout,
            _ => Status::ServerError,
        }
    }

    /// Returns true if a repeated request may succeed. Once the model has answered, another shape is a gateway's outage.
    pub(crate) const fn may_pass(self, has_answered: bool) -> bool {
        self.is_busy()
            || matches!(self, Self::Server | Self::Timeout)
            || has_answered && matches!(self, Self::OtherShape)
    }

    /// Returns true if the provider only postpones the request.
    pub(crate) const fn is_busy(self) -> bool {
        matches!(self, Self::RateLimited | Self::Overloaded)
    }
}

impl Failure {
    pub(crate) fn explained(&self, model: &str) -> String {
        let Self { kind, detail, .. } = self;
        match kind {
            FailureKind::NoImages => format!("the model, or the server that runs it, takes no images: {detail}{SEES}"),
            FailureKind::OtherShape => format!("{detail}{ADDRESS}"),
            FailureKind::DailyQuota => format!("the provider's quota of the day is used up: {detail}{TOMORROW}"),
            kind if kind.may_pass(false) => format!("the provider gave no answer: {}: {detail}", kind.status().name()),
            _ => format!("the provider refuses the request: {detail}{}", parameter::help(detail, model)),
        }
    }
}

pub(crate) fn server(detail: String) -> Failure {
    Failure { kind: FailureKind::Server, detail, after: None, may_be_paid: true }
}

pub(crate) fn shortened(text: &str) -> String {
    const LONGEST: usize = 300;
    let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    match line.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}...", &line[..end]),
        None => line,
    }
}

/// A failure below HTTP. The address is left out, since it may be private.
pub(crate) fn broken(error: reqwest::Error) -> Failure {
    let kind = if error.is_timeout() { FailureKind::Timeout } else { FailureKind::Server };
    let may_be_paid = !error.is_connect();
    let error = error.without_url();
    let mut detail = error.to_string();
    let mut cause = std::error::Error::source(&error);
    while let Some(inner) = cause {
        let words = inner.to_string();
        if !detail.contains(&words) {
            detail = format!("{detail}: {words}");
        }
        cause = inner.source();
    }
    Failure { kind, detail, after: None, may_be_paid }
}

pub(crate) fn failed(status: StatusCode, after: Option<Duration>, body: &str) -> Failure {
    let kind = match status {
        // Regardless of the status: llama.cpp reports it as a server error, others as a bad request.
        _ if takes_no_images(body) => FailureKind::NoImages,
        StatusCode::TOO_MANY_REQUESTS if is_out_of_credit(body) => FailureKind::Denied,
        StatusCode::TOO_MANY_REQUESTS if is_of_a_day(body) => FailureKind::DailyQuota,
        StatusCode::TOO_MANY_REQUESTS => FailureKind::RateLimited,
        _ if is_overloaded(status, body) => FailureKind::Overloaded,
        StatusCode::REQUEST_TIMEOUT | StatusCode::GATEWAY_TIMEOUT => FailureKind::Timeout,
        status if status.is_server_error() => FailureKind::Server,
        StatusCode::CONFLICT | StatusCode::TOO_EARLY => FailureKind::Server,
        StatusCode::UNAUTHORIZED | StatusCode::PAYMENT_REQUIRED | StatusCode::FORBIDDEN | StatusCode::NOT_FOUND => {
            FailureKind::Denied
        }
        _ => FailureKind::Rejected,
    };
    let detail = match shortened(body) {
        said if said.is_empty() => format!("HTTP {status}"),
        said => format!("HTTP {status}: {said}"),
    };
    // A gateway that timed out does not know what the model behind it did.
    Failure { kind, detail, after, may_be_paid: kind == FailureKind::Timeout }
}

/// The failure of a body with status 200 that is no answer; `fault` says why.
pub(crate) fn no_answer(wire_format: WireFormat, body: &str, fault: &str) -> Failure {
    let (kind, found) = match other_shape(body) {
        _ if takes_no_images(body) => (FailureKind::NoImages, fault),
        Some(shape) => (FailureKind::OtherShape, shape),
        None => (FailureKind::Server, fault),
    };
    let detail =
        format!("expected an answer of the wire format {}, found {found}: {}", json!(wire_format), shortened(body));
    // Routers report with status 200 that no model answered.
    let is_error = serde_json::from_str::<Value>(body).is_ok_and(|body| error_of(&body).is_some());
    Failure { kind, detail, after: None, may_be_paid: !is_error }
}

/// The shape of a body that a repeated request would not change; `None` if it is unknown.
fn other_shape(body: &str) -> Option<&'static str> {
    let text = body.trim_start_matches('\u{feff}').trim_start();
    match serde_json::from_str::<Value>(text) {
        Ok(body) => body["output"].is_array().then_some("an answer of OpenAI's Responses"),
        Err(_) if text.starts_with('<') => Some("a page of HTML or XML"),
        Err(_) if text.starts_with("data:") || text.starts_with("event:") => Some("a stream of events"),
        Err(_) => None,
    }
}

/// Phrases by which servers reject images, lower case.
const NO_IMAGES: [&str; 16] = [
    // llama.cpp: "image input is not supported - hint: if this is unexpected, you may need to provide the mmproj".
    "image input is not supported",
    "you may need to provide the mmproj",
    "unsupported content part type: \"image_url\"",
    // LM Studio, LiteLLM and others.
    "does not support image",
    "doesn't support image",
    "do not support image",
    "images are not supported",
    "image inputs are not supported",
    "does not support vision",
    "vision is not supported",
    "does not support multimodal",
    // vLLM: "... is not a multimodal model".
    "is not a multimodal model",
    // Ollama: "this model is missing data required for image input".
    "missing data required for image input",
    // OpenRouter: "No endpoints found that support image input".
    "no endpoints found that support image input",
    // OpenAI: "Invalid content type. image_url is only supported by certain models.".
    "image_url is only supported by certain models",
    // Servers with text input only: "unknown variant `image_url`, expected `text`".
    "unknown variant `image_url`",
];

fn takes_no_images(body: &str) -> bool {
    // The phrase may be quoted in another server's error.
    let said = body.replace('\\', "").to_lowercase();
    NO_IMAGES.iter().any(|words| said.contains(words))
}

/// Returns true if too many requests means that the account has no credit left; waiting does not help.
fn is_out_of_credit(body: &str) -> bool {
    const CODE: &str = "insufficient_quota";
    let body = serde_json::from_str::<Value>(body).unwrap_or_default();
    error_of(&body).is_some_and(|error| error["code"] == CODE || error["type"] == CODE)
}

/// Returns true if the server is up but overloaded. Anthropic uses status 529; Gemini says it with 503 ("The model is
/// overloaded. Please try again later."), as does `OpenAI` ("The engine is currently overloaded").
fn is_overloaded(status: StatusCode, body: &str) -> bool {
    let says_so = || body.to_lowercase().contains("overloaded");
    status.as_u16() == 529 || status == StatusCode::SERVICE_UNAVAILABLE && says_so()
}

/// Returns true for a daily limit. Gemini names the quota (`GenerateRequestsPerDayPerProjectPerModel`), OpenAI and
/// OpenRouter say it ("requests per day (RPD)", "free-models-per-day").
fn is_of_a_day(body: &str) -> bool {
    ["PerDay", "per day", "per-day"].iter().any(|words| body.contains(words))
}

#[cfg(test)]
mod tests {
    use reqwest::StatusCode;

    use super::{FailureKind, failed, other_shape};
    use crate::wire_format::WireFormat;

    fn no_answer(body: &str) -> super::Failure {
        super::no_answer(WireFormat::OpenaiChat, body, "other JSON")
    }

    #[test]
    fn an_exhausted_quota_is_not_a_rate_limit() {
        let kind = |body| failed(StatusCode::TOO_MANY_REQUESTS, None, body).kind;
        assert_eq!(kind(r#"{"error": {"code": "insufficient_quota"}}"#), FailureKind::Denied);
        assert_eq!(kind(r#"{"error": {"code": "rate_limit_exceeded"}}"#), FailureKind::RateLimited);
        assert_eq!(kind(r#"[{"error": {"code": "insufficient_quota"}}]"#), FailureKind::Denied);
        for other in ["slow down", "\"slow down\"", "429", "null", "true", "[]", "{}", r#"[{"error": {"code": 429}}]"#]
        {
            assert_eq!(kind(other), FailureKind::RateLimited, "{other}");
        }
    }

    #[test]
    fn an_overloaded_provider_is_not_a_broken_one() {
        let kind = |status: u16, body| failed(StatusCode::from_u16(status).unwrap(), None, body).kind;
        assert_eq!(kind(529, r#"{"type":"error","error":{"type":"overloaded_error"}}"#), FailureKind::Overloaded);
        let google = r#"{"error":{"code":503,"message":"The model is overloaded. Please try again later.","status":"UNAVAILABLE"}}"#;
        assert_eq!(kind(503, google), FailureKind::Overloaded);
        assert_eq!(kind(503, "<html>Service Unavailable</html>"), FailureKind::Server);
    }

    #[test]
    fn a_server_that_takes_no_images_is_known_by_its_words() {
        let kind = |status, body: &str| failed(status, None, body).kind;
        for body in [
            r#"{"error":{"code":500,"message":"image input is not supported - hint: if this is unexpected, you may need to provide the mmproj","type":"server_error"}}"#,
            r#"{"error":{"message":"Failed to parse messages: Unsupported content part type: \"image_url\"; messages = []"}}"#,
            r#"{"error":"this model is missing data required for image input"}"#,
            r#"{"error":"Model does not support images. Please use a model that does."}"#,
            r#"{"error":{"message":"text-1 is not a multimodal model"}}"#,
        ] {
            for status in [StatusCode::INTERNAL_SERVER_ERROR, StatusCode::BAD_REQUEST, StatusCode::NOT_FOUND] {
                assert_eq!(kind(status, body), FailureKind::NoImages, "{status} {body}");
            }
            assert_eq!(no_answer(body).kind, FailureKind::NoImages, "{body}");
            assert!(!no_answer(body).may_be_paid && no_answer("{}").may_be_paid, "{body}");
        }
        let other = r#"{"error":{"message":"the image of this request cannot be decoded"}}"#;
        assert_eq!(kind(StatusCode::INTERNAL_SERVER_ERROR, other), FailureKind::Server);
        assert_eq!(kind(StatusCode::BAD_REQUEST, other), FailureKind::Rejected);
        assert!(!FailureKind::NoImages.may_pass(true));
    }

    #[test]
    fn other_shapes_are_named() {
        for (body, expected) in [
            ("data: {\"choices\": []}\n\ndata: [DONE]\n\n", Some("a stream of events")),
            ("event: message_start\ndata: {}\n\n", Some("a stream of events")),
            ("<!doctype html><html></html>", Some("a page of HTML or XML")),
            (r#"{"object": "response", "output": []}"#, Some("an answer of OpenAI's Responses")),
            (r#"{"choices": null}"#, None),
            (r#"{"error": {"code": 502}}"#, None),
            ("half an ans", None),
            ("", None),
        ] {
            assert_eq!(other_shape(body), expected, "{body}");
        }
    }
}

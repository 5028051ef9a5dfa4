//! The end of an answer, and errors that are answers: refusals of content, and replies that a provider rejected.
//!
//! Providers report it with HTTP 400 or 200, under various names. It counts as an answer like any other refusal: the
//! request was well-formed, and repeating it would give the same result.

use serde_json::Value;

use super::{ModelAnswer, error_of, text};
use mirrorstats_agents::reply::Ending;

/// The names of refusals, as errors and as reasons of an answer's end, in the spelling of [`normal`].
const REFUSALS: [&str; 24] = [
    // OpenAI, Azure, Bedrock, and compatible servers.
    "contentfilter",
    "contentfiltered",
    "contentpolicy",
    "contentpolicyviolation",
    "imagecontentpolicyviolation",
    "moderationblocked",
    "responsibleaipolicyviolation",
    "guardrailintervened",
    "moderation",
    // Anthropic, and routers that pass on its refusals.
    "refusal",
    "refused",
    // Google.
    "safety",
    "recitation",
    "blocklist",
    "prohibitedcontent",
    "spii",
    "imagesafety",
    "imageprohibitedcontent",
    "imagerecitation",
    "modelarmor",
    // Alibaba, Zhipu.
    "datainspectionfailed",
    "sensitive",
    // Cohere.
    "errortoxic",
    "toxic",
];

/// The reasons of an answer's end at a limit of tokens.
const LIMITS: [&str; 9] = [
    "length",
    "maxlength",
    "modellength",
    "maxtokens",
    "maxoutputtokens",
    "maxcompletiontokens",
    "maxnewtokens",
    "tokenlimit",
    "modelcontextwindowexceeded",
];

/// The end of an answer by its reason. Routers pass on the words of other providers, so all wire formats share them.
pub(super) fn ending(reason: &Value) -> Ending {
    let reason = normal(reason.as_str().unwrap_or_default());
    match reason.trim_start_matches("finishreason") {
        reason if REFUSALS.contains(&reason) => Ending::Refused,
        reason if LIMITS.contains(&reason) => Ending::Truncated,
        _ => Ending::Whole,
    }
}

/// A name without letter case and separators: `MAX_TOKENS`, `max-tokens` and `maxTokens` are one.
fn normal(name: &str) -> String {
    name.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_lowercase()).collect()
}

/// Phrases for errors whose name is that of any invalid request, lower case.
const WORDS: [&str; 6] = [
    // Anthropic: "Output blocked by content filtering policy".
    "content filtering policy",
    // Azure: "... triggering Azure OpenAI's content management policy".
    "content management policy",
    // OpenAI: "Invalid prompt: your prompt was flagged as potentially violating our usage policy".
    "flagged as potentially violating",
    // Google: "... violate Google's Responsible AI practices".
    "responsible ai practices",
    "prohibited_content",
    // LiteLLM.
    "contentpolicyviolation",
];

/// The refusal in an error's body, or the model's text that the provider could not validate; `None` for any other body.
pub(super) fn answer(body: &Value) -> Option<ModelAnswer> {
    let errors = || [error_of(body), body["choices"][0].get("error")].into_iter().flatten();
    let answer =
        |text: String, ending| ModelAnswer { text, ending, model: self::text(&body["model"]), ..Default::default() };
    if let Some(error) = errors().find(|error| is_refusal(error)) {
        let words = error["message"].as_str().map_or_else(|| error.to_string(), str::to_owned);
        return Some(answer(words, Ending::Refused));
    }
    errors().find_map(failed_generation).map(|text| answer(text, Ending::Whole))
}

/// The model's text in an error such as `json_validate_failed` or `tool_use_failed` (Groq), which routers quote.
fn failed_generation(error: &Value) -> Option<String> {
    let quoted = |text: &Value| {
        let text = text.as_str()?;
        let mut values = serde_json::Deserializer::from_str(&text[text.find('{')?..]).into_iter::<Value>();
        let body = values.next()?.ok()?;
        failed_generation(error_of(&body).unwrap_or(&body))
    };
    match error.get("failed_generation") {
        Some(Value::String(text)) => Some(text.clone()),
        Some(Value::Null) | None => quoted(&error["metadata"]["raw"]).or_else(|| quoted(&error["message"])),
        Some(other) => Some(other.to_string()),
    }
}

fn is_refusal(error: &Value) -> bool {
    let details = error["details"].as_array().map(Vec::as_slice).unwrap_or_default();
    let codes = [&error["code"], &error["type"], &error["status"], &error["innererror"]["code"]];
    let mut names = codes.into_iter().chain(details.iter().map(|detail| &detail["reason"])).filter_map(Value::as_str);
    let message = error["message"].as_str().unwrap_or_default().to_lowercase();
    names.any(|name| REFUSALS.contains(&normal(name).as_str()))
        || WORDS.iter().any(|words| message.contains(words))
        || is_flagged(&error["metadata"])
}

fn is_flagged(metadata: &Value) -> bool {
    let raw = metadata["raw"].as_str().and_then(|raw| serde_json::from_str::<Value>(raw).ok());
    metadata.get("flagged_input").is_some() || raw.as_ref().and_then(error_of).is_some_and(is_refusal)
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::answer;
    use mirrorstats_agents::reply::Ending;

    #[test]
    fn refusals_of_every_provider_are_recognised() {
        let azure = json!({ "error": { "message": "filtered", "type": null, "param": "prompt", "code": "content_filter",
            "innererror": { "code": "ResponsibleAIPolicyViolation" } } });
        let routed = json!({ "error": { "message": "Provider returned error", "code": 400,
            "metadata": { "raw": azure.to_string(), "provider_name": "Azure" } } });
        let flagged = json!({ "error": { "code": 403, "message": "flagged",
            "metadata": { "reasons": ["violence"], "flagged_input": "..." } } });
        let prompt = json!({ "error": { "code": "invalid_prompt", "type": "invalid_request_error",
            "message": "Invalid prompt: your prompt was flagged as potentially violating our usage policy." } });
        let anthropic = json!({ "type": "error", "error": { "type": "invalid_request_error",
            "message": "Output blocked by content filtering policy" } });
        let google = json!({ "error": { "code": 400, "status": "INVALID_ARGUMENT", "message": "blocked",
            "details": [{ "@type": "type.googleapis.com/google.rpc.ErrorInfo", "reason": "PROHIBITED_CONTENT" }] } });
        let choice =
            json!({ "choices": [{ "finish_reason": "error", "error": { "code": "content_policy_violation" } }] });
        for body in [azure, routed, flagged, prompt, anthropic, google, choice] {
            assert_eq!(answer(&body).map(|answer| answer.ending), Some(Ending::Refused), "{body}");
        }
    }

    #[test]
    fn other_errors_are_no_refusals() {
        let long = "This model's maximum context length is 8192 tokens";
        for body in [
            Value::Null,
            json!([]),
            json!("slow down"),
            json!(429),
            json!([{ "error": { "code": 429 } }]),
            json!({ "error": "content_filter" }),
            json!({ "error": { "code": 400, "message": "temperature" } }),
            json!({ "error": { "code": "context_length_exceeded", "type": "invalid_request_error", "message": long } }),
            json!({ "error": { "code": "invalid_prompt", "message": "Invalid prompt: no message" } }),
            json!({ "error": { "message": "Provider returned error", "metadata": { "raw": "{\"error\": {}}" } } }),
            json!({ "error": { "message": "Provider returned error", "metadata": { "raw": "no JSON" } } }),
        ] {
            assert_eq!(answer(&body), None, "{body}");
        }
    }

    #[test]
    fn reasons_of_all_providers_are_known_in_any_spelling() {
        for (reason, expected) in [
            ("MAX_TOKENS", Ending::Truncated),
            ("maxTokens", Ending::Truncated),
            ("Length", Ending::Truncated),
            ("FINISH_REASON_MAX_TOKENS", Ending::Truncated),
            ("SAFETY", Ending::Refused),
            ("Content-Filter", Ending::Refused),
            ("end_turn", Ending::Whole),
            ("STOP", Ending::Whole),
            ("tool_calls", Ending::Whole),
            ("", Ending::Whole),
        ] {
            assert_eq!(super::ending(&reason.into()), expected, "{reason}");
        }
        assert_eq!(super::ending(&Value::Null), Ending::Whole);
    }

    #[test]
    fn a_text_that_the_provider_rejected_is_an_answer() {
        let groq = json!({ "error": { "code": "json_validate_failed", "failed_generation": "{\"action\": " } });
        let raw = json!({ "error": { "message": "Provider returned error", "metadata": { "raw": groq.to_string() } } });
        let words = json!({ "error": { "message": format!("GroqException - {groq} (400)") } });
        for body in [json!([groq]), groq, raw, words] {
            let answer = answer(&body).unwrap();
            assert_eq!((answer.text.as_str(), answer.ending), ("{\"action\": ", Ending::Whole), "{body}");
        }
    }
}

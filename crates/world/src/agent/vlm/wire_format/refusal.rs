//! A provider's refusal of a request's or an answer's content, reported as an error.
//!
//! Providers report it with HTTP 400 or 200, under various names. It counts as an answer like any other refusal: the
//! request was well-formed, and repeating it would give the same result.

use serde_json::Value;

use super::{ModelAnswer, text};
use crate::agent::reply::Ending;

/// The names of such errors, lower case.
const NAMES: [&str; 17] = [
    // OpenAI, Azure, and compatible servers.
    "content_filter",
    "content_policy_violation",
    "image_content_policy_violation",
    "moderation_blocked",
    "responsibleaipolicyviolation",
    // Anthropic, and routers that pass on its refusals.
    "refusal",
    // Google.
    "safety",
    "prohibited_content",
    "blocklist",
    "spii",
    "recitation",
    "image_safety",
    "image_prohibited_content",
    "model_armor",
    // Alibaba.
    "data_inspection_failed",
    "datainspectionfailed",
    "content_policy",
];

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

/// The refusal in an error's body; `None` for any other body.
pub(super) fn answer(body: &Value) -> Option<ModelAnswer> {
    let error = [&body["error"], &body["choices"][0]["error"]].into_iter().find(|error| is_refusal(error))?;
    Some(ModelAnswer {
        text: error["message"].as_str().map_or_else(|| error.to_string(), str::to_owned),
        ending: Ending::Refused,
        model: text(&body["model"]),
        ..ModelAnswer::default()
    })
}

fn is_refusal(error: &Value) -> bool {
    let details = error["details"].as_array().map(Vec::as_slice).unwrap_or_default();
    let codes = [&error["code"], &error["type"], &error["status"], &error["innererror"]["code"]];
    let mut names = codes.into_iter().chain(details.iter().map(|detail| &detail["reason"])).filter_map(Value::as_str);
    let message = error["message"].as_str().unwrap_or_default().to_lowercase();
    names.any(|name| NAMES.contains(&name.to_lowercase().as_str()))
        || WORDS.iter().any(|words| message.contains(words))
        || is_flagged(&error["metadata"])
}

fn is_flagged(metadata: &Value) -> bool {
    let raw = metadata["raw"].as_str().and_then(|raw| serde_json::from_str::<Value>(raw).ok());
    metadata.get("flagged_input").is_some() || raw.is_some_and(|raw| is_refusal(&raw["error"]))
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::answer;
    use crate::agent::reply::Ending;

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
}

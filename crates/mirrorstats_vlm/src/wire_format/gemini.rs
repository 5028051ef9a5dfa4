//! Google's `generateContent`.

use serde_json::{Value, json};

use super::refusal::ending;
use super::{Effort, ModelAnswer, Question, text, text_or_call, tokens};
use mirrorstats_agents::reply::{Ending, Repair};

pub(super) fn body(&Question { model, temperature, words, png, schema }: &Question<'_>) -> Value {
    let mut body = json!({
        "contents": [{ "role": "user", "parts": [
            { "text": words.user },
            { "inlineData": { "data": png, "mimeType": "image/png" } },
        ] }],
        "systemInstruction": { "parts": [{ "text": words.system }], "role": "user" },
        "generationConfig": { "maxOutputTokens": model.max_output_tokens() },
    });
    if let Some(temperature) = temperature {
        body["generationConfig"]["temperature"] = json!(temperature);
    }
    if let Some(schema) = schema {
        body["generationConfig"]["responseMimeType"] = json!("application/json");
        body["generationConfig"]["responseJsonSchema"] = schema.clone();
    }
    if let Some(effort) = model.reasoning_effort {
        body["generationConfig"]["thinkingConfig"] = thinking(&model.id, effort);
    }
    body
}

/// The encoding of an effort: from Gemini 3 on by name, and names that the model does not know are rejected. Earlier
/// models get token counts, as in Google's own translation of `OpenAI`'s efforts.
fn thinking(model: &str, effort: Effort) -> Value {
    if !model.starts_with("gemini-2") {
        return json!({ "thinkingLevel": effort.name().to_uppercase() });
    }
    let budget = match effort {
        Effort::None => 0,
        Effort::Minimal | Effort::Low => 1_024,
        Effort::Medium => 8_192,
        Effort::High | Effort::Xhigh | Effort::Max => 24_576,
    };
    json!({ "thinkingBudget": budget })
}

pub(super) fn answer(body: &Value) -> Option<ModelAnswer> {
    let blocked = body["promptFeedback"]["blockReason"].as_str();
    let candidates = body.get("candidates").map(|candidates| candidates.as_array());
    let first = match (candidates, blocked) {
        (Some(candidates), _) => candidates?.first(),
        (None, Some(_)) => None,
        // A complete answer without candidates has at least its usage.
        (None, None) => body.get("usageMetadata").map(|_| None)?,
    };
    let ending = match blocked {
        Some(_) => Ending::Refused,
        None => first.map_or(Ending::Whole, |candidate| ending(&candidate["finishReason"])),
    };
    let usage = &body["usageMetadata"];
    let completion = [&usage["candidatesTokenCount"], &usage["thoughtsTokenCount"]].map(tokens);
    let (text_of_reply, repairs) = first.map(words).unwrap_or_default();
    Some(ModelAnswer {
        text: text_of_reply,
        repairs,
        ending,
        prompt_tokens: tokens(&usage["promptTokenCount"]),
        cached_tokens: tokens(&usage["cachedContentTokenCount"]),
        completion_tokens: match completion {
            [None, None] => None,
            [candidates, thoughts] => Some(candidates.unwrap_or(0).saturating_add(thoughts.unwrap_or(0))),
        },
        model: text(&body["modelVersion"]),
        ..ModelAnswer::default()
    })
}

fn words(candidate: &Value) -> (String, Vec<Repair>) {
    let parts = candidate["content"]["parts"].as_array().map(Vec::as_slice).unwrap_or_default();
    let is_thought = |part: &&Value| part["thought"] == true || part["thought"] == "true";
    let answer: Vec<&Value> = parts.iter().filter(|part| !is_thought(part)).collect();
    let words = answer.iter().filter_map(|part| part["text"].as_str()).collect();
    text_or_call(words, answer.iter().map(|part| &part["functionCall"]["args"]))
}

//! Anthropic's Messages API.

use serde_json::{Value, json};

use super::refusal::ending;
use super::{Effort, ModelAnswer, Question, text, text_or_call, tokens};
use mirrorstats_agents::reply::Ending;

pub(super) fn body(&Question { model, temperature, words, png, schema }: &Question<'_>) -> Value {
    let source = json!({ "type": "base64", "media_type": "image/png", "data": png });
    let mut body = json!({
        "model": model.id,
        "max_tokens": model.max_output_tokens(),
        "system": words.system,
        "messages": [{ "role": "user", "content": [
            { "type": "text", "text": words.user },
            { "type": "image", "source": source },
        ] }],
    });
    if let Some(temperature) = temperature {
        body["temperature"] = json!(temperature);
    }
    if let Some(schema) = schema {
        body["output_config"] = json!({ "format": { "type": "json_schema", "schema": schema } });
    }
    match model.reasoning_effort {
        None => {}
        Some(Effort::None) => body["thinking"] = json!({ "type": "disabled" }),
        // Up to 4.6 a model thinks only on request; for later ones this is the default.
        Some(effort) => {
            body["thinking"] = json!({ "type": "adaptive" });
            body["output_config"]["effort"] = json!(effort.name());
        }
    }
    body
}

pub(super) fn answer(body: &Value) -> Option<ModelAnswer> {
    let ending = ending(&body["stop_reason"]);
    let blocks = match body.get("content").filter(|content| !content.is_null()) {
        Some(content) => content.as_array()?.as_slice(),
        None if ending == Ending::Refused => &[],
        None => return None,
    };
    let words = blocks.iter().filter(|block| block["type"] == "text").filter_map(|block| block["text"].as_str());
    let usage = &body["usage"];
    let calls = blocks.iter().filter(|block| block["type"] == "tool_use").map(|block| &block["input"]);
    let (text_of_reply, repairs) = text_or_call(words.collect(), calls);
    Some(ModelAnswer {
        text: text_of_reply,
        repairs,
        ending,
        // Anthropic counts tokens read from and written to its cache separately.
        prompt_tokens: tokens(&usage["input_tokens"]).map(|input| {
            let cache = ["cache_read_input_tokens", "cache_creation_input_tokens"];
            cache.iter().filter_map(|name| tokens(&usage[*name])).fold(input, u32::saturating_add)
        }),
        cached_tokens: tokens(&usage["cache_read_input_tokens"]),
        completion_tokens: tokens(&usage["output_tokens"]),
        model: text(&body["model"]),
        ..ModelAnswer::default()
    })
}

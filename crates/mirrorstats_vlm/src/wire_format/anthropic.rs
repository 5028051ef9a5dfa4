//! Anthropic's Messages API.

use serde_json::{Value, json};

use super::refusal::ending;
use super::{ModelAnswer, Question, text, text_or_call, tokens};
use mirrorstats_agents::reply::Ending;

pub(super) fn body(question: &Question<'_>) -> Value {
    let source = json!({ "type": "base64", "media_type": "image/png", "data": question.png_base64 });
    let mut body = json!({
        "model": question.model,
        "max_tokens": question.max_output_tokens,
        "system": question.system,
        "messages": [{ "role": "user", "content": [
            { "type": "image", "source": source },
            { "type": "text", "text": question.user },
        ] }],
    });
    if let Some(temperature) = question.temperature {
        body["temperature"] = json!(temperature);
    }
    if let Some(schema) = question.schema {
        body["output_config"] = json!({ "format": { "type": "json_schema", "schema": schema } });
    }
    if let Some(effort) = question.reasoning_effort {
        body["output_config"]["effort"] = json!(effort.name());
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
        cost_usd: None,
        model: text(&body["model"]),
    })
}

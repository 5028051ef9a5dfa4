//! `OpenAI`'s chat completions API.

use serde_json::{Value, json};

use super::{ModelAnswer, Question, text, text_or_call, tokens};
use crate::agent::reply::Ending;

pub(super) fn body(question: &Question<'_>, limit: &str) -> Value {
    let image = format!("data:image/png;base64,{}", question.png_base64);
    let mut body = json!({
        "model": question.model,
        "messages": [
            { "role": "system", "content": question.system },
            { "role": "user", "content": [
                { "type": "image_url", "image_url": { "url": image } },
                { "type": "text", "text": question.user },
            ] },
        ],
    });
    if let Some(temperature) = question.temperature {
        body["temperature"] = json!(temperature);
    }
    body[limit] = json!(question.max_output_tokens);
    if let Some(effort) = question.reasoning_effort {
        body["reasoning_effort"] = json!(effort.name());
    }
    if let Some(schema) = question.schema {
        body["response_format"] = json!({
            "type": "json_schema",
            "json_schema": { "name": "reply", "strict": true, "schema": schema },
        });
    }
    body
}

pub(super) fn answer(body: &Value) -> Option<ModelAnswer> {
    let choices = body.get("choices")?.as_array()?;
    // A router that lost its provider in the middle of an answer reports it in the choice, beside a partial text.
    if choices.first().is_some_and(|choice| choice["finish_reason"] == "error" || choice["error"].is_object()) {
        return None;
    }
    let usage = &body["usage"];
    let (reply, ending) = choices.first().map_or((String::new(), Ending::Whole), reply);
    let calls = choices.first().and_then(|choice| choice["message"]["tool_calls"].as_array());
    let arguments = |call: &Value| call["function"]["arguments"].as_str().map(str::to_owned);
    let calls: Vec<_> = calls.into_iter().flatten().filter_map(arguments).collect();
    let (reply, repairs) = text_or_call(reply, &calls);
    Some(ModelAnswer {
        text: reply,
        repairs,
        ending,
        prompt_tokens: tokens(&usage["prompt_tokens"]),
        cached_tokens: tokens(&usage["prompt_tokens_details"]["cached_tokens"]),
        completion_tokens: tokens(&usage["completion_tokens"]),
        cost_usd: usage["cost"].as_f64().filter(|cost| *cost >= 0.0),
        model: text(&body["model"]),
    })
}

fn reply(choice: &Value) -> (String, Ending) {
    let message = &choice["message"];
    let refusal = message["refusal"].as_str().filter(|words| !words.is_empty());
    let ending = match (refusal, choice["finish_reason"].as_str()) {
        (Some(_), _) | (None, Some("content_filter" | "refusal")) => Ending::Refused,
        (None, Some("length")) => Ending::Truncated,
        _ => Ending::Whole,
    };
    (content(&message["content"]).or_else(|| refusal.map(str::to_owned)).unwrap_or_default(), ending)
}

fn content(content: &Value) -> Option<String> {
    match content {
        Value::String(text) => Some(text.clone()),
        Value::Array(parts) => Some(parts.iter().filter_map(|part| part["text"].as_str()).collect()),
        _ => None,
    }
}

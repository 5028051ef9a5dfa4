//! `OpenAI`'s chat completions API.

use serde_json::{Value, json};

use super::refusal::ending;
use super::{ModelAnswer, Question, text, text_or_call, tokens};
use mirrorstats_agents::reply::Ending;

pub(super) fn body(&Question { model, temperature, words, png, schema }: &Question<'_>, limit: &str) -> Value {
    let image = format!("data:image/png;base64,{png}");
    let mut body = json!({
        "model": model.id,
        "messages": [
            { "role": "system", "content": words.system },
            { "role": "user", "content": [
                { "type": "text", "text": words.user },
                { "type": "image_url", "image_url": { "url": image } },
            ] },
        ],
    });
    if let Some(temperature) = temperature {
        body["temperature"] = json!(temperature);
    }
    body[limit] = json!(model.max_output_tokens());
    if let Some(effort) = model.reasoning_effort {
        body["reasoning_effort"] = json!(effort.name());
    }
    if let Some(schema) = schema {
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
    let is_error = |reason: &Value| reason.as_str().is_some_and(|reason| reason.eq_ignore_ascii_case("error"));
    if choices.first().is_some_and(|choice| is_error(&choice["finish_reason"]) || choice["error"].is_object()) {
        return None;
    }
    let usage = &body["usage"];
    let (reply, ending) = choices.first().map_or((String::new(), Ending::Whole), reply);
    let (reply, repairs) = text_or_call(reply, choices.first().into_iter().flat_map(arguments));
    Some(ModelAnswer {
        text: reply,
        repairs,
        ending,
        prompt_tokens: tokens(&usage["prompt_tokens"]),
        cached_tokens: tokens(&usage["prompt_tokens_details"]["cached_tokens"]),
        completion_tokens: tokens(&usage["completion_tokens"]),
        cost_usd: usage["cost"].as_f64().filter(|cost| *cost >= 0.0),
        model: text(&body["model"]),
        ..ModelAnswer::default()
    })
}

fn reply(choice: &Value) -> (String, Ending) {
    let message = &choice["message"];
    let refusal = message["refusal"].as_str().filter(|words| !words.is_empty());
    let ending = if refusal.is_some() { Ending::Refused } else { ending(&choice["finish_reason"]) };
    (content(&message["content"]).or_else(|| refusal.map(str::to_owned)).unwrap_or_default(), ending)
}

/// The arguments of calls of functions; `function_call` is the older form of a single one. Or an object in place of a text.
fn arguments(choice: &Value) -> Vec<&Value> {
    let message = &choice["message"];
    match message["tool_calls"].as_array().map(Vec::as_slice) {
        None | Some([]) => {
            let object = message.get("content").filter(|content| content.is_object() && content.get("text").is_none());
            vec![&message["function_call"]["arguments"], object.unwrap_or(&message["parsed"])]
        }
        Some(calls) => calls.iter().map(|call| &call["function"]["arguments"]).collect(),
    }
}

/// The text of a message, without parts that hold its reasoning.
fn content(content: &Value) -> Option<String> {
    match content {
        Value::String(text) => Some(text.clone()),
        Value::Array(parts) => {
            let is_text = |part: &&Value| matches!(part["type"].as_str(), None | Some("text" | "output_text"));
            Some(parts.iter().filter(is_text).filter_map(|part| part["text"].as_str()).collect())
        }
        part => part["text"].as_str().map(str::to_owned),
    }
}

//! The bodies of requests: the words of the prompt, then the frame, the schema's keys, and nothing else.

use std::collections::BTreeSet;
use std::num::NonZeroU32;

use mirrorstats_agents::prompt::{Prompt, Rendered};
use mirrorstats_agents::{Task, reply};
use mirrorstats_experiment::{Experiment, built_in_names};
use mirrorstats_vlm::limits::Limits;
use mirrorstats_vlm::wire_format::{Effort, WireFormat};
use serde_json::{Value, json};

use super::bench::{Bench, choice, observation, patience, task};
use super::server::{Server, decision, whole};

const PROVIDERS: [WireFormat; 4] =
    [WireFormat::OpenaiChat, WireFormat::OpenaiCompatible, WireFormat::Gemini, WireFormat::AnthropicMessages];

/// All names and fixed values of the wire formats, which say nothing about the task.
const LANGUAGE: [&str; 38] = [
    "model",
    "messages",
    "role",
    "system",
    "user",
    "content",
    "type",
    "text",
    "image_url",
    "url",
    "temperature",
    "max_tokens",
    "max_completion_tokens",
    "response_format",
    "json_schema",
    "name",
    "reply",
    "strict",
    "schema",
    "contents",
    "parts",
    "inlineData",
    "data",
    "mimeType",
    "image/png",
    "systemInstruction",
    "generationConfig",
    "maxOutputTokens",
    "responseMimeType",
    "application/json",
    "responseJsonSchema",
    "image",
    "source",
    "base64",
    "media_type",
    "output_config",
    "format",
    "model-1",
];

/// The keywords of the schema.
const SCHEMA: [&str; 6] = ["type", "properties", "required", "additionalProperties", "object", "string"];

/// All built-in experiments.
fn built_in() -> Vec<Experiment> {
    built_in_names().into_iter().map(|name| Experiment::parse(name).unwrap()).collect()
}

/// The body of an episode's first request, and the rendered prompt.
fn body(wire_format: WireFormat, experiment: &Experiment) -> (Value, Rendered) {
    let server = Server::start(move |_, _| whole(wire_format, &decision("w")));
    let bench = Bench::new(Limits::default());
    let vlm = bench.vlm(&server, wire_format);
    Bench::play_task(&vlm, task(experiment.clone()), "episode", 1).remove(0).unwrap();
    let words = Prompt::for_experiment(experiment).unwrap().render(&task(experiment.clone()), &observation(1)).unwrap();
    (server.requests().remove(0).json(), words)
}

/// The parts of the user's message, in order.
fn parts(wire_format: WireFormat, body: &Value) -> &[Value] {
    let place = match wire_format {
        WireFormat::OpenaiChat | WireFormat::OpenaiCompatible => "/messages/1/content",
        WireFormat::Gemini => "/contents/0/parts",
        WireFormat::AnthropicMessages => "/messages/0/content",
    };
    body.pointer(place).unwrap().as_array().unwrap()
}

/// All strings and member names of a value, in order.
fn strings(value: &Value) -> Vec<&str> {
    match value {
        Value::String(text) => vec![text],
        Value::Array(items) => items.iter().flat_map(strings).collect(),
        Value::Object(members) => {
            members.iter().flat_map(|(key, value)| [vec![key.as_str()], strings(value)].concat()).collect()
        }
        _ => Vec::new(),
    }
}

#[test]
fn the_frame_follows_the_words_with_every_provider() {
    for wire_format in PROVIDERS {
        for experiment in built_in() {
            let (body, words) = body(wire_format, &experiment);
            let [text, image] = parts(wire_format, &body) else { panic!("{wire_format:?}: {body}") };
            assert_eq!(text["text"], words.user.as_str(), "{wire_format:?}");
            let is_frame = |text: &&str| text.contains("iVBORw0KGgo");
            assert_eq!(strings(image).iter().filter(|text| is_frame(text)).count(), 1, "{wire_format:?}: {image}");
        }
    }
}

#[test]
fn requests_describe_the_task_only_by_the_prompt_and_the_reply_keys() {
    for wire_format in PROVIDERS {
        for experiment in built_in() {
            let (body, words) = body(wire_format, &experiment);
            let structure = reply::structure(&experiment);
            let keys: BTreeSet<&str> =
                structure["properties"].as_object().unwrap().keys().map(String::as_str).collect();
            let is_known = |text: &&str| {
                LANGUAGE.contains(text) || SCHEMA.contains(text) || keys.contains(text) || text.contains("iVBORw0KGgo")
            };
            let mut said: Vec<&str> = strings(&body).into_iter().filter(|text| !is_known(text)).collect();
            said.sort_unstable();
            let mut expected = [words.system.as_str(), &words.user];
            expected.sort_unstable();
            assert_eq!(said, expected, "{wire_format:?}, {experiment:?}");
        }
    }
}

#[test]
fn token_limit_and_reasoning_have_each_providers_parameters() {
    let asked = |wire_format: WireFormat, id: &str, effort: Option<Effort>| {
        let server = Server::start(move |_, _| whole(wire_format, &decision("w")));
        let bench = Bench::new(Limits::default());
        let mut choice = choice(wire_format);
        id.clone_into(&mut choice.model.id);
        choice.model.answers_as = vec!["*".to_owned()];
        (choice.model.max_output_tokens, choice.model.reasoning_effort) = (NonZeroU32::new(9_000), effort);
        let vlm = bench.vlm_of(&server, choice, patience());
        Bench::play(&vlm, "episode", 1).remove(0).unwrap();
        (server.requests().remove(0).json(), vlm.description())
    };
    let thinking = "/generationConfig/thinkingConfig";
    for (wire_format, id, most, place, expected) in [
        (WireFormat::OpenaiChat, "m", "/max_completion_tokens", "/reasoning_effort", json!("low")),
        (WireFormat::OpenaiCompatible, "m", "/max_tokens", "/reasoning_effort", json!("low")),
        (WireFormat::AnthropicMessages, "m", "/max_tokens", "/output_config/effort", json!("low")),
        (WireFormat::AnthropicMessages, "m", "/max_tokens", "/thinking", json!({ "type": "adaptive" })),
        (
            WireFormat::Gemini,
            "gemini-2.5-pro",
            "/generationConfig/maxOutputTokens",
            thinking,
            json!({ "thinkingBudget": 1_024 }),
        ),
        (
            WireFormat::Gemini,
            "gemini-3-pro",
            "/generationConfig/maxOutputTokens",
            thinking,
            json!({ "thinkingLevel": "LOW" }),
        ),
    ] {
        let (body, description) = asked(wire_format, id, Some(Effort::Low));
        assert_eq!(
            (body.pointer(most), body.pointer(place)),
            (Some(&json!(9_000)), Some(&expected)),
            "{wire_format:?}"
        );
        assert!(body.pointer("/output_config/format").is_some() || wire_format != WireFormat::AnthropicMessages);
        // The recording's sampling includes both.
        assert_eq!(
            (&description["max_output_tokens"], &description["reasoning_effort"]),
            (&json!(9_000), &json!("low"))
        );
        let (body, description) = asked(wire_format, id, None);
        assert_eq!(body.pointer(place), None, "{wire_format:?}");
        assert_eq!(description.get("reasoning_effort"), None);
    }
}

#[test]
fn a_temperature_that_would_have_no_effect_is_neither_sent_nor_recorded() {
    let asked = |wire_format: WireFormat, id: &str, effort: Option<Effort>| {
        let server = Server::start(move |_, _| whole(wire_format, &decision("w")));
        let bench = Bench::new(Limits::default());
        let mut choice = choice(wire_format);
        id.clone_into(&mut choice.model.id);
        choice.model.answers_as = vec!["*".to_owned()];
        choice.model.reasoning_effort = effort;
        let vlm = bench.vlm_of(&server, choice, patience());
        Bench::play(&vlm, "episode", 1).remove(0).unwrap();
        let body = server.requests().remove(0).json();
        let sent = body.get("temperature").or_else(|| body.pointer("/generationConfig/temperature")).cloned();
        (sent, vlm.description()["temperature"].clone(), body["thinking"].clone())
    };
    let (used, unused) = ((Some(json!(0.2)), json!(0.2)), (None, json!("default")));
    let (off, on) = (json!({ "type": "disabled" }), json!({ "type": "adaptive" }));
    for (wire_format, id, effort, expected, thinking) in [
        (WireFormat::Gemini, "gemini-3.1-pro-preview", None, &used, Value::Null),
        (WireFormat::Gemini, "gemini-3.8-flash", None, &unused, Value::Null),
        (WireFormat::OpenaiCompatible, "google/gemini-3.6-flash", None, &unused, Value::Null),
        (WireFormat::OpenaiChat, "gpt-5.1", Some(Effort::Low), &used, Value::Null),
        (WireFormat::AnthropicMessages, "claude-sonnet-4-6", None, &used, Value::Null),
        (WireFormat::AnthropicMessages, "claude-sonnet-4-6", Some(Effort::None), &used, off),
        (WireFormat::AnthropicMessages, "claude-sonnet-4-6", Some(Effort::High), &unused, on),
    ] {
        let (sent, recorded, thought) = asked(wire_format, id, effort);
        assert_eq!((&(sent, recorded), thought), (expected, thinking), "{id}, {effort:?}");
    }
}

/// Seed and run determine the colour of the body, so a request must not contain them in any form.
#[test]
fn requests_are_equal_for_every_seed_and_run_with_equal_observations() {
    let of = |seed: u64, episode: &str| {
        let server = Server::start(|_, _| whole(WireFormat::OpenaiChat, &decision("w")));
        let bench = Bench::new(Limits::default());
        let task = Task { seed, ..task(Experiment::E1) };
        let played = Bench::play_task(&bench.vlm(&server, WireFormat::OpenaiChat), task, episode, 3);
        assert!(played.iter().all(Result::is_ok));
        let head = |head: &str| head.lines().filter(|line| !line.starts_with("host:")).collect::<Vec<_>>().join("\n");
        server.requests().iter().map(|request| (head(&request.head), request.body.clone())).collect::<Vec<_>>()
    };
    let requests = of(1, "E1-1-1@model");
    assert_eq!(requests.len(), 3);
    assert_eq!(requests, of(1 << 40, "E1-3141-59@model"));
}

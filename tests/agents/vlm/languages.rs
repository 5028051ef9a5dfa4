//! Each provider gets its own wire format, and only the contents of the paper's prompt.

use std::collections::BTreeSet;

use mirrorstats_agents::{Status, reply};
use mirrorstats_experiment::Experiment;
use mirrorstats_trace::episodes::episode::Action;
use mirrorstats_vlm::limits::Limits;
use mirrorstats_vlm::wire_format::WireFormat;
use serde_json::Value;

use super::bench::{Bench, KEY};
use super::recordings::Folder;
use super::server::{Request, Server, decision, whole};
use crate::harness::program::{program, stderr};

#[test]
fn each_provider_gets_its_own_wire_format() {
    let openai = format!("authorization: Bearer {KEY}");
    let providers = [
        (WireFormat::OpenaiChat, "/v1/chat/completions", openai.clone()),
        (WireFormat::OpenaiCompatible, "/v1/chat/completions", openai),
        (WireFormat::Gemini, "/v1/models/model-1:generateContent", format!("x-goog-api-key: {KEY}")),
        (WireFormat::AnthropicMessages, "/v1/messages", format!("x-api-key: {KEY}")),
    ];
    for (wire_format, path, key) in providers {
        let server = Server::start(move |_, _| whole(wire_format, &decision("w")));
        let bench = Bench::new(Limits::default());
        let reply = Bench::play(&bench.vlm(&server, wire_format), "episode", 1).remove(0).unwrap();
        assert_eq!((reply.status, reply.action), (Status::Ok, Some(Action::MoveForward)), "{wire_format:?}");
        assert_eq!(
            (reply.usage.prompt_tokens, reply.usage.completion_tokens),
            (Some(1000), Some(100)),
            "{wire_format:?}"
        );
        let request = server.requests().remove(0);
        assert!(request.head.starts_with(&format!("POST {path} ")), "{}", request.head);
        assert!(request.head.contains(&key), "{}", request.head);
        let text = request.json().to_string();
        assert!(text.contains("0.2") && text.contains("You are a robot control agent."), "{wire_format:?}");
        assert!(text.contains("selected_cube"), "the schema is asked for: {wire_format:?}");
    }
}

/// A backend for each wire format, as in a file of models.
const BACKENDS: [(&str, WireFormat); 4] = [
    ("openai-chat", WireFormat::OpenaiChat),
    ("openai-compatible", WireFormat::OpenaiCompatible),
    ("gemini", WireFormat::Gemini),
    ("anthropic-messages", WireFormat::AnthropicMessages),
];

/// A reply that ends an episode of either prompt family.
fn done(request: &Request) -> String {
    let reply = decision("done");
    // The prompt of E5 has no cubes.
    if request.body.contains("selected_cube") { reply } else { reply.replace("\"selected_cube\":\"none\",", "") }
}

/// The requests of one step in each of the five experiments, as sent by `record`.
fn of_all_experiments(backend: &str, wire_format: WireFormat) -> Vec<Request> {
    let server = Server::start(move |_, request| whole(wire_format, &done(request)));
    let folder = Folder::new();
    let models = format!("[backend.own]\nwire_format = \"{backend}\"\nkey = \"MIRRORSTATS_API_KEY\"\n");
    std::fs::write(folder.path().join("models.toml"), models).unwrap();
    let mut command = program(folder.path());
    command.env("MIRRORSTATS_API_KEY", KEY).args([
        "record",
        "--agent",
        "vlm",
        "--model",
        "model-1",
        "--models",
        "models.toml",
        "--backend",
        "own",
    ]);
    command.args(["--base-url", &server.address, "--experiment", "E1..E5", "--seeds", "1", "--runs", "1"]);
    let output = command.args(["--config", "small.toml", "--no-log"]).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    server.requests()
}

/// The schema in a request.
fn schema(wire_format: WireFormat, request: &Value) -> &Value {
    let place = match wire_format {
        WireFormat::OpenaiChat | WireFormat::OpenaiCompatible => "/response_format/json_schema/schema",
        WireFormat::Gemini => "/generationConfig/responseJsonSchema",
        WireFormat::AnthropicMessages => "/output_config/format/schema",
    };
    request.pointer(place).unwrap_or_else(|| panic!("no schema: {wire_format:?}"))
}

/// All strings of a value, including keys.
fn strings(value: &Value) -> BTreeSet<String> {
    match value {
        Value::String(text) => BTreeSet::from([text.clone()]),
        Value::Array(items) => items.iter().flat_map(strings).collect(),
        Value::Object(members) => {
            let inner = members.values().flat_map(strings);
            members.keys().cloned().chain(inner).collect()
        }
        _ => BTreeSet::new(),
    }
}

#[test]
fn the_schema_adds_nothing_to_the_prompt() {
    const KEYWORDS: [&str; 6] = ["type", "properties", "required", "additionalProperties", "object", "string"];
    for (backend, wire_format) in BACKENDS {
        let requests = of_all_experiments(backend, wire_format);
        assert_eq!(requests.len(), 5, "{wire_format:?}");
        let mut with_cubes = 0;
        for request in requests {
            let has_cubes = request.body.contains("selected_cube");
            with_cubes += usize::from(has_cubes);
            let mut keys = BTreeSet::from(["view-description", "reasoning", "action", "summary", "identification"]);
            keys.extend(has_cubes.then_some("selected_cube"));
            let body = request.json();
            let schema = schema(wire_format, &body);
            let said = strings(schema);
            let known = |text: &&String| keys.contains(text.as_str()) || KEYWORDS.contains(&text.as_str());
            assert_eq!(
                said.iter().filter(|text| !known(text)).collect::<Vec<_>>(),
                Vec::<&String>::new(),
                "{wire_format:?}"
            );
            // The schema has the keys that the prompt asks for.
            let asked: BTreeSet<&str> = schema["properties"].as_object().unwrap().keys().map(String::as_str).collect();
            assert_eq!(asked, keys, "{wire_format:?}");
            assert!(
                keys.iter().all(|key| request.body.matches(&format!("\\\"{key}\\\"")).count() > 0),
                "{wire_format:?}"
            );
            let experiment = if has_cubes { Experiment::E1 } else { Experiment::E5 };
            assert_eq!(*schema, reply::structure(&experiment), "{wire_format:?}");
        }
        assert_eq!(with_cubes, 4, "{wire_format:?}");
    }
}

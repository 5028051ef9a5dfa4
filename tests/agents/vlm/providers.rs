//! Provider behaviour, from their documentation and clients: rate limits in bodies and headers, other models and types.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use mirrorstats_agents::Status;
use mirrorstats_agents::reply::Repair;
use mirrorstats_record::fingerprint::Fingerprint;
use mirrorstats_vlm::limits::Limits;
use mirrorstats_vlm::wire_format::WireFormat;
use serde_json::{Value, json};

use super::bench::{Bench, KEY, choice, patience};
use super::recordings::{Folder, counting};
use super::server::{JSON, Request, Server, decision, endings, http, ok, spoken, whole};
use crate::harness::program::{run, stderr};
use crate::harness::traces;

const PROVIDERS: [WireFormat; 4] =
    [WireFormat::OpenaiChat, WireFormat::OpenaiCompatible, WireFormat::Gemini, WireFormat::AnthropicMessages];

/// An error of Gemini: <https://ai.google.dev/gemini-api/docs/rate-limits>, with details as in `google.rpc`.
fn exhausted(quota: &str, delay: &str) -> Vec<u8> {
    let body = json!({ "error": {
        "code": 429,
        "message": "You exceeded your current quota, please check your plan and billing details.",
        "status": "RESOURCE_EXHAUSTED",
        "details": [
            { "@type": "type.googleapis.com/google.rpc.QuotaFailure", "violations": [{ "quotaId": quota }] },
            { "@type": "type.googleapis.com/google.rpc.RetryInfo", "retryDelay": delay },
        ],
    } });
    http("429 Too Many Requests", JSON, body.to_string().as_bytes())
}

const A_MINUTE: &str = "GenerateRequestsPerMinutePerProjectPerModel";
const A_DAY: &str = "GenerateRequestsPerDayPerProjectPerModel";

#[test]
fn a_whole_answer_counts_whatever_its_content_type_says() {
    for wire_format in PROVIDERS {
        for headers in ["", "content-type: text/plain\r\n", "content-type: text/html; charset=utf-8\r\n"] {
            let body = spoken(wire_format, &decision("w"), endings(wire_format).0).to_string();
            let server = Server::start(move |_, _| http("200 OK", headers, body.as_bytes()));
            let bench = Bench::new(Limits::default());
            let vlm = bench.vlm(&server, wire_format);
            let reply = Bench::play(&vlm, "episode", 1).remove(0).unwrap();
            assert_eq!((reply.status, server.count()), (Status::Ok, 1), "{wire_format:?} {headers:?}");
            assert!(reply.usage.cost_usd.is_some_and(|cost| cost > 0.0), "{wire_format:?} {headers:?}");
        }
    }
}

#[test]
fn waiting_for_a_rate_limit_uses_no_attempts() {
    // OpenAI's client reads `retry-after-ms` before `retry-after`: openai-python, `_base_client.py`.
    let milliseconds = || http("429 Too Many Requests", "retry-after-ms: 20\r\nretry-after: 99\r\n", b"slow down");
    for (wire_format, is_google) in [(WireFormat::Gemini, true), (WireFormat::OpenaiChat, false)] {
        let server = Server::start(move |at, _| match at {
            // More failures than attempts.
            0..8 if is_google => exhausted(A_MINUTE, "0.020s"),
            0..8 => milliseconds(),
            _ => whole(wire_format, &decision("w")),
        });
        let bench = Bench::new(Limits::default());
        let start = Instant::now();
        let reply = Bench::play(&bench.vlm(&server, wire_format), "episode", 1).remove(0).unwrap();
        assert_eq!((reply.status, server.count()), (Status::Ok, 9), "{wire_format:?}");
        assert!(start.elapsed() >= Duration::from_millis(160), "{wire_format:?}: asked too early");
    }
}

#[test]
fn a_daily_quota_stops_the_recording_with_a_remedy() {
    let router = br#"{"error": {"code": 429, "message": "Rate limit exceeded: free-models-per-day"}}"#;
    let answers = [exhausted(A_DAY, "34s"), http("429 Too Many Requests", JSON, router)];
    for answer in answers {
        let server = Server::start(move |_, _| answer.clone());
        let bench = Bench::new(Limits::default());
        let vlm = bench.vlm(&server, WireFormat::Gemini);
        let lost = Bench::play(&vlm, "episode", 2).remove(1).unwrap_err().cause;
        assert!(lost.contains("quota of the day is used up") && lost.contains("\n  help: "), "{lost}");
        assert_eq!((vlm.stopped(), server.count()), (Some(lost.as_str()), 1));
    }
}

#[test]
fn a_wait_of_hours_stops_the_recording_with_a_remedy() {
    for (wait, seconds) in [("7200", "7200 s"), ("999999999999999999999", "s: HTTP 429")] {
        let answer = http("429 Too Many Requests", &format!("retry-after: {wait}\r\n"), b"slow down");
        let server = Server::start(move |_, _| answer.clone());
        let bench = Bench::new(Limits::default());
        let vlm = bench.vlm(&server, WireFormat::OpenaiChat);
        let lost = Bench::play(&vlm, "episode", 2).remove(1).unwrap_err().cause;
        assert!(lost.contains("asks to wait") && lost.contains(seconds) && lost.contains("\n  help: "), "{lost}");
        assert_eq!((vlm.stopped(), server.count()), (Some(lost.as_str()), 1));
    }
}

#[test]
fn no_request_goes_out_before_a_used_up_limit_is_renewed() {
    // OpenAI: <https://platform.openai.com/docs/guides/rate-limits>, "Rate limits in headers".
    let headers = "content-type: application/json\r\nx-ratelimit-remaining-requests: 0\r\n\
                   x-ratelimit-reset-requests: 100ms\r\n";
    let body = spoken(WireFormat::OpenaiChat, &decision("w"), "stop").to_string();
    let server = Server::start(move |_, _| http("200 OK", headers, body.as_bytes()));
    let bench = Bench::new(Limits::default());
    let start = Instant::now();
    let replies = Bench::play(&bench.vlm(&server, WireFormat::OpenaiChat), "episode", 3);
    assert!(replies.iter().all(|reply| reply.as_ref().is_ok_and(|reply| reply.status == Status::Ok)));
    assert_eq!(server.count(), 3);
    assert!(start.elapsed() >= Duration::from_millis(200), "the provider was asked too early");
}

#[test]
fn a_call_of_a_function_in_place_of_a_text_is_a_repair_with_every_provider() {
    let arguments: Value = serde_json::from_str(&decision("w")).unwrap();
    for wire_format in PROVIDERS {
        let mut body = spoken(wire_format, "", endings(wire_format).0);
        match wire_format {
            WireFormat::OpenaiChat | WireFormat::OpenaiCompatible => {
                let call = json!({ "type": "function", "function": { "name": "reply", "arguments": decision("w") } });
                body["choices"][0]["message"] = json!({ "content": null, "tool_calls": [call] });
            }
            WireFormat::Gemini => {
                let call = json!({ "functionCall": { "name": "reply", "args": arguments } });
                body["candidates"][0]["content"]["parts"] = json!([call]);
            }
            WireFormat::AnthropicMessages => {
                body["content"] = json!([{ "type": "tool_use", "id": "1", "name": "reply", "input": arguments }]);
            }
        }
        let server = Server::start(move |_, _| ok(&body));
        let bench = Bench::new(Limits::default());
        // The second reply comes from the journal.
        for _ in 0..2 {
            let vlm = bench.vlm(&server, wire_format);
            let reply = Bench::play(&vlm, "episode", 1).remove(0).unwrap();
            assert_eq!((reply.status, reply.repairs), (Status::Repaired, vec![Repair::ToolCall]), "{wire_format:?}");
            assert_eq!(reply.self_color.as_deref(), Some("red"), "{wire_format:?}");
        }
        assert_eq!(server.count(), 1);
    }
}

#[test]
fn arguments_as_an_object_and_the_older_form_of_a_call_are_taken() {
    let arguments: Value = serde_json::from_str(&decision("w")).unwrap();
    let call = json!([{ "function": { "name": "reply", "arguments": arguments } }]);
    let alone = vec![Repair::ToolCall];
    let messages = [
        (json!({ "content": null, "tool_calls": call }), alone.clone()),
        (json!({ "content": "", "function_call": { "name": "reply", "arguments": decision("w") } }), alone.clone()),
        (
            json!({ "content": null, "tool_calls": [], "function_call": { "name": "reply", "arguments": arguments } }),
            alone,
        ),
        (json!({ "content": "I answer:", "tool_calls": call }), vec![Repair::ToolCall, Repair::SurroundingText]),
        (json!({ "content": "<think>{1}</think>", "tool_calls": call }), vec![Repair::ToolCall, Repair::Thoughts]),
    ];
    for (message, repairs) in messages {
        let shown = message.to_string();
        let usage = json!({ "prompt_tokens": 100.0, "completion_tokens": 5.0 });
        let body = json!({ "choices": [{ "finish_reason": "stop", "message": message }], "usage": usage });
        let server = Server::start(move |_, _| ok(&body));
        let bench = Bench::new(Limits::default());
        let vlm = bench.vlm(&server, WireFormat::OpenaiChat);
        let reply = Bench::play(&vlm, "episode", 1).remove(0).unwrap();
        assert_eq!((reply.status, reply.repairs), (Status::Repaired, repairs), "{shown}");
        assert_eq!((reply.usage.prompt_tokens, reply.usage.completion_tokens), (Some(100), Some(5)), "{shown}");
    }
}

/// `record` of Gemini 2.5 Pro with this server.
fn record(folder: &Folder, server: &Server, words: &str) -> (Option<i32>, String) {
    let words = format!("--backend google --seeds 1 --max-output-tokens 100 {words}");
    let output = folder.record(server, "Gemini 2.5 Pro", &words).env("GEMINI_API_KEY", KEY).output().unwrap();
    (output.status.code(), stderr(&output))
}

/// An answer of an episode with two steps, by the model with this id.
fn by(id: &str, request: &Request, at: usize) -> Value {
    let mut body = spoken(WireFormat::Gemini, &counting(request, 2, at), endings(WireFormat::Gemini).0);
    body["modelVersion"] = id.into();
    body
}

#[test]
fn no_episode_is_lost_to_a_provider_that_allows_few_requests() {
    // Allows four requests per tenth of a second, for twelve simultaneous episodes of two steps.
    let window = Mutex::new((Instant::now(), 0));
    let server = Server::start(move |at, request| {
        let mut window = window.lock().unwrap();
        if window.0.elapsed() > Duration::from_millis(100) {
            *window = (Instant::now(), 0);
        }
        window.1 += 1;
        if window.1 > 4 { exhausted(A_MINUTE, "0.1s") } else { ok(&by("gemini-2.5-pro", request, at)) }
    });
    let folder = Folder::new();
    let (code, said) = record(&folder, &server, "--runs 12 --in-flight 12 --attempts 2");
    assert_eq!(code, Some(0), "{said}");
    assert!(server.count() > 24 && !folder.path().join("runs/lost.jsonl").exists(), "{said}");
}

#[test]
fn an_answer_by_another_model_stops_the_recording_before_the_second_request() {
    const OTHER: &str = "gemini-3.8-flash";
    let server = Server::start(|at, request| ok(&by(OTHER, request, at)));
    let folder = Folder::new();
    for _ in 0..2 {
        // The second answer comes from the journal.
        let (code, said) = record(&folder, &server, "--runs 4 --in-flight 4");
        assert_eq!((code, server.count()), (Some(2), 1), "{said}");
        let words =
            format!("asked for `gemini-2.5-pro`, found an answer by `{OTHER}`\n  help: `--accept-model {OTHER}`");
        assert!(said.contains(&words), "{said}");
    }
    let (code, said) = record(&folder, &server, &format!("--runs 4 --in-flight 4 --accept-model {OTHER}"));
    assert_eq!((code, server.count()), (Some(0), 8), "{said}");

    let trace = "runs/E1-gemini-2-5-pro.parquet";
    let recording = traces::recording(&folder.path().join(trace));
    assert_eq!(recording["agent"]["accepted_models"], json!([OTHER]));
    let note = format!("note: another model answered in {trace}: asked for `gemini-2.5-pro`, found `{OTHER}`\n");
    for words in [&["trace", "info", "runs"][..], &["trace", "validate", "runs"], &["report", "runs", "--no-figures"]] {
        let answer = run(folder.path(), words).ends(0);
        assert_eq!(answer.stderr.matches(&note).count(), 1, "{words:?}: {}", answer.stderr);
    }
}

#[test]
fn a_dated_snapshot_is_the_model_that_was_asked_for() {
    let server = Server::start(|at, request| ok(&by("models/gemini-2.5-pro-preview-06-05", request, at)));
    let folder = Folder::new();
    let (code, said) = record(&folder, &server, "--runs 1");
    assert_eq!((code, server.count()), (Some(0), 2), "{said}");
    let answer = run(folder.path(), &["report", "runs", "--no-figures"]).ends(0);
    assert!(!answer.stderr.contains("another model"), "{}", answer.stderr);
}

#[test]
fn a_refused_parameter_is_named_with_the_line_that_mends_it() {
    // Errors as each provider sends them: OpenAI's error reference, Anthropic's for Claude Sonnet 5, Google's for
    // Gemini 3, and OpenRouter's guide to provider routing.
    let openai = |param: &str, message: &str| json!({ "error": { "message": message, "type": "invalid_request_error", "param": param, "code": "unsupported_value" } });
    let cases = [
        (
            "openai-chat",
            "400 Bad Request",
            openai("temperature", "Unsupported value: 'temperature' does not support 0.2 with this model."),
            "temperature = \"default\"",
        ),
        (
            "anthropic-messages",
            "400 Bad Request",
            json!({ "type": "error", "error": { "type": "invalid_request_error", "message": "`temperature` is deprecated for this model." } }),
            "temperature = \"default\"",
        ),
        (
            "openai-chat",
            "400 Bad Request",
            openai(
                "reasoning_effort",
                "Unsupported value: 'reasoning_effort' does not support 'none' with this model.",
            ),
            "reasoning_effort = \"low\"",
        ),
        (
            "gemini",
            "400 Bad Request",
            json!({ "error": { "code": 400, "status": "INVALID_ARGUMENT", "message": "Thinking level MINIMAL is not supported for this model." } }),
            "reasoning_effort = \"low\"",
        ),
        (
            "openai-compatible",
            "400 Bad Request",
            openai("response_format", "Invalid parameter: 'response_format' of type 'json_schema' is not supported."),
            "contract = \"prompt\"",
        ),
        (
            "openai-compatible",
            "404 Not Found",
            json!({ "error": { "code": 404, "message": "No endpoints found that can handle the requested parameters." } }),
            "require_parameters = false",
        ),
    ];
    for (wire_format, status, body, line) in cases {
        let answer = http(status, "content-type: application/json\r\n", body.to_string().as_bytes());
        let server = Server::start(move |_, _| answer.clone());
        let folder = Folder::new();
        let own = format!(
            "[backend.own]\nwire_format = \"{wire_format}\"\nkey = \"MIRRORSTATS_API_KEY\"\n\
             [model.\"Own 1\"]\nbackend = \"own\"\nid = \"own-1\"\n"
        );
        std::fs::write(folder.path().join("own.toml"), own).unwrap();
        let words = "--models own.toml --backend own --seeds 1 --runs 1";
        let output = folder.record(&server, "Own 1", words).output().unwrap();
        let said = stderr(&output);
        assert_eq!((output.status.code(), server.count()), (Some(2), 1), "{said}");
        assert!(said.contains("[model.\"Own 1\"]") && said.contains(line), "{wire_format}: {said}");
    }
}

#[test]
fn extra_body_is_sent_and_fingerprinted_and_the_default_temperature_is_not_sent() {
    let asked = |wire_format: WireFormat, temperature: Option<f64>, extra: Value| {
        let server = Server::start(move |_, _| ok(&spoken(wire_format, &decision("w"), endings(wire_format).0)));
        let bench = Bench::new(Limits::default());
        let mut choice = choice(wire_format);
        choice.model.temperature = temperature;
        choice.model.extra_body = extra.as_object().unwrap().clone();
        let vlm = bench.vlm_of(&server, choice, patience());
        Bench::play(&vlm, "episode", 1).remove(0).unwrap();
        let recording = json!({ "agent": vlm.description() });
        (
            server.requests().remove(0).json(),
            Fingerprint::new(&recording, None, None).parts["sampling"].clone(),
            recording,
        )
    };
    for wire_format in PROVIDERS {
        let place = if wire_format == WireFormat::Gemini { "/generationConfig/temperature" } else { "/temperature" };
        let (plain, paper, _) = asked(wire_format, Some(0.2), json!({}));
        assert_eq!(plain.pointer(place), Some(&json!(0.2)), "{wire_format:?}");
        let extra =
            json!({ "service_tier": "flex", "generationConfig": { "mediaResolution": "MEDIA_RESOLUTION_HIGH" } });
        let (body, other, recording) = asked(wire_format, None, extra.clone());
        assert_eq!((body.pointer(place), &body["service_tier"]), (None, &json!("flex")), "{wire_format:?}");
        assert_eq!(body["generationConfig"]["mediaResolution"], "MEDIA_RESOLUTION_HIGH");
        assert_eq!(body["generationConfig"].get("maxOutputTokens").is_some(), wire_format == WireFormat::Gemini);
        assert_eq!(
            (&recording["agent"]["temperature"], &recording["agent"]["extra_body"]),
            (&json!("default"), &extra)
        );
        assert_ne!(paper, other, "{wire_format:?}");
    }
}

#[test]
fn tokens_from_a_cache_have_their_price_with_every_provider() {
    for wire_format in PROVIDERS {
        let mut body = spoken(wire_format, &decision("w"), endings(wire_format).0);
        // 1000 tokens per request, 400 of them cached; 100 per reply.
        match wire_format {
            // <https://platform.openai.com/docs/guides/prompt-caching>; OpenRouter's accounting has the same name.
            WireFormat::OpenaiChat | WireFormat::OpenaiCompatible => {
                body["usage"]["prompt_tokens_details"] = json!({ "cached_tokens": 400 });
            }
            // <https://ai.google.dev/gemini-api/docs/caching>: `promptTokenCount` includes the cached tokens.
            WireFormat::Gemini => body["usageMetadata"]["cachedContentTokenCount"] = json!(400),
            // <https://platform.claude.com/docs/en/build-with-claude/prompt-caching>: `input_tokens` excludes them.
            WireFormat::AnthropicMessages => {
                body["usage"]["input_tokens"] = json!(600);
                body["usage"]["cache_read_input_tokens"] = json!(400);
            }
        }
        let server = Server::start(move |_, _| ok(&body));
        let bench = Bench::new(Limits::default());
        let vlm = bench.vlm(&server, wire_format);
        let usage = Bench::play(&vlm, "episode", 1).remove(0).unwrap().usage;
        assert_eq!(usage.prompt_tokens, Some(1_000), "{wire_format:?}");
        // The bench's prices per million tokens: 1 dollar, cached 0.1, replies 10.
        assert!((usage.cost_usd.unwrap() - (600.0 + 40.0 + 1_000.0) / 1e6).abs() < 1e-12, "{wire_format:?}: {usage:?}");
    }
}

#[test]
fn an_id_that_no_file_has_is_recorded_with_a_warning() {
    let server = Server::start(|at, request| ok(&spoken(WireFormat::OpenaiChat, &counting(request, 2, at), "stop")));
    let folder = Folder::new();
    let words = "--backend openai --seeds 1 --runs 1 --accept-model model-1-0601";
    let output =
        folder.record(&server, "gpt-99", words).env("OPENAI_API_KEY", "sk-loopback-0123456789").output().unwrap();
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(said.starts_with("warning: no file of models has `gpt-99`: its prices are not known"), "{said}");
}

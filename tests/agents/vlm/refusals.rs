//! A provider's refusal loses a step or an episode. It ends the recording only if no request can succeed.

use std::fs;

use mirrorstats_agents::{Lost, Reply, Status};
use mirrorstats_vlm::Vlm;
use mirrorstats_vlm::limits::Limits;
use mirrorstats_vlm::wire_format::WireFormat;
use serde_json::{Value, json};

use super::bench::{Bench, KEY, choice};
use super::recordings::{Folder, counting, rows};
use super::server::{JSON, Server, decision, http, ok, whole};
use crate::harness::program::stderr;

const PROVIDERS: [WireFormat; 4] =
    [WireFormat::OpenaiChat, WireFormat::OpenaiCompatible, WireFormat::Gemini, WireFormat::AnthropicMessages];
const TOO_LONG: &str = "This model's maximum context length is 8192 tokens";

fn bad_request(error: &Value) -> Vec<u8> {
    http("400 Bad Request", JSON, error.to_string().as_bytes())
}

/// The error with which a provider refuses a request because of its content.
fn refusal(wire_format: WireFormat) -> Value {
    match wire_format {
        WireFormat::OpenaiChat => json!({ "error": { "message": "filtered", "type": null, "code": "content_filter",
            "status": 400, "innererror": { "code": "ResponsibleAIPolicyViolation" } } }),
        WireFormat::OpenaiCompatible => {
            json!({ "error": { "message": "against the rules", "type": "invalid_request_error",
            "code": "content_policy_violation" } })
        }
        WireFormat::Gemini => json!({ "promptFeedback": { "blockReason": "PROHIBITED_CONTENT" }, "usageMetadata": {} }),
        WireFormat::AnthropicMessages => json!({ "type": "error", "error": { "type": "invalid_request_error",
            "message": "Output blocked by content filtering policy" } }),
    }
}

fn too_long() -> Vec<u8> {
    bad_request(&json!({ "error": { "code": "context_length_exceeded", "type": "invalid_request_error",
        "message": TOO_LONG } }))
}

fn statuses(replies: &[Result<Reply, Lost>]) -> Vec<Status> {
    replies.iter().map(|reply| reply.as_ref().unwrap().status).collect()
}

#[test]
fn a_bad_request_that_refuses_costs_one_step_and_replays() {
    for wire_format in PROVIDERS {
        let server = Server::start(move |at, _| match at {
            1 => bad_request(&refusal(wire_format)),
            _ => whole(wire_format, &decision("w")),
        });
        let bench = Bench::new(Limits::default());
        let vlm = bench.vlm(&server, wire_format);
        let replies = Bench::play(&vlm, "episode", 3);
        assert_eq!(statuses(&replies), [Status::Ok, Status::Refusal, Status::Ok], "{wire_format:?}");
        assert_eq!((server.count(), vlm.stopped()), (3, None), "{wire_format:?}");
        let refused = replies[1].as_ref().unwrap();
        assert_eq!((refused.action, &refused.self_color, refused.usage.cost_usd), (None, &None, None));

        let again = Bench::play(&bench.vlm(&server, wire_format), "episode", 3);
        let cassette = Vlm::cassette(choice(wire_format), bench.folder.path().to_owned());
        assert_eq!(again, replies, "{wire_format:?}");
        assert_eq!(Bench::play(&cassette.into(), "episode", 3), replies, "{wire_format:?}");
        assert_eq!(server.count(), 3, "a refusal is not asked for again: {wire_format:?}");
    }
}

#[test]
fn refusals_are_known_in_all_their_forms() {
    let google = json!({ "error": { "code": 400, "status": "INVALID_ARGUMENT", "message": "blocked",
        "details": [{ "reason": "SAFETY" }] } });
    let flagged = json!({ "error": { "code": 403, "message": "flagged",
        "metadata": { "reasons": ["violence"], "flagged_input": "...", "provider_name": "OpenAI" } } });
    let cases = [
        ("an error with 200", WireFormat::OpenaiChat, ok(&refusal(WireFormat::OpenaiChat))),
        ("an end with 400", WireFormat::AnthropicMessages, bad_request(&json!({ "stop_reason": "refusal" }))),
        ("an end with 200", WireFormat::AnthropicMessages, ok(&json!({ "content": [], "stop_reason": "refusal" }))),
        (
            "a blocked prompt with 200",
            WireFormat::Gemini,
            ok(&json!({ "promptFeedback": { "blockReason": "SAFETY" } })),
        ),
        (
            "a candidate with 400",
            WireFormat::Gemini,
            bad_request(&json!({ "candidates": [{ "finishReason": "SAFETY" }] })),
        ),
        ("an error with 400", WireFormat::Gemini, bad_request(&google)),
        ("a moderator", WireFormat::OpenaiCompatible, http("403 Forbidden", JSON, flagged.to_string().as_bytes())),
    ];
    for (name, wire_format, answer) in cases {
        let server = Server::start(move |_, _| answer.clone());
        let bench = Bench::new(Limits::default());
        let replies = Bench::play(&bench.vlm(&server, wire_format), "episode", 1);
        assert_eq!(replies[0].as_ref().map(|reply| reply.status), Ok(Status::Refusal), "{name}");
        assert_eq!(server.count(), 1, "{name}");
    }
}

#[test]
fn a_bad_request_after_an_answer_costs_its_episode_alone() {
    for wire_format in PROVIDERS {
        let server = Server::start(move |at, _| match at {
            1 | 3 => too_long(),
            _ => whole(wire_format, &decision("w")),
        });
        let bench = Bench::new(Limits::default());
        let vlm = bench.vlm(&server, wire_format);
        let lost = Bench::play(&vlm, "long", 2).remove(1).unwrap_err();
        assert_eq!(lost.status, None);
        assert!(lost.cause.starts_with("step 2: the provider rejects this request: HTTP 400"), "{lost}");
        assert!(lost.cause.contains(TOO_LONG), "{lost}");
        assert_eq!(vlm.stopped(), None, "{wire_format:?}");
        assert_eq!(statuses(&Bench::play(&vlm, "short", 1)), [Status::Ok], "{wire_format:?}");

        // A restart knows from the journal that the model has answered.
        let again = bench.vlm(&server, wire_format);
        let replies = Bench::play(&again, "long", 2);
        assert!(replies[0].is_ok() && replies[1].is_err(), "{wire_format:?}");
        assert_eq!((server.count(), again.stopped()), (4, None), "{wire_format:?}");
    }
}

#[test]
fn a_key_or_a_model_that_is_refused_stops_everything_at_any_time() {
    for status in ["401 Unauthorized", "403 Forbidden", "404 Not Found"] {
        let server = Server::start(move |at, _| match at {
            0 => whole(WireFormat::OpenaiChat, &decision("w")),
            _ => http(status, JSON, br#"{"error": {"message": "no", "code": "denied"}}"#),
        });
        let bench = Bench::new(Limits::default());
        let vlm = bench.vlm(&server, WireFormat::OpenaiChat);
        let lost = Bench::play(&vlm, "episode", 3).remove(2).unwrap_err();
        assert!(lost.cause.starts_with(&format!("the provider refuses the request: HTTP {status}")), "{lost}");
        assert_eq!((vlm.stopped(), server.count()), (Some(lost.cause.as_str()), 2));
    }
}

/// Twenty episodes of two steps.
const TWENTY: &str = "--seeds 4 --runs 5 --threads 1 --in-flight 1 --json";

/// A server that gives `answer` to request number `special`, from 0; the other requests end their episodes at step 2.
fn server(special: usize, answer: Vec<u8>) -> Server {
    Server::start(move |at, request| {
        if at == special { answer.clone() } else { whole(WireFormat::OpenaiCompatible, &counting(request, 2, at)) }
    })
}

#[test]
fn one_refusal_in_a_recording_costs_one_step() {
    let server = server(3, bad_request(&refusal(WireFormat::OpenaiChat)));
    let folder = Folder::new();
    let output = folder.record(&server, "own", TWENTY).output().unwrap();
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{said}");
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&answer["recorded"], &answer["lost"]), (&20.into(), &json!([])), "{said}");
    assert_eq!(answer["replies"]["unreadable"], json!({ "refusal": 1 }));
    assert!(said.contains("replies could not be read: refusal; first: `filtered` (E1/own/s1/r2, step 2)"), "{said}");
    let recorded = fs::read(folder.path().join("runs/E1-own.parquet")).unwrap();
    assert_eq!(rows(&folder, "runs").iter().filter(|status| *status == "refusal").count(), 1);

    // Recording again from the journals, without a network, gives the same bytes.
    let output =
        folder.record(&server, "own", &format!("{TWENTY} --cassette runs/journal --out again")).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(fs::read(folder.path().join("again/E1-own.parquet")).unwrap(), recorded);
    fs::remove_file(folder.path().join("runs/E1-own.parquet")).unwrap();
    let before = server.count();
    let output = folder.record(&server, "own", TWENTY).output().unwrap();
    assert_eq!((output.status.code(), server.count()), (Some(0), before), "{}", stderr(&output));
    assert_eq!(fs::read(folder.path().join("runs/E1-own.parquet")).unwrap(), recorded);
}

#[test]
fn one_request_that_is_too_long_costs_one_episode() {
    let server = server(3, too_long());
    let folder = Folder::new();
    let output = folder.record(&server, "own", TWENTY).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&answer["recorded"], answer["lost"].as_array().unwrap().len()), (&19.into(), 1));
    let listed = fs::read_to_string(folder.path().join("runs/lost.jsonl")).unwrap();
    let lost: Value = serde_json::from_str(listed.trim()).unwrap();
    assert_eq!((&lost["episode_id"], &lost["step"]), (&"E1/own/s1/r2".into(), &2.into()));
    assert!(lost["reason"].as_str().unwrap().contains(TOO_LONG) && !listed.contains(KEY), "{listed}");

    let output = folder.record(&server, "own", TWENTY).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!((rows(&folder, "runs").len(), server.count()), (40, 41));
    assert!(!folder.path().join("runs/lost.jsonl").exists());
}

#[test]
fn a_continued_recording_remembers_that_the_model_answered() {
    let folder = Folder::new();
    let first = Server::start(|at, request| whole(WireFormat::OpenaiCompatible, &counting(request, 1, at)));
    let output = folder.record(&first, "own", "--seeds 1 --runs 1").output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    // The second start's first request is rejected, the others are not.
    let second = server(0, too_long());
    let output = folder.record(&second, "own", "--seeds 1 --runs 3 --threads 1 --in-flight 1").output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(stderr(&output).contains("recorded 1 episode"), "{}", stderr(&output));
}

#[test]
fn a_bad_request_before_any_answer_stops_everything() {
    let server = Server::start(|_, _| too_long());
    let folder = Folder::new();
    let output = folder.record(&server, "own", TWENTY).output().unwrap();
    assert_eq!((output.status.code(), server.count()), (Some(2), 1), "{}", stderr(&output));
    assert!(stderr(&output).contains("the provider refuses the request: HTTP 400"), "{}", stderr(&output));
}

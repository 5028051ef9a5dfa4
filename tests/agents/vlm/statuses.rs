//! Whatever a server does, the step gets the matching status or its episode is lost; decisions are never invented.

use std::time::{Duration, Instant};

use mirrorstats_agents::Status;
use mirrorstats_agents::reply::Repair;
use mirrorstats_vlm::limits::Limits;
use mirrorstats_vlm::provider::Patience;
use mirrorstats_vlm::wire_format::WireFormat;
use serde_json::json;

use super::bench::{Bench, KEY, patience};
use super::server::{Conduct, JSON, Server, decision, endings, http, ok, spoken, whole};

const PROVIDERS: [WireFormat; 4] =
    [WireFormat::OpenaiChat, WireFormat::OpenaiCompatible, WireFormat::Gemini, WireFormat::AnthropicMessages];

/// A name, the answer, and the status of the step.
type Case = (&'static str, Vec<u8>, Status);

/// Checks that each case ends in its status for this provider, after the number of attempts for that status.
fn check(wire_format: WireFormat, cases: Vec<Case>) {
    let bench = Bench::new(Limits::default());
    for (name, answer, status) in cases {
        let server = Server::start(move |_, _| answer.clone());
        let vlm = bench.vlm(&server, wire_format);
        let place = format!("{name}, {wire_format:?}");
        let reply = Bench::play(&vlm, &place.replace([' ', ','], "-"), 1).remove(0);
        let is_outage = matches!(status, Status::ServerError | Status::Timeout);
        if is_outage || status == Status::RateLimited {
            assert_eq!(reply.unwrap_err().status, Some(status), "{place}");
            assert_eq!(vlm.stopped(), None, "{place}");
        } else {
            let reply = reply.unwrap_or_else(|lost| panic!("{place}: {lost}"));
            assert_eq!(reply.status, status, "{place}");
            let repairs = Repair::joined(&reply.repairs);
            assert_eq!(repairs.as_deref(), (status == Status::Repaired).then_some("code_fence"), "{place}");
            let has_decision = matches!(status, Status::Ok | Status::Repaired);
            assert_eq!(reply.action.is_some(), has_decision, "{place}");
            assert_eq!(reply.self_color.as_deref(), has_decision.then_some("red"), "{place}");
        }
        match status {
            // A busy provider gets more requests than the limit on attempts.
            Status::RateLimited => assert!(server.count() > 3, "{place}: {}", server.count()),
            _ if name.starts_with("overloaded") => assert!(server.count() > 3, "{place}: {}", server.count()),
            _ => assert_eq!(server.count(), if is_outage { 3 } else { 1 }, "{place}"),
        }
    }
}

#[test]
fn replies_end_in_their_status_with_every_provider() {
    for wire_format in PROVIDERS {
        let (stop, length) = endings(wire_format);
        let text = |text: &str| ok(&spoken(wire_format, text, stop));
        let twice = decision("w").replacen('{', "{\"action\":\"s\",", 1);
        check(
            wire_format,
            vec![
                ("valid", text(&decision("w")), Status::Ok),
                ("fenced", text(&format!("```json\n{}\n```", decision("w"))), Status::Repaired),
                ("no JSON", text("I go on."), Status::ParseFailed),
                ("deep arrays", text(&"[".repeat(50_000)), Status::ParseFailed),
                ("deep objects", text(&"{\"action\":".repeat(5_000)), Status::ParseFailed),
                ("a key twice", text(&twice), Status::SchemaInvalid),
                ("another action", text(&decision("jump")), Status::SchemaInvalid),
                ("cut off", ok(&spoken(wire_format, &decision("w")[..20], length)), Status::Truncated),
                (
                    "white space up to the limit",
                    ok(&spoken(wire_format, &format!("{}\n\n\n", decision("w")), length)),
                    Status::Ok,
                ),
                ("no text", text(""), Status::Empty),
                ("blanks", text(" \n\t"), Status::Empty),
            ],
        );
    }
}

#[test]
fn a_lone_surrogate_in_an_answer_is_a_repair_with_every_provider() {
    for wire_format in PROVIDERS {
        // An escape in the answer's body or in the reply within, and the text that it becomes.
        for (escape, text) in [(r"\ud83d", "\u{fffd}"), (r"\\ud83d", "\u{fffd}"), (r"\ud83d\ude00", "\u{1f600}")] {
            let body =
                spoken(wire_format, &decision("w").replace("a wall", "HERE"), endings(wire_format).0).to_string();
            let answer = http("200 OK", JSON, body.replace("HERE", escape).as_bytes());
            let bench = Bench::new(Limits::default());
            let server = Server::start(move |_, _| answer.clone());
            let vlm = bench.vlm(&server, wire_format);
            // The second reply comes from the journal.
            for _ in 0..2 {
                let reply = Bench::play(&vlm, "E1-m-s1-r1", 1).remove(0).unwrap();
                let is_pair = text != "\u{fffd}";
                let expected =
                    if is_pair { (Status::Ok, None) } else { (Status::Repaired, Some("surrogate".to_owned())) };
                assert_eq!((reply.status, Repair::joined(&reply.repairs)), expected, "{escape}, {wire_format:?}");
                assert_eq!(reply.words.view_description.as_deref(), Some(text), "{escape}, {wire_format:?}");
                assert_eq!(reply.self_color.as_deref(), Some("red"));
            }
            assert_eq!(server.count(), 1, "{escape}, {wire_format:?}");
        }
    }
}

#[test]
fn failures_of_the_server_end_in_their_status_with_every_provider() {
    for wire_format in PROVIDERS {
        let fine = whole(wire_format, &decision("w"));
        let page = b"<html><body>Bad gateway</body></html>";
        let deep = format!("{{\"x\":{}{}}}", "[".repeat(5_000), "]".repeat(5_000));
        let huge = vec![b' '; 200_000];
        let cut = |status: &str| format!("HTTP/1.1 {status}\r\ncontent-length: 100\r\n\r\nhalf").into_bytes();
        let overloaded = br#"{"error": {"message": "The model is overloaded. Please try again later."}}"#;
        let too_many = |headers: &str| http("429 Too Many Requests", headers, b"slow down");
        check(
            wire_format,
            vec![
                ("429 alone", too_many(""), Status::RateLimited),
                ("429 with seconds", too_many("retry-after: 0\r\n"), Status::RateLimited),
                ("429 with a date", too_many("retry-after: Sun, 06 Nov 1994 08:49:37 GMT\r\n"), Status::RateLimited),
                ("429 with nonsense", too_many("retry-after: -1 soon\r\n"), Status::RateLimited),
                (
                    "429 with a list",
                    http("429 Too Many Requests", JSON, br#"[{"error": {"code": 429}}]"#),
                    Status::RateLimited,
                ),
                ("429 with a text", http("429 Too Many Requests", JSON, br#""slow down""#), Status::RateLimited),
                ("429 with a number", http("429 Too Many Requests", JSON, b"429"), Status::RateLimited),
                ("429 with an exponent", too_many("retry-after: 1e3\r\n"), Status::RateLimited),
                ("429 cut", cut("429 Too Many Requests"), Status::RateLimited),
                ("429 and huge", http("429 Too Many Requests", "", &huge), Status::RateLimited),
                ("408", http("408 Request Timeout", "", b""), Status::Timeout),
                ("500", http("500 Internal Server Error", "", b"oops"), Status::ServerError),
                ("503", http("503 Service Unavailable", "retry-after: 0\r\n", b""), Status::ServerError),
                ("504", http("504 Gateway Timeout", "", page), Status::Timeout),
                ("overloaded, 503", http("503 Service Unavailable", JSON, overloaded), Status::ServerError),
                ("overloaded, 529", http("529 Overloaded", JSON, br#"{"type": "error"}"#), Status::ServerError),
                ("no type", http("200 OK", "", b"{}"), Status::ServerError),
                ("another language", http("200 OK", JSON, br#"{"hello": 1}"#), Status::ServerError),
                ("an array", http("200 OK", JSON, b"[]"), Status::ServerError),
                ("nothing in it", http("200 OK", JSON, b""), Status::ServerError),
                ("an error with 200", ok(&json!({ "error": { "code": 502 } })), Status::ServerError),
                ("not UTF-8", http("200 OK", JSON, b"{\"choices\": \"\xff\"}"), Status::ServerError),
                ("deep", http("200 OK", JSON, deep.as_bytes()), Status::ServerError),
                ("huge", http("200 OK", JSON, &huge), Status::ServerError),
                ("no HTTP", b"220 smtp ready\r\n\r\n".to_vec(), Status::ServerError),
                ("cut before the head's end", b"HTTP/1.1 200 OK\r\ncontent-ty".to_vec(), Status::ServerError),
                ("cut in the body", cut("200 OK"), Status::ServerError),
                ("cut before the last byte", fine[..fine.len() - 1].to_vec(), Status::ServerError),
                ("closed", Vec::new(), Status::ServerError),
            ],
        );
    }
}

#[test]
fn refusals_and_empty_answers_have_each_providers_own_form() {
    let openai = |choice| ok(&json!({ "choices": [choice], "usage": {} }));
    check(
        WireFormat::OpenaiChat,
        vec![
            (
                "a refusal",
                openai(json!({ "finish_reason": "stop", "message": { "content": null, "refusal": "I can't." } })),
                Status::Refusal,
            ),
            ("a filter", ok(&spoken(WireFormat::OpenaiChat, "", "content_filter")), Status::Refusal),
            ("null", openai(json!({ "finish_reason": "stop", "message": { "content": null } })), Status::Empty),
            ("no choice", http("200 OK", JSON, br#"{"choices": [], "usage": {}}"#), Status::Empty),
            ("half an answer", ok(&spoken(WireFormat::OpenaiChat, &decision("w"), "error")), Status::ServerError),
            (
                "parts of reasoning alone",
                openai(json!({ "message": { "content": [{ "type": "reasoning_text", "text": decision("w") }] } })),
                Status::Empty,
            ),
            ("choices of another kind", ok(&json!({ "choices": null })), Status::ServerError),
        ],
    );
    let part = |part| ok(&json!({ "candidates": [{ "content": { "parts": [part] }, "finishReason": "STOP" }] }));
    let blocked = json!({ "promptFeedback": { "blockReason": "SAFETY" }, "usageMetadata": {} });
    check(
        WireFormat::Gemini,
        vec![
            ("a blocked prompt", ok(&blocked), Status::Refusal),
            ("unsafe", ok(&spoken(WireFormat::Gemini, &decision("w"), "SAFETY")), Status::Refusal),
            ("prohibited", ok(&json!({ "candidates": [{ "finishReason": "PROHIBITED_CONTENT" }] })), Status::Refusal),
            ("no content", ok(&json!({ "candidates": [{ "finishReason": "STOP" }] })), Status::Empty),
            ("no candidate", ok(&json!({ "candidates": [], "usageMetadata": {} })), Status::Empty),
            ("thoughts alone", ok(&spoken(WireFormat::Gemini, "", "MAX_TOKENS")), Status::Truncated),
            ("a part of thoughts", part(json!({ "thought": "true", "text": decision("w") })), Status::Empty),
            (
                "a call in thoughts",
                part(json!({ "thought": true, "functionCall": { "name": "reply", "args": { "action": "w" } } })),
                Status::Empty,
            ),
        ],
    );
    let anthropic = |content, reason| ok(&json!({ "content": content, "stop_reason": reason }));
    check(
        WireFormat::AnthropicMessages,
        vec![
            ("a refusal", anthropic(json!([]), "refusal"), Status::Refusal),
            ("half a refusal", ok(&spoken(WireFormat::AnthropicMessages, "I w", "refusal")), Status::Refusal),
            ("no block", anthropic(json!([]), "end_turn"), Status::Empty),
            ("no text", anthropic(json!([{ "type": "thinking", "thinking": "hm" }]), "end_turn"), Status::Empty),
            ("a window too small", anthropic(json!([]), "model_context_window_exceeded"), Status::Truncated),
        ],
    );
}

#[test]
fn reasons_of_other_providers_are_understood_in_every_wire_format() {
    for wire_format in PROVIDERS {
        let cut = &decision("w")[..20];
        let ended = |reason: &str| ok(&spoken(wire_format, cut, reason));
        let cases = [
            ("length", Status::Truncated),
            ("MAX_TOKENS", Status::Truncated),
            ("max_tokens", Status::Truncated),
            ("content_filter", Status::Refusal),
            ("SAFETY", Status::Refusal),
            ("RECITATION", Status::Refusal),
            ("refusal", Status::Refusal),
            ("end_turn", Status::ParseFailed),
            ("STOP", Status::ParseFailed),
        ];
        check(wire_format, cases.into_iter().map(|(reason, status)| (reason, ended(reason), status)).collect());
    }
}

#[test]
fn a_text_that_the_provider_could_not_validate_is_a_step_without_a_decision() {
    let rejected = |code: &str, text: &str| {
        let error =
            json!({ "error": { "message": "Failed to generate JSON.", "code": code, "failed_generation": text } });
        http("400 Bad Request", JSON, error.to_string().as_bytes())
    };
    for wire_format in PROVIDERS {
        let cases = vec![
            ("invalid JSON", rejected("json_validate_failed", "{\"action\": "), Status::ParseFailed),
            ("a failed call", rejected("tool_use_failed", "<function=reply>"), Status::ParseFailed),
        ];
        check(wire_format, cases);
    }
}

#[test]
fn permanent_refusals_end_the_run_at_once() {
    let credit = br#"{"error": {"type": "insufficient_quota", "message": "no credit"}}"#;
    let cases: [(&str, &[u8]); 6] = [
        ("401 Unauthorized", b"who are you"),
        ("402 Payment Required", b"no credit"),
        ("403 Forbidden", b""),
        ("404 Not Found", b"<html>no such model</html>"),
        ("400 Bad Request", br#"{"error": "temperature"}"#),
        ("429 Too Many Requests", credit),
    ];
    for (status, body) in cases {
        for wire_format in PROVIDERS {
            let server = Server::start(move |_, _| http(status, "", body));
            let bench = Bench::new(Limits::default());
            let vlm = bench.vlm(&server, wire_format);
            let replies = Bench::play(&vlm, "episode", 2);
            let reasons: Vec<_> = replies.into_iter().map(|reply| reply.unwrap_err().cause).collect();
            let sentence = format!("the provider refuses the request: HTTP {status}");
            let said = reasons[0].split("\n  help: the parameter is").next().unwrap();
            assert!(said.starts_with(&sentence) && !said.contains('\n'), "{}", reasons[0]);
            assert_eq!(reasons[1], reasons[0]);
            assert_eq!(vlm.stopped(), Some(reasons[0].as_str()));
            assert_eq!(server.count(), 1, "{status} {wire_format:?}");
        }
    }
}

#[test]
fn a_redirect_is_not_followed() {
    let elsewhere = Server::start(|_, _| whole(WireFormat::OpenaiChat, &decision("w")));
    let address = elsewhere.address.clone();
    for status in ["301 Moved Permanently", "302 Found", "307 Temporary Redirect", "308 Permanent Redirect"] {
        let location = format!("location: {address}/chat/completions\r\n");
        let server = Server::start(move |_, _| http(status, &location, b""));
        let bench = Bench::new(Limits::default());
        let lost = Bench::play(&bench.vlm(&server, WireFormat::OpenaiChat), "episode", 1).remove(0);
        assert!(lost.unwrap_err().cause.contains(status));
        assert!(server.requests()[0].head.contains(KEY));
    }
    assert_eq!(elsewhere.count(), 0, "nobody else gets the key");
}

#[test]
fn an_answer_that_takes_too_long_is_a_timeout_wherever_it_hangs() {
    let impatient = Patience { attempts: 2, timeout: Duration::from_millis(150), ..patience() };
    let pause = Duration::from_millis(40);
    let fine = || whole(WireFormat::OpenaiChat, &decision("w"));
    let slow: [(&str, Conduct); 3] = [
        ("nothing", Conduct::dripping(Vec::new(), 1, Duration::from_secs(1))),
        ("drips from the start", Conduct::dripping(fine(), 5, pause)),
        ("drips in the body", Conduct::dripping(fine(), fine().len() - 20, Duration::from_millis(100))),
    ];
    for (name, conduct) in slow {
        let server = Server::start(move |_, _| conduct.clone());
        let bench = Bench::new(Limits::default());
        let vlm = bench.vlm_with(&server, WireFormat::OpenaiChat, impatient);
        let lost = Bench::play(&vlm, "lost", 1).remove(0).unwrap_err();
        assert_eq!(lost.status, Some(Status::Timeout), "{name}");
        assert!(lost.cause.starts_with("step 1: timeout after 2 attempts"), "{name}: {lost}");
    }
}

#[test]
fn slow_bytes_in_time_are_an_answer() {
    let server = Server::start(|_, _| {
        Conduct::dripping(whole(WireFormat::Gemini, &decision("w")), 16, Duration::from_millis(1))
    });
    let bench = Bench::new(Limits::default());
    let reply = Bench::play(&bench.vlm(&server, WireFormat::Gemini), "episode", 1).remove(0).unwrap();
    assert_eq!((reply.status, server.count()), (Status::Ok, 1));
}

#[test]
fn retry_after_is_respected() {
    let server = Server::start(|at, _| match at {
        0 => http("429 Too Many Requests", "retry-after: 1\r\n", b""),
        _ => whole(WireFormat::AnthropicMessages, &decision("w")),
    });
    let bench = Bench::new(Limits::default());
    let patience = Patience { longest_wait: Duration::from_secs(5), ..patience() };
    let vlm = bench.vlm_with(&server, WireFormat::AnthropicMessages, patience);
    let start = Instant::now();
    assert_eq!(Bench::play(&vlm, "episode", 1).remove(0).unwrap().status, Status::Ok);
    assert!(start.elapsed() >= Duration::from_secs(1), "the provider would have been asked too early");
}

//! A provider that cannot serve the recording ends it at once: it cannot be reached, or it accepts no images.

use std::net::TcpListener;

use mirrorstats_agents::LostKind;
use mirrorstats_vlm::limits::Limits;
use mirrorstats_vlm::wire_format::WireFormat;
use serde_json::json;

use super::bench::{Bench, KEY};
use super::recordings::{Folder, counting};
use super::server::{JSON, Server, decision, http, ok, whole};
use crate::harness::program::stderr;

/// Variables that send requests through a proxy, which would be reached instead of the server.
const PROXIES: [&str; 6] = ["HTTP_PROXY", "http_proxy", "HTTPS_PROXY", "https_proxy", "ALL_PROXY", "all_proxy"];

/// Runs `record` with this server and without a proxy.
fn recorded(folder: &Folder, server: &Server, words: &str) -> (Option<i32>, String) {
    let mut command = folder.record(server, "own", words);
    for name in PROXIES {
        command.env_remove(name);
    }
    let output = command.output().unwrap();
    (output.status.code(), stderr(&output))
}

#[test]
fn an_unreachable_address_is_reported_before_recording() {
    let folder = Folder::new();
    let server = Server::start(|at, request| whole(WireFormat::OpenaiCompatible, &counting(request, 1, at)));
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let words = format!("--seeds 1 --runs 2 --base-url http://127.0.0.1:{port}/v1");
    let (code, said) = recorded(&folder, &server, &words);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.starts_with(&format!("error: cannot connect to http://127.0.0.1:{port}: ")), "{said}");
    assert!(said.contains("\n  help: is the address right") && !said.contains(KEY) && !said.contains("lost"), "{said}");
    assert!(!folder.path().join("runs").exists(), "nothing is made");

    // A reachable address gets no request before the first episode. A recording with nothing to do does not need the
    // server.
    let (code, said) = recorded(&folder, &server, "--seeds 1 --runs 2");
    assert_eq!((code, server.count()), (Some(0), 2), "{said}");
    let (code, said) = recorded(&folder, &server, &words);
    assert_eq!((code, server.count()), (Some(0), 2), "{said}");
    let (code, said) = recorded(&folder, &server, &format!("{words} --cassette runs/journal --out again"));
    assert_eq!(code, Some(0), "a cassette needs nobody: {said}");
}

#[test]
fn a_server_that_takes_no_images_ends_the_recording_with_its_first_answer() {
    let message = "image input is not supported - hint: if this is unexpected, you may need to provide the mmproj";
    let error = json!({ "error": { "code": 500, "message": message, "type": "server_error" } });
    let body = error.to_string().into_bytes();
    for answer in [http("500 Internal Server Error", JSON, &body), http("400 Bad Request", JSON, &body), ok(&error)] {
        let server = Server::start(move |_, _| answer.clone());
        let folder = Folder::new();
        let (code, said) = recorded(&folder, &server, "--seeds 1 --runs 3 --threads 1 --in-flight 1");
        assert_eq!((code, server.count()), (Some(2), 1), "{said}");
        assert!(said.contains("takes no images: ") && said.contains(message), "{said}");
        assert!(said.contains("\n  help: choose a model that sees"), "{said}");
        assert!(!said.contains(r"\u{a}"), "{said}");
    }
}

#[test]
fn an_answer_in_another_shape_ends_the_recording_with_its_first_answer() {
    let text = json!([{ "type": "output_text", "text": decision("w") }]);
    let responses = json!({ "object": "response", "output": [{ "type": "message", "content": text }] });
    let chunk = json!({ "choices": [{ "delta": { "content": decision("w") } }] });
    let stream = format!("data: {chunk}\n\ndata: [DONE]\n\n");
    let page = "<html><body>Welcome</body></html>";
    for (answer, found) in [
        (ok(&responses), "an answer of OpenAI's Responses"),
        (http("200 OK", "content-type: text/event-stream\r\n", stream.as_bytes()), "a stream of events"),
        (http("200 OK", "content-type: text/html\r\n", page.as_bytes()), "a page of HTML or XML"),
        (http("200 OK", JSON, page.as_bytes()), "a page of HTML or XML"),
    ] {
        let server = Server::start(move |_, _| answer.clone());
        let folder = Folder::new();
        let (code, said) = recorded(&folder, &server, "--seeds 1 --runs 3 --threads 1 --in-flight 1");
        assert_eq!((code, server.count()), (Some(2), 1), "{said}");
        let expected = format!("expected an answer of the wire format \"openai-compatible\", found {found}: ");
        assert!(said.contains(&expected), "{said}");
        assert!(said.contains("\n  help: check `--base-url` and the backend's `wire_format`"), "{said}");
    }
}

#[test]
fn a_page_after_an_answer_is_an_outage() {
    let server = Server::start(|at, _| match at {
        1 => http("200 OK", "content-type: text/html\r\n", b"<html>Bad gateway</html>"),
        _ => whole(WireFormat::OpenaiChat, &decision("w")),
    });
    let bench = Bench::new(Limits::default());
    let vlm = bench.vlm(&server, WireFormat::OpenaiChat);
    let replies = Bench::play(&vlm, "episode", 2);
    assert!(replies.iter().all(Result::is_ok), "{replies:?}");
    assert_eq!((vlm.stopped(), server.count()), (None, 3));
}

#[test]
fn refused_images_are_a_failure_not_an_outage() {
    let server = Server::start(|at, _| match at {
        0 => whole(WireFormat::OpenaiChat, &decision("w")),
        _ => http("500 Internal Server Error", JSON, br#"{"error":"this model does not support images"}"#),
    });
    let bench = Bench::new(Limits::default());
    let vlm = bench.vlm(&server, WireFormat::OpenaiChat);
    let lost = Bench::play(&vlm, "episode", 2).remove(1).unwrap_err();
    assert!(lost.cause.contains("takes no images") && lost.kind == LostKind::Failure, "{lost}");
    assert_eq!((vlm.stopped(), server.count()), (Some(lost.cause.as_str()), 2));
}

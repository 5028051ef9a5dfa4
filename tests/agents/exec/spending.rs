//! A model behind a server on loopback, from the command line: the spending is reported, and a failing server loses an
//! episode under the failure's name.

use mirrorstats_vlm::wire_format::WireFormat;
use serde_json::Value;

use super::recordings::{Bench, FORWARD, done, outcome};
use crate::vlm::server::{JSON, Server, http, spoken};

/// An answer with this status and reply.
fn answer(status: &str, reply: &str) -> Vec<u8> {
    http(status, JSON, spoken(WireFormat::OpenaiCompatible, reply, "stop").to_string().as_bytes())
}

#[test]
fn spending_is_printed_over_all_starts() {
    let bench = Bench::new();
    let model = "[model.Loop]\nbackend = \"compatible\"\nid = \"m\"\nanswers_as = [\"model-1-0601\"]\nprices = { input = 1.0, output = 10.0 }\n";
    std::fs::write(bench.path("models.toml"), model).unwrap();
    // The second request fails; the fourth gets `done`.
    let server = Server::start(|at, _| match at {
        1 => answer("500 Internal Server Error", ""),
        3 => answer("200 OK", &done()),
        _ => answer("200 OK", FORWARD),
    });
    let words = ["--model", "Loop", "--models", "models.toml", "--base-url", &server.address, "--attempts", "1"];
    let (code, answer, said) = outcome(&bench.record_of("vlm", &words).output().unwrap());
    assert_eq!((code, &answer["recorded"]), (Some(1), &0.into()), "{said}");
    let lost = &answer["lost"][0];
    assert_eq!((&lost["step"], &lost["status"]), (&2.into(), &"server_error".into()));
    assert_eq!(bench.lost(), std::slice::from_ref(lost));
    assert_eq!((&answer["spend"]["requests"], &answer["spend"]["tokens"]), (&2.into(), &1100.into()));
    assert!(said.contains("spent: 0.0020 US dollars for 2 requests and 1100 tokens"), "{said}");

    let (code, answer, said) = outcome(&bench.record_of("vlm", &words).output().unwrap());
    assert_eq!((code, &answer["recorded"], &answer["steps"]), (Some(0), &1.into(), &3.into()), "{said}");
    assert_eq!((&answer["spend"]["requests"], &answer["spend"]["tokens"]), (&4.into(), &3300.into()));
    assert!(!bench.path("runs/lost.jsonl").exists());

    // A cassette costs nothing.
    let played = ["--cassette", "runs/journal", "--out", "again"];
    let (code, answer, said) = outcome(&bench.record_of("vlm", &[&words[..], &played].concat()).output().unwrap());
    assert_eq!((code, &answer["spend"]), (Some(0), &Value::Null), "{said}");
}

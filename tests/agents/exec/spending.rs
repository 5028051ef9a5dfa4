//! A model behind a server on loopback, from the command line: what was spent is told, and a failing server loses an
//! episode under the name of its failure.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpListener;
use std::sync::atomic::{AtomicUsize, Ordering};

use serde_json::{Value, json};

use super::recordings::{Bench, FORWARD, done, outcome};

/// A server whose n-th answer, from 1, is this status and reply.
fn serve(script: impl Fn(usize) -> (u16, String) + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("http://{}/v1", listener.local_addr().unwrap());
    let count = AtomicUsize::new(0);
    std::thread::spawn(move || {
        for mut stream in listener.incoming().flatten() {
            let mut reader = BufReader::new(stream.try_clone().unwrap());
            let (mut line, mut length) = (String::new(), 0);
            while reader.read_line(&mut line).unwrap_or(0) > 2 {
                if let Some(value) = line.to_ascii_lowercase().strip_prefix("content-length:") {
                    length = value.trim().parse().unwrap();
                }
                line.clear();
            }
            std::io::copy(&mut reader.take(length), &mut std::io::sink()).unwrap();
            let (status, text) = script(count.fetch_add(1, Ordering::SeqCst) + 1);
            let body = json!({
                "choices": [{ "index": 0, "finish_reason": "stop", "message": { "role": "assistant", "content": text } }],
                "usage": { "prompt_tokens": 1000, "completion_tokens": 100 },
            })
            .to_string();
            let head = format!("HTTP/1.1 {status} X\r\nconnection: close\r\ncontent-type: application/json\r\n");
            let _ = write!(stream, "{head}content-length: {}\r\n\r\n{body}", body.len());
        }
    });
    address
}

#[test]
fn what_was_spent_is_told_over_all_starts() {
    let Some(bench) = Bench::new() else { return };
    let model = "[model.Loop]\nbackend = \"compatible\"\nid = \"m\"\nprices = { input = 1.0, output = 10.0 }\n";
    std::fs::write(bench.path("models.toml"), model).unwrap();
    // The second request fails, the fourth is answered with `done`.
    let address = serve(|n| match n {
        2 => (500, String::new()),
        4 => (200, done()),
        _ => (200, FORWARD.to_owned()),
    });
    let words = ["--model", "Loop", "--models", "models.toml", "--base-url", &address, "--attempts", "1"];
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
    assert!(said.contains("time: rendering"), "{said}");

    // A cassette costs nothing.
    let played = ["--cassette", "runs/journal", "--out", "again"];
    let (code, answer, said) = outcome(&bench.record_of("vlm", &[&words[..], &played].concat()).output().unwrap());
    assert_eq!((code, &answer["spend"]), (Some(0), &Value::Null), "{said}");
}

//! Keys are sent in a header and appear nowhere else.

use std::fs;
use std::path::Path;
use std::process::Output;

use base64::Engine as _;
use base64::engine::general_purpose::{STANDARD, URL_SAFE_NO_PAD};
use mirrorstats_vlm::limits::Limits;
use mirrorstats_vlm::wire_format::WireFormat;

use super::bench::{Bench, KEY};
use super::recordings::Folder;
use super::server::{JSON, Server, decision, http, whole};
use crate::harness::program::stderr;

#[test]
fn keys_are_in_no_file_and_no_message() {
    let echo = format!("{{\"error\": \"your key {KEY} is wrong\"}}");
    let server = Server::start(move |at, _| match at {
        0 => http("500 Internal Server Error", JSON, echo.as_bytes()),
        1 => whole(WireFormat::OpenaiChat, &decision("w").replace("a wall", KEY)),
        _ => http("401 Unauthorized", JSON, echo.as_bytes()),
    });
    let bench = Bench::new(Limits::default());
    let vlm = bench.vlm(&server, WireFormat::OpenaiChat);
    let replies = Bench::play(&vlm, "episode", 2);
    assert_eq!(replies[0].as_ref().unwrap().words.view_description.as_deref(), Some("[key]"));
    let refused = replies[1].as_ref().unwrap_err();
    assert!(refused.cause.contains("refuses the request: HTTP 401") && refused.cause.contains("[key]"), "{refused}");
    assert!(vlm.stopped().is_some());
    let told = format!("{replies:?}{vlm:?}{}{}", bench.written(), vlm.description());
    assert!(!told.contains(KEY));
    assert!(server.requests()[0].head.contains(KEY), "the header does carry it");
}

/// All files and output of a recording.
fn everything(folder: &Path, output: &Output) -> Vec<u8> {
    let mut bytes = [output.stdout.as_slice(), &output.stderr].concat();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            bytes.extend_from_slice(path.to_string_lossy().as_bytes());
            if path.is_dir() {
                folders.push(path);
            } else {
                bytes.extend(fs::read(path).unwrap());
            }
        }
    }
    bytes
}

fn has(bytes: &[u8], words: &str) -> bool {
    bytes.windows(words.len()).any(|window| window == words.as_bytes())
}

/// Records a short episode with everything that makes programs verbose, and checks every byte.
fn check(server: &Server, key: &str, words: &str) -> String {
    let folder = Folder::new();
    let mut command = folder.record(server, "own", &format!("--seeds 1 --runs 1 --json {words}"));
    command.env("MIRRORSTATS_API_KEY", key).env("RUST_LOG", "trace").env("RUST_BACKTRACE", "full");
    let output = command.output().unwrap();
    let written = everything(folder.path(), &output);
    assert!(!has(&written, key), "{}", stderr(&output));
    // Nor its first or last 12 bytes.
    assert!(!has(&written, &key[..12]) && !has(&written, &key[key.len() - 12..]), "{}", stderr(&output));
    stderr(&output)
}

#[test]
fn a_key_echoed_by_the_server_is_not_printed_or_stored() {
    let statuses = ["200 OK", "307 Temporary Redirect", "400 Bad Request", "401 Unauthorized", "404 Not Found"];
    for status in statuses {
        let server = Server::start(move |_, request| {
            // The key is where a shortened text may end.
            let padded = format!("{}{}", " .".repeat(130), request.head);
            let location = format!("location: http://elsewhere/?{KEY}\r\n{JSON}");
            http(status, &location, serde_json::json!({ "error": padded }).to_string().as_bytes())
        });
        check(&server, KEY, "--attempts 1");
        assert!(server.requests()[0].head.contains(KEY));
    }
    let server = Server::start(|_, request| {
        let echo = decision("done").replace("a wall", &request.head.replace("\r\n", " "));
        whole(WireFormat::OpenaiCompatible, &echo)
    });
    check(&server, KEY, "");
    assert_eq!(server.count(), 1);
}

#[test]
fn a_key_in_another_form_is_not_printed_or_stored() {
    let hex = KEY.bytes().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().concat();
    let percent = KEY.bytes().map(|byte| format!("%{byte:02x}")).collect::<Vec<_>>().concat();
    let reversed: String = KEY.chars().rev().collect();
    let forms = [hex.to_lowercase(), hex, percent, reversed, STANDARD.encode(KEY), URL_SAFE_NO_PAD.encode(KEY)];
    for form in &forms {
        let echo = serde_json::json!({ "error": format!("your key {form} is wrong") }).to_string();
        let words = decision("done").replace("a wall", form);
        let server = Server::start(move |at, _| match at {
            0 => http("500 Internal Server Error", JSON, echo.as_bytes()),
            1 => whole(WireFormat::OpenaiChat, &words),
            _ => http("401 Unauthorized", JSON, echo.as_bytes()),
        });
        let bench = Bench::new(Limits::default());
        let vlm = bench.vlm(&server, WireFormat::OpenaiChat);
        let replies = Bench::play(&vlm, "episode", 2);
        let told = format!("{replies:?}{}", bench.written());
        assert!(!told.contains(form) && told.contains("[key]"), "{form}: {told}");
    }
}

#[test]
fn a_misplaced_key_is_not_printed() {
    let server = Server::start(|_, _| whole(WireFormat::OpenaiCompatible, &decision("a")));
    let told = check(&server, KEY, &format!("--base-url http://127.0.0.1/v1?key={KEY}"));
    assert!(told.contains("query"), "{told}");
    let told = check(&server, KEY, &format!("--base-url http://me:{KEY}@127.0.0.1/v1"));
    assert!(told.contains("password"), "{told}");
    let told = check(&server, KEY, &format!("--base-url {KEY}"));
    assert!(told.contains("[key]"), "{told}");
    let told = check(&server, KEY, "--base-url http://192.0.2.1/v1");
    assert!(told.contains("everyone on the way") && told.contains("plain_http = true"), "{told}");
    let told = check(&server, "sk-loopback\n0123456789-0123456789", "");
    assert!(told.contains("no header can carry"), "{told}");
    assert_eq!(server.count(), 0);
}

#[test]
fn a_placeholder_key_leaves_answers_unchanged() {
    let server = Server::start(|_, _| whole(WireFormat::OpenaiCompatible, &decision("done")));
    let folder = Folder::new();
    let mut command = folder.record(&server, "own", "--seeds 1 --runs 1");
    let output = command.env("MIRRORSTATS_API_KEY", "none").output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let journals = format!("{:?}", folder.journals());
    assert!(journals.contains("none") && !journals.contains("[key]"), "{journals}");
}

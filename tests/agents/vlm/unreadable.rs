//! Unreadable replies are reported when they arrive, at the end, and from the trace.

use mirrorstats_vlm::wire_format::WireFormat;
use serde_json::{Value, json};

use super::bench::KEY;
use super::recordings::Folder;
use super::server::{Request, Server, decision, ok, spoken, whole};
use crate::harness::files::write_small_world;
use crate::harness::program::{run, stderr};
use crate::harness::traces;

/// A folder with episodes of 20 steps.
fn short() -> Folder {
    let folder = Folder::new();
    write_small_world(folder.path(), "episode.steps = 20\n");
    folder
}

/// The output of a command on the traces in `runs`, as text and as JSON.
fn told(folder: &Folder, verb: &str) -> (String, Value) {
    (run(folder.path(), &["trace", verb, "runs"]).done(), run(folder.path(), &["trace", verb, "runs", "--json"]).json())
}

#[test]
fn a_recording_without_readable_replies_says_so_everywhere() {
    let reply = format!("I go on.\n\u{1b}[31m{KEY} {}", "on and ".repeat(100));
    let server = Server::start(move |_, _| whole(WireFormat::OpenaiCompatible, &reply));
    let folder = short();
    let output = folder.record(&server, "own", "--seeds 2 --runs 5 --json --keep-going").output().unwrap();
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{said}");
    let start = r"`I go on.\u{a}\u{1b}[31m[key] on and on and";
    let summary = format!("\n200 of 200 replies could not be read: parse_failed; first: {start}");
    assert!(said.contains(&summary), "{said}");
    assert!(said.contains("...` (E1/own/s1/r1, step 1): expected a JSON object, found text without one\n"), "{said}");
    // It is reported before the recording ends.
    assert!(said.starts_with(&format!("a reply could not be read: parse_failed: {start}")), "{said}");
    assert!(said.lines().all(|line| line.len() < 400) && !said.contains('\u{1b}') && !said.contains(KEY), "{said}");

    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    let replies = &answer["replies"];
    assert_eq!((&replies["replies"], &replies["unreadable"]), (&200.into(), &json!({ "parse_failed": 200 })));
    let first = &replies["first_unreadable"];
    assert_eq!((&first["episode_id"], &first["step"]), (&"E1/own/s1/r1".into(), &1.into()));
    assert!(first["text"].as_str().unwrap().len() <= 203, "{first}");
    // The trace, the answer and the check state the parser's reason.
    let why = "expected a JSON object, found text without one";
    assert_eq!(first["fault"], why);
    let faults = traces::texts(&folder.path().join("runs/E1-own.parquet"), "reply_fault");
    assert_eq!(faults, vec![Some(why.to_owned()); 200]);
    let checked = run(folder.path(), &["trace", "check", "runs", "--max-unreadable", "0.5"]);
    let text = checked.ends(1).stdout;
    assert!(text.contains(&format!("\n  the most frequent reason (200): {why}\n")), "{text}");

    let (text, json) = told(&folder, "info");
    assert!(text.contains("200 of 200 replies could not be read: parse_failed"), "{text}");
    assert_eq!(json["replies"], json!({ "replies": 200, "unreadable": { "parse_failed": 200 } }));
    let (text, json) = told(&folder, "validate");
    assert!(text.contains("200 of 200 steps with another status: parse_failed"), "{text}");
    assert!(text.contains("0 errors, 1 note"), "{text}");
    let note = &json["findings"][0];
    assert_eq!((&note["code"], &note["severity"]), (&"unreadable-replies".into(), &"note".into()));
}

#[test]
fn an_unusable_reply_leaves_the_last_good_summary() {
    let server = Server::start(|at, _| match at {
        0 => whole(WireFormat::OpenaiCompatible, &decision("a").replace("went on", "saw a mirror")),
        1 => whole(WireFormat::OpenaiCompatible, "I go on."),
        2 => ok(&spoken(WireFormat::OpenaiCompatible, "", "content_filter")),
        3 => whole(WireFormat::OpenaiCompatible, &decision("a").replace("went on", "saw a wall")),
        _ => whole(WireFormat::OpenaiCompatible, &decision("done")),
    });
    let folder = short();
    let output = folder.record(&server, "own", "--seeds 1 --runs 1").output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let history = |request: &Request| {
        let (_, rest) = request.body.split_once("Step history: ").unwrap();
        rest.split_once("\\n").unwrap().0.to_owned()
    };
    let unusable = "the previous reply could not be used, so nothing was done; the thought before it was: saw a mirror";
    let expected = [
        "none, this is the first step.",
        "the previous action was a; the thought with it was: saw a mirror",
        unusable,
        unusable,
        "the previous action was a; the thought with it was: saw a wall",
    ];
    assert_eq!(server.requests().iter().map(history).collect::<Vec<_>>(), expected);
}

#[test]
fn statuses_are_counted_separately_and_readable_replies_not_listed() {
    let server = Server::start(|at, _| match at {
        1 => whole(WireFormat::OpenaiCompatible, "I go on."),
        2 | 3 => ok(&spoken(WireFormat::OpenaiCompatible, "", "content_filter")),
        4 => whole(WireFormat::OpenaiCompatible, &format!("<think>{}</think>{}", decision("a"), decision("w"))),
        _ => whole(WireFormat::OpenaiCompatible, &decision("w")),
    });
    let folder = short();
    let output = folder.record(&server, "own", "--seeds 1 --runs 1 --json").output().unwrap();
    let said = stderr(&output);
    let summary = "3 of 20 replies could not be read: parse_failed 1, refusal 2; first: `I go on.` (E1/own/s1/r1, step 2): expected a JSON object, found text without one";
    assert!(said.contains(summary), "{said}");
    let (text, json) = told(&folder, "info");
    assert!(text.contains("3 of 20 replies could not be read: parse_failed 1, refusal 2"), "{text}");
    assert_eq!(json["replies"]["unreadable"], json!({ "parse_failed": 1, "refusal": 2 }));
    let (text, _) = told(&folder, "validate");
    assert!(text.contains("3 of 20 steps with another status: parse_failed 1, refusal 2"), "{text}");

    let server = Server::start(|_, _| whole(WireFormat::OpenaiCompatible, &decision("w")));
    let folder = short();
    let output = folder.record(&server, "own", "--seeds 1 --runs 1 --json").output().unwrap();
    assert!(!stderr(&output).contains("could not be read"), "{}", stderr(&output));
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(answer["replies"], json!({ "replies": 20, "unreadable": {}, "first_unreadable": null }));
    let (text, json) = told(&folder, "info");
    assert!(!text.contains("could not be read"), "{text}");
    assert_eq!(json["replies"], json!({ "replies": 20, "unreadable": {} }));
    assert_eq!(told(&folder, "validate").1["findings"], json!([]));
}

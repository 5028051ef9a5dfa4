//! Hostile logs of Inspect: what the events of a sample share is counted as often as it is copied.

use std::path::Path;

use crate::harness::bombs::{MEMORY, inspect_log, measured};

/// Succeeds within the memory limit.
#[track_caller]
fn within(at: &Path, words: &str) {
    let (answer, most) = measured(at, &words.split_whitespace().collect::<Vec<_>>());
    assert!(most < MEMORY && answer.code == 0, "{words}: {} MB, {}", most >> 10, answer.stderr);
}

/// Is refused within the memory limit; the message names the exceeded limit and how to raise it.
#[track_caller]
fn refused(at: &Path, words: &str, limit: &str) {
    let (answer, most) = measured(at, &words.split_whitespace().collect::<Vec<_>>());
    assert!(most < MEMORY, "{words}: {} MB", most >> 10);
    let message = answer.refused();
    assert!(message.contains(limit) && message.contains("MIRRORSTATS_BUDGET"), "{words}: {message}");
}

/// A sample with this many tool events, all with these arguments, and more keys.
fn sample(events: usize, arguments: &str, more: &str) -> String {
    let event = format!("{{\"event\":\"tool\",\"function\":\"f\",\"arguments\":{arguments}}}");
    let events = vec![event; events].join(",");
    format!("{{\"id\":1,\"epoch\":1,\"scores\":{{\"s\":{{\"value\":\"C\"}}}},\"events\":[{events}]{more}}}")
}

#[test]
fn samples_of_inspect_are_limited_with_what_their_events_share() {
    const ROWS: &str = "bytes of rows of a log of its size";
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("d.toml"), "domain = \"tools\"\n[metric.M]\nvalue = \"length()\"\n").unwrap();
    let import = "import a.eval --definitions d.toml -o x.parquet";
    let log = |note: &str, sample: &str| inspect_log(&at.join("a.eval"), note, sample);
    let text = "A".repeat(900_000);
    let attached = format!(",\"attachments\":{{\"k\":\"{text}\"}}");
    log("", &sample(20_000, "[\"attachment://k\"]", &attached));
    refused(at, import, ROWS);
    log("", &sample(1, &format!("[{}0]", "\"attachment://k\",".repeat(20_000)), &attached));
    refused(at, import, "bytes in a line of steps");
    // What no column reads is not copied.
    let unread = format!("{attached},\"metadata\":[{}0]", "\"attachment://k\",".repeat(20_000));
    log("", &sample(10, "null", &unread));
    within(at, import);
    log(&text, &sample(10_000, "1", &format!(",\"metadata\":{{\"b\":\"{text}\"}}")));
    for path in ["sample.metadata.b", "eval.note"] {
        refused(at, &format!("{import} --map big={path}"), ROWS);
    }
    let scores: Vec<String> = (0..9000).map(|at| format!("\"s{at}\":{{\"value\":1}}")).collect();
    log("", &sample(2000, "1", "").replace("\"s\":{\"value\":\"C\"}", &scores.join(",")));
    refused(at, import, ROWS);
    let refs = "{\"event\":\"model\",\"input_refs\":[[0,20000]]}";
    let pool = format!(",\"events_data\":{{\"messages\":[{}1]}}", "{\"content\":\"x\"},".repeat(19_999));
    let pooled = format!("{{\"id\":1,\"epoch\":1,\"events\":[{}]{pool}}}", vec![refs; 20_000].join(","));
    log("", &pooled);
    refused(at, &format!("{import} --map last=event.input.2.content"), ROWS);
}

#[test]
fn samples_of_inspect_are_limited_when_they_are_inflated() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let log = |sample: &str| inspect_log(&at.join("a.eval"), "", sample);
    log(&format!("{{\"events\":[{}1]}}", "1,".repeat(20 << 20)));
    refused(at, "import a.eval -o x.parquet", "values of a sample of a log of its size");
    log(&format!("{{\"id\":\"{}\"}}", "A".repeat(100 << 20)));
    refused(at, "import a.eval -o x.parquet", "bytes inflated from a log of its size");
    // The largest that is read, with its text beside its objects.
    let objects = "{\"a\":1},".repeat(200_000);
    log(&format!("{{\"id\":1,\"z\":NaN,\"l\":[{objects}1],\"t\":\"{}\"}}", "A".repeat(90 << 20)));
    let (answer, most) = measured(at, &["import", "a.eval", "-o", "x.parquet"]);
    assert!(most < MEMORY && answer.refused().contains("expected an `epoch`"), "{} MB", most >> 10);
}

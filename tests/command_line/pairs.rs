//! Every verb on small files that ask for much work: its peak memory, or a refusal that names the limit.

use std::path::Path;

use crate::harness::bombs::{
    MEMORY, definitions, inspect_log, long_episode, long_texts, many_episodes, many_models, measured,
};

/// The option that raises every limit.
const SETTING: &str = "MIRRORSTATS_BUDGET";

/// Succeeds, or is a failed check, within the memory limit.
#[track_caller]
fn within(at: &Path, words: &str) {
    let arguments: Vec<&str> = words.split_whitespace().collect();
    let (answer, most) = measured(at, &arguments);
    assert!(most < MEMORY, "{words}: {} MB", most >> 10);
    assert!([0, 1].contains(&answer.code), "{words}: {}", answer.stderr);
}

/// Is refused within the memory limit; the message names the exceeded limit and how to raise it.
#[track_caller]
fn refused(at: &Path, words: &str, limit: &str) {
    let arguments: Vec<&str> = words.split_whitespace().collect();
    let (answer, most) = measured(at, &arguments);
    assert!(most < MEMORY, "{words}: {} MB", most >> 10);
    let told = answer.refused();
    assert!(told.contains(limit) && told.contains(SETTING), "{words}: {told}");
}

#[test]
fn an_episode_of_millions_of_steps_stays_within_the_limits() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    long_episode(&at.join("a.parquet"), 4_000_000);
    within(at, "info a.parquet");
    within(at, "score a.parquet -o scores.csv");
    within(at, "validate a.parquet");
    #[cfg(feature = "view")]
    refused(at, "view a.parquet --export page", "steps times columns of an episode");
    assert!(!at.join("page").exists());
    definitions(&at.join("d.toml"), 20, |at| format!("sum(t * {})", at + 2));
    refused(at, "score a.parquet --definitions d.toml -o scores.csv", "bytes of values of the definitions");
    definitions(&at.join("d.toml"), 500, |at| format!("sum(t * {})", at + 2));
    refused(at, "score a.parquet --definitions d.toml -o scores.csv", "rows times values of the definitions");
}

#[test]
fn texts_of_a_million_steps_stay_within_the_limits_or_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    long_texts(&at.join("a.parquet"), 1_000_000);
    within(at, "info a.parquet");
    within(at, "validate a.parquet");
    within(at, "score a.parquet -o scores.csv");
    refused(at, "renormalize a.parquet -o new", "bytes of changed attributions");
    refused(at, "renormalize a.parquet --dry-run --json", "bytes of changed attributions");
    assert!(!at.join("new").exists());
    #[cfg(feature = "view")]
    refused(at, "view a.parquet --export page", "steps times columns of an episode");
}

#[test]
fn hundreds_of_thousands_of_episodes_stay_within_the_limits_or_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    many_episodes(&at.join("all.parquet"), 0..900_000);
    for verb in ["info", "info --episodes", "validate", "score -o s.csv", "report --by episode_id"] {
        let (verb, rest) = verb.split_once(' ').unwrap_or((verb, ""));
        if verb == "validate" {
            within(at, "validate all.parquet");
        } else {
            refused(at, &format!("{verb} all.parquet {rest}"), "episodes in");
        }
    }
    many_episodes(&at.join("some.parquet"), 0..290_000);
    within(at, "info some.parquet");
    refused(at, "info some.parquet --episodes", "episodes in a list");
    refused(at, "info some.parquet --episodes --json", "episodes in a list");
    within(at, "score some.parquet -o scores.csv");
    within(at, "report some.parquet -o report");
    refused(at, "report some.parquet --by episode_id -o other", "cells, groups times metrics");
    #[cfg(feature = "view")]
    refused(at, "view some.parquet --export page", "episodes of a page as files");
    many_episodes(&at.join("few.parquet"), 0..100_000);
    within(at, "info few.parquet --episodes");
    within(at, "info few.parquet --episodes --json");
    within(at, "validate some.parquet --json");
}

#[test]
fn many_small_files_have_one_budget() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let all: Vec<String> = (0..4).map(|at| format!("{at}.parquet")).collect();
    for (number, name) in all.iter().enumerate() {
        many_episodes(&at.join(name), number * 290_000..(number + 1) * 290_000);
    }
    refused(at, &format!("score {} -o scores.csv", all.join(" ")), "episodes in files of their size");
}

#[test]
fn hundreds_of_thousands_of_models_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    many_models(&at.join("a.parquet"), 290_000);
    for verb in ["info", "info --json"] {
        refused(at, &format!("{verb} a.parquet"), "bytes of models in experiments");
    }
    within(at, "validate a.parquet");
    within(at, "score a.parquet -o scores.csv");
    refused(at, "report a.parquet -o report", "whose replies are counted");
    refused(at, "stats a.parquet", "comparisons of two models");
    refused(at, "gate a.parquet a.parquet", "cells of a gate");
    many_models(&at.join("c.parquet"), 20_000);
    within(at, "score c.parquet -o c.csv");
    let gate = measured(at, &["gate", "c.csv", "c.parquet"]);
    assert!(gate.1 < MEMORY && gate.0.code == 4, "{} MB, {}", gate.1 >> 10, gate.0.stderr);
    many_models(&at.join("b.parquet"), 90_000);
    within(at, "info b.parquet");
    within(at, "info b.parquet --json");
    refused(at, "report b.parquet -o report", "comparisons of two models");
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

#[test]
fn definitions_and_rows_are_limited_together() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    many_episodes(&at.join("episodes.parquet"), 0..290_000);
    long_texts(&at.join("steps.parquet"), 1_000_000);
    definitions(&at.join("sums.toml"), 500, |at| format!("sum(t * {} + length() % {})", at + 2, at + 3));
    let branches = |at: usize| {
        let one = |branch: usize| format!("when t = {} then {branch}", at * 7 + branch);
        format!("sum(case {} else t end)", (0..60).map(one).collect::<Vec<_>>().join(" "))
    };
    definitions(&at.join("branches.toml"), 100, branches);
    for name in ["sums", "branches"] {
        for trace in ["episodes", "steps"] {
            let words = format!("score {trace}.parquet --definitions {name}.toml -o scores.csv");
            refused(at, &words, "values of the definitions");
        }
    }
    definitions(&at.join("few.toml"), 5, |at| format!("sum(t * {})", at + 2));
    within(at, "score steps.parquet --definitions few.toml -o scores.csv");
}

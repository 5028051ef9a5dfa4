//! The fingerprint of an episode includes the model that answers.

use mirrorstats_vlm::wire_format::WireFormat;
use serde_json::Value;

use super::recordings::Folder;
use super::server::{Server, decision, ok, spoken};
use crate::harness::program::{run, stderr};
use crate::harness::traces::{recording, texts};

/// An answer that names a model.
fn answer(model: &str, action: &str) -> Vec<u8> {
    let mut body = spoken(WireFormat::OpenaiCompatible, &decision(action), "stop");
    body["model"] = Value::from(model);
    ok(&body)
}

/// Three episodes: the first takes two steps, the others one. The `models` answer in turn.
fn record(models: [&'static str; 4]) -> (Folder, String) {
    let folder = Folder::new();
    let server = Server::start(move |at, _| answer(models[at.min(3)], if at == 0 { "a" } else { "done" }));
    let words = "--seeds 1 --runs 3 --in-flight 1 --threads 1 --out runs";
    let output = folder.record(&server, "own", words).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    let told = stderr(&output);
    (folder, told)
}

#[test]
fn another_model_id_starts_a_fingerprint_with_the_next_episode() {
    let (folder, told) = record(["m-1", "m-2", "m-2", "m-2"]);
    assert!(told.contains("from step 2 on the provider answers as `m-2` and not as `m-1`"), "{told}");
    let trace = folder.path().join("runs/E1-own.parquet");
    let mut names: Vec<String> = texts(&trace, "fingerprint").into_iter().flatten().collect();
    names.dedup();
    assert_eq!(names.len(), 2);
    let parts = &recording(&trace)["fingerprints"];
    assert_eq!([&parts[&names[0]]["model"], &parts[&names[1]]["model"]], ["m-1", "m-2"]);
    assert!(parts[&names[0]]["prompts"].is_string() && parts[&names[0]]["sampling"].is_string());
    let message = run(folder.path(), &["report", "runs", "--out", "out"]).refused();
    assert!(message.contains("they differ in model (m-1, m-2)"), "{message}");
    run(folder.path(), &["report", "runs", "--out", "out", "--pool"]).done();
}

#[test]
fn one_model_is_one_fingerprint() {
    let (folder, told) = record(["m-1"; 4]);
    assert!(!told.contains("the provider answers as"), "{told}");
    let mut names = texts(&folder.path().join("runs/E1-own.parquet"), "fingerprint");
    names.dedup();
    assert_eq!(names.len(), 1);
    run(folder.path(), &["report", "runs", "--out", "out"]).done();
}

#[test]
fn token_limit_and_reasoning_options_override_files_and_are_fingerprinted() {
    let folder = Folder::new();
    let own =
        "[model.own]\nbackend = \"compatible\"\nid = \"m\"\nmax_output_tokens = 900\nreasoning_effort = \"high\"\n";
    std::fs::write(folder.path().join("models.toml"), own).unwrap();
    let server = Server::start(|_, _| answer("m", "done"));
    let record = |out: &str, words: &str| {
        let words = format!("--seeds 1 --runs 1 --models models.toml --out {out} {words}");
        let output = folder.record(&server, "own", &words).output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        let recording = recording(&folder.path().join(out).join("E1-own.parquet"));
        let parts = recording["fingerprints"].as_object().unwrap().values().next().unwrap().clone();
        let body = server.requests().pop().unwrap().json();
        ([&body["max_tokens"], &body["reasoning_effort"]].map(Value::clone), recording["agent"].clone(), parts)
    };
    let (asked, agent, of_file) = record("a", "");
    assert_eq!(asked, [Value::from(900), "high".into()]);
    assert_eq!([&agent["max_output_tokens"], &agent["reasoning_effort"]], [&asked[0], &asked[1]]);
    let (asked, agent, typed) = record("b", "--reasoning-effort low --max-output-tokens 700");
    assert_eq!(asked, [Value::from(700), "low".into()]);
    assert_eq!([&agent["max_output_tokens"], &agent["reasoning_effort"]], [&asked[0], &asked[1]]);
    let changed: Vec<&str> = of_file
        .as_object()
        .unwrap()
        .iter()
        .filter(|(key, part)| typed[*key] != **part)
        .map(|(key, _)| key.as_str())
        .collect();
    assert_eq!(changed, ["sampling"]);

    let words = "--seeds 1 --runs 1 --models models.toml --reasoning-effort hard";
    let output = folder.record(&server, "own", words).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("expected one of none, minimal, low, medium, high, xhigh"), "{}", stderr(&output));
}

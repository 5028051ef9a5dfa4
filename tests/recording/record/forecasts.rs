//! `record --dry-run` forecasts a recording and its cost, and writes, sends and asks nothing.

use std::fs;

use serde_json::Value;

use super::recordings::Bench;
use crate::harness::files::assert_same;
use crate::harness::program::{stderr, succeeds};

/// The answer of a dry run; checks that it did not change the folder.
fn forecast(bench: &Bench, words: &str) -> Value {
    let before = bench.path("runs").exists().then(|| bench.files("runs"));
    let output = succeeds(bench.record("runs", &format!("{words} --dry-run --json")).env_remove("OPENROUTER_API_KEY"));
    assert_eq!(stderr(&output), "");
    assert_eq!(bench.path("runs").exists(), before.is_some());
    if let Some(before) = before {
        assert_same(&bench.files("runs"), &before);
    }
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn existing_episodes_are_not_recorded_again() {
    let bench = Bench::new();
    let words = "--agent random --experiment E1,E5 --seeds 2 --runs 2";
    let all = forecast(&bench, words);
    assert_eq!((&all["asked"], &all["found"], &all["steps_at_most"]), (&8.into(), &0.into(), &800.into()));
    assert_eq!(all["requests"], Value::Null, "a scripted agent sends nothing");
    bench.recorded("runs", "--agent random --experiment E1 --seeds 1 --runs 2 --no-log");
    let rest = forecast(&bench, words);
    assert_eq!((&rest["asked"], &rest["found"], &rest["steps_at_most"]), (&8.into(), &2.into(), &600.into()));
    assert_eq!(rest["episodes"][0], "E1/random/s2/r1");
    assert_eq!(rest["episodes"].as_array().unwrap().len(), 6);
    // A recording that cannot be continued is refused before anything is spent.
    fs::write(bench.path("small.toml"), "eye.width = 32\n").unwrap();
    let refused = bench.record("runs", &format!("{words} --dry-run")).output().unwrap();
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("was recorded with another"), "{}", stderr(&refused));
}

#[test]
fn a_model_is_estimated_without_its_key() {
    let bench = Bench::new();
    let words = "--agent vlm --experiment E1,E5 --seeds 1 --runs 3 --model";
    let answer = forecast(&bench, &format!("{words} anthropic/claude-sonnet-4.6 --max-output-tokens 100"));
    let requests = &answer["requests"];
    assert_eq!((&requests["at_most"], &requests["answered"]), (&600.into(), &0.into()));
    assert_eq!(requests["completion_tokens_at_most"], 60_000);
    let [prompt, most] = ["prompt_cost_usd", "cost_usd_at_most"].map(|key| requests[key].as_f64().unwrap());
    let tokens = requests["prompt_tokens"].as_f64().unwrap();
    assert!((prompt - tokens * 3.0 / 1e6).abs() < 1e-9 && (most - prompt - 60_000.0 * 15.0 / 1e6).abs() < 1e-9);
    // The limit of 100 tokens also caps the typical reply.
    assert_eq!(requests["typical_cost_usd"], requests["cost_usd_at_most"]);
    // More pixels take more tokens.
    fs::write(bench.path("small.toml"), "eye.width = 640\neye.height_px = 480\n").unwrap();
    let larger = forecast(&bench, &format!("{words} anthropic/claude-sonnet-4.6"));
    assert!(larger["requests"]["prompt_tokens"].as_f64().unwrap() > tokens + 600.0 * 300.0);

    let unpriced = forecast(&bench, &format!("{words} own-x --base-url http://127.0.0.1:9/v1"));
    assert_eq!(unpriced["requests"]["cost_usd_at_most"], Value::Null, "an unknown price is no price of zero");
    let told =
        succeeds(&mut bench.record("runs", &format!("{words} own-x --base-url http://127.0.0.1:9/v1 --dry-run")));
    let told = String::from_utf8(told.stdout).unwrap();
    assert!(told.contains("would record 6 episodes, at most 600 steps"), "{told}");
    assert!(told.contains("cost: unknown") && !told.contains(" 0.00"), "{told}");
}

#[test]
fn steps_that_have_their_answer_are_not_paid_again() {
    let bench = Bench::new();
    fs::create_dir_all(bench.path("runs/journal")).unwrap();
    let answer = |t: i32| {
        let line = serde_json::json!({
            "kind": "answer", "t": t, "attempt": 1, "question": "q", "latency_ms": 1, "body": "{}",
        });
        format!("{line}\n")
    };
    let journal = (1..=30).map(answer).collect::<String>();
    fs::write(bench.path("runs/journal/E5-claude-sonnet-4-6-s1-r2.jsonl"), journal).unwrap();
    let words = "--agent vlm --model anthropic/claude-sonnet-4.6 --experiment E5 --seeds 1 --runs 2";
    let requests = forecast(&bench, words)["requests"].clone();
    assert_eq!((&requests["at_most"], &requests["answered"]), (&170.into(), &30.into()));
    // Playing from a cassette sends no requests.
    assert_eq!(forecast(&bench, &format!("{words} --cassette runs/journal"))["requests"], Value::Null);
}

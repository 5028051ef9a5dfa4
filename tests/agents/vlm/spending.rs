//! Limits apply to all episodes of a recording and to all of its starts.

use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use mirrorstats_agents::LostKind;
use mirrorstats_vlm::limits::Limits;
use mirrorstats_vlm::wire_format::WireFormat;

use serde_json::{Value, json};

use super::bench::Bench;
use super::recordings::{Folder, counting};
use super::server::{Conduct, Server, decision, ok, spoken, whole};
use crate::harness::program::stderr;

#[test]
fn limits_stop_before_the_request_over_them() {
    let server = Server::start(|_, _| whole(WireFormat::OpenaiChat, &decision("w")));
    let bench = Bench::new(Limits { requests: Some(2), ..Limits::default() });
    let vlm = bench.vlm(&server, WireFormat::OpenaiChat);
    let replies = Bench::play(&vlm, "episode", 3);
    assert!(replies[0].is_ok() && replies[1].is_ok());
    let stopped = replies[2].as_ref().unwrap_err();
    assert!(
        stopped.kind == LostKind::Limit && stopped.cause.contains("limit of requests is reached: 2 of 2"),
        "{stopped}"
    );
    // A later episode gets the same refusal.
    assert_eq!(Bench::play(&vlm, "another", 1)[0].as_ref(), Err(stopped));
    assert_eq!(server.count(), 2);
}

/// Starts a recording; returns its exit code and messages.
fn started(folder: &Folder, server: &Server, words: &str) -> (Option<i32>, String) {
    let words = format!("--seeds 1 --runs 1 --threads 1 --models own.toml {words}");
    let output = folder.record(server, "own", &words).output().unwrap();
    (output.status.code(), stderr(&output))
}

#[test]
fn limits_include_the_spending_of_earlier_starts() {
    let own = "[model.own]\nbackend = \"compatible\"\nid = \"own-1\"\nanswers_as = [\"model-1-*\"]\nprices = { input = 1.0, output = 10.0 }\n";
    // An answer takes 1100 tokens and 0.002 dollars.
    let cases = [
        ("--max-requests 2", "requests is reached: 2 of 2", 2),
        ("--max-tokens 2300", "tokens is reached: 3300 of 2300", 3),
        (
            "--max-cost 0.0075 --max-output-tokens 100",
            "cost is reached: 0.0060 US dollars of 0.0075 US dollars; the next request may cost",
            3,
        ),
    ];
    for (limit, reason, requests) in cases {
        let server = Server::start(|at, request| whole(WireFormat::OpenaiCompatible, &counting(request, 4, at)));
        let folder = Folder::new();
        std::fs::write(folder.path().join("own.toml"), own).unwrap();
        for start in 1..=2 {
            let (code, said) = started(&folder, &server, limit);
            assert_eq!(code, Some(2), "{said}");
            assert!(said.contains(reason) && said.contains("higher limit continues"), "{limit}, start {start}: {said}");
            assert_eq!(server.count(), requests, "{limit}, start {start}");
        }
        let (_, output_tokens) = limit.split_once("--max-output-tokens").unwrap_or_default();
        let same = if output_tokens.is_empty() { String::new() } else { format!("--max-output-tokens{output_tokens}") };
        let (code, said) = started(&folder, &server, &same);
        assert_eq!((code, server.count()), (Some(0), 4), "{said}");
    }
}

#[test]
fn an_episode_that_a_limit_stopped_is_not_lost() {
    let server = Server::start(|at, request| whole(WireFormat::OpenaiCompatible, &counting(request, 4, at)));
    let folder = Folder::new();
    let words = "--seeds 1 --runs 4 --threads 1 --in-flight 1 --json";
    let output = folder.record(&server, "own", &format!("{words} --max-requests 10")).output().unwrap();
    let said = stderr(&output);
    assert_eq!((output.status.code(), server.count()), (Some(2), 10), "{said}");
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    let of = |key: &str| answer[key].clone();
    assert_eq!((of("recorded"), of("lost"), of("stopped_by_limit")), (2.into(), json!([]), 1.into()), "{said}");
    assert_eq!(of("stopped"), true);
    assert!(!said.contains("lost E1") && !said.contains("failures"), "{said}");
    assert!(said.contains("stopped by a limit, 2 episodes to go: 1 episode of them begun and not lost"), "{said}");
    assert!(said.ends_with("\n  help: the same command with a higher limit continues\n"), "{said}");
    assert!(!said.contains(r"\u{a}"), "{said}");
    assert!(!folder.path().join("runs/lost.jsonl").exists());

    let output = folder.record(&server, "own", &format!("{words} --max-requests 16")).output().unwrap();
    assert_eq!((output.status.code(), server.count()), (Some(0), 16), "{}", stderr(&output));
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&answer["stopped_by_limit"], &answer["stopped"]), (&0.into(), &false.into()));

    // All requests in flight count, whichever one reached the limit.
    let words = format!("{words} --max-requests 6 --in-flight 4 --out together").replacen("--in-flight 1", "", 1);
    let output = folder.record(&server, "own", &words).output().unwrap();
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    let [recorded, begun] = [&answer["recorded"], &answer["stopped_by_limit"]].map(|count| count.as_u64().unwrap());
    assert_eq!((recorded + begun, &answer["lost"]), (4, &json!([])), "{}", stderr(&output));
}

#[test]
fn models_that_share_a_folder_have_accounts_of_their_own() {
    let folder = Folder::new();
    let server = Server::start(|at, request| whole(WireFormat::OpenaiCompatible, &counting(request, 4, at)));
    let model = |name: &str, price: f64| {
        format!(
            "[model.\"{name}\"]\nbackend = \"compatible\"\nid = \"{name}\"\nanswers_as = [\"model-1-*\"]\n\
             prices = {{ input = {price:.1}, output = {price:.1} }}\n"
        )
    };
    // One model's name is a prefix of the other's.
    let models = model("own", 1.0) + &model("own s1", 100.0);
    std::fs::write(folder.path().join("models.toml"), models).unwrap();
    let spend = |name: &str, words: &str| {
        let mut command = folder.record(&server, name, "--seeds 1 --runs 1 --models models.toml --json");
        let output = command.args(words.split_whitespace()).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{name}: {}", stderr(&output));
        serde_json::from_slice::<Value>(&output.stdout).unwrap()["spend"].clone()
    };
    // Four answers of 1100 tokens each.
    let of = |requests: u64, cost: f64| json!({ "cost_usd": cost, "uncosted": 0, "unanswered": 0, "uncosted_usd_at_most": 0.0, "tokens": requests * 1100, "requests": requests });
    let is = |found: &Value, requests: u64, cost: f64| {
        let expected = of(requests, cost);
        let near = (found["cost_usd"].as_f64().unwrap() - cost).abs() < 1e-9;
        assert!(near && found["requests"] == expected["requests"] && found["tokens"] == expected["tokens"], "{found}");
    };
    is(&spend("own s1", ""), 4, 0.44);
    is(&spend("own", "--max-requests 4 --max-cost 0.01"), 4, 0.0044);
    is(&spend("own s1", "--max-requests 4"), 4, 0.44);
    assert_eq!(folder.journals().len(), 2);
}

#[test]
fn a_limit_of_cost_without_prices_is_refused_before_anything_is_sent_or_made() {
    let own = "[model.own]\nbackend = \"compatible\"\nid = \"own-1\"\nanswers_as = [\"model-1-*\"]\n";
    let cases = [
        ("", "`own` has no input and no output price"),
        ("prices = { input = 1.0 }\n", "`own` has no output price"),
        ("prices = { output = 1.0 }\n", "`own` has no input price"),
    ];
    for (prices, reason) in cases {
        let server = Server::start(|_, _| whole(WireFormat::OpenaiCompatible, &decision("done")));
        let folder = Folder::new();
        std::fs::write(folder.path().join("own.toml"), format!("{own}{prices}")).unwrap();
        let (code, said) = started(&folder, &server, "--max-cost 1");
        assert_eq!((code, server.count()), (Some(2), 0), "{said}");
        assert!(said.contains(reason) && said.contains("--models") && said.contains("[model.\"own\"]"), "{said}");
        assert!(!folder.path().join("runs").exists(), "{said}");
        // Without the limit, or with one that can be enforced, it records.
        let (code, said) = started(&folder, &server, "--max-requests 200");
        assert_eq!(code, Some(0), "{said}");
    }
    let (server, folder) =
        (Server::start(|_, _| whole(WireFormat::OpenaiCompatible, &decision("done"))), Folder::new());
    let output = folder.record(&server, "unknown-model", "--max-cost 1").output().unwrap();
    assert_eq!((output.status.code(), server.count()), (Some(2), 0), "{}", stderr(&output));
    assert!(stderr(&output).contains("`unknown-model` has no input and no output price"), "{}", stderr(&output));
}

#[test]
fn a_limit_of_cost_is_an_amount() {
    let (server, folder) =
        (Server::start(|_, _| whole(WireFormat::OpenaiCompatible, &decision("done"))), Folder::new());
    for limit in ["nan", "inf", "-1", "much"] {
        let output = folder.record(&server, "own", &format!("--max-cost={limit}")).output().unwrap();
        assert_eq!((output.status.code(), server.count()), (Some(2), 0), "{limit}: {}", stderr(&output));
    }
}

/// A model with prices: an answer costs 0.002 dollars, a request with 100 reply tokens at most about 0.005.
const PRICED: &str = "[model.own]\nbackend = \"compatible\"\nid = \"own-1\"\nanswers_as = [\"model-1-*\"]\n\
                      max_output_tokens = 100\nprices = { input = 1.0, output = 10.0 }\n";

/// `record` of this model, 16 episodes of six steps, all in flight, with a slow server.
fn priced(folder: &Folder, server: &Server, words: &str) -> Command {
    std::fs::write(folder.path().join("own.toml"), PRICED).unwrap();
    let words = format!("--models own.toml --seeds 4 --runs 4 --threads 1 --in-flight 16 --json {words}");
    folder.record(server, "own", &words)
}

fn slow_server() -> Server {
    Server::start(|at, request| {
        std::thread::sleep(Duration::from_millis(30));
        whole(WireFormat::OpenaiCompatible, &counting(request, 6, at))
    })
}

#[test]
fn money_is_never_exceeded_and_begun_episodes_are_finished() {
    let (server, folder) = (slow_server(), Folder::new());
    let output = priced(&folder, &server, "--max-cost 0.1").output().unwrap();
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    let cost = answer["spend"]["cost_usd"].as_f64().unwrap();
    assert!(cost <= 0.1 && (cost - 0.002 * server.count() as f64).abs() < 1e-9, "{cost} for {}", server.count());
    // The money is enough for eight episodes, less the possible cost of the last request.
    let recorded = answer["recorded"].as_u64().unwrap();
    assert!(recorded >= 6, "{recorded} of 16: {}", stderr(&output));
    assert!(server.count() as u64 - 6 * recorded < 6, "{} requests, {recorded} whole episodes", server.count());
}

#[test]
fn the_spending_of_a_killed_recording_counts() {
    let (server, folder) = (slow_server(), Folder::new());
    let record = || priced(&folder, &server, "--max-cost 0.1").stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let mut killed = record().unwrap();
    while server.count() < 20 {
        std::thread::sleep(Duration::from_millis(1));
    }
    killed.kill().unwrap();
    killed.wait().unwrap();
    let output = record().unwrap().wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    let cost = 0.002 * server.count() as f64;
    assert!(cost <= 0.1, "{cost} dollars");
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    let of = |key: &str| answer["spend"][key].as_f64().unwrap();
    assert!(of("cost_usd") <= cost + 1e-9 && of("cost_usd") + of("uncosted_usd_at_most") >= cost - 1e-9, "{answer}");
    assert_eq!(answer["spend"]["requests"], server.count());
}

#[test]
fn timed_out_and_killed_requests_count_with_their_largest_cost() {
    let server = Server::start(|at, request| match at {
        0 => Conduct::dripping(vec![b' '], 1, Duration::from_secs(5)),
        _ => whole(WireFormat::OpenaiCompatible, &counting(request, 4, at)).into(),
    });
    let folder = Folder::new();
    let output = priced(&folder, &server, "--timeout 1 --max-requests 1 --attempts 1").output().unwrap();
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    let may_cost = answer["spend"]["uncosted_usd_at_most"].as_f64().unwrap();
    assert_eq!((&answer["spend"]["unanswered"], &answer["spend"]["cost_usd"]), (&1.into(), &0.0.into()));
    assert!((0.003..0.01).contains(&may_cost), "{may_cost}");
    let said = stderr(&output);
    assert!(said.contains("1 request without an answer may have been paid: at most 0.00"), "{said}");
    // A killed process leaves a request without an outcome as the last line.
    let journal = folder.journals().into_keys().next().unwrap();
    let text = std::fs::read_to_string(&journal).unwrap();
    std::fs::write(&journal, text.lines().next().unwrap().to_owned() + "\n").unwrap();
    let output = priced(&folder, &server, "--max-cost 0.001").output().unwrap();
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(answer["spend"]["uncosted_usd_at_most"].as_f64(), Some(may_cost));
    assert_eq!((output.status.code(), server.count()), (Some(2), 1), "{}", stderr(&output));
}

/// `record` with a router that states each answer's cost, for a model without prices.
fn routed(folder: &Folder, server: &Server, words: &str) -> Command {
    let own = "[backend.router]\nwire_format = \"openai-compatible\"\nkey = \"MIRRORSTATS_API_KEY\"\n\
               [model.own]\nbackend = \"router\"\nid = \"own-1\"\nanswers_as = [\"model-1-*\"]\nmax_output_tokens = 100\n";
    std::fs::write(folder.path().join("own.toml"), own).unwrap();
    let words = format!("--models own.toml --backend router --threads 1 --in-flight 16 --json {words}");
    folder.record(server, "own", &words)
}

/// <https://openrouter.ai/docs/use-cases/usage-accounting>: `usage.cost`.
fn with_cost(text: &str, cost: f64) -> Vec<u8> {
    let mut body = spoken(WireFormat::OpenaiCompatible, text, "stop");
    body["usage"]["cost"] = json!(cost);
    ok(&body)
}

#[test]
fn a_cost_limit_uses_the_costs_that_answers_state() {
    let server = Server::start(|at, request| {
        std::thread::sleep(Duration::from_millis(20));
        with_cost(&counting(request, 6, at), 0.002)
    });
    let folder = Folder::new();
    let output = routed(&folder, &server, "--seeds 4 --runs 4 --max-cost 0.1").output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    let cost = answer["spend"]["cost_usd"].as_f64().unwrap();
    assert!((0.07..=0.1).contains(&cost) && (cost - 0.002 * server.count() as f64).abs() < 1e-9, "{cost}");
    // Episodes in progress end before others begin.
    assert!(answer["recorded"].as_u64().unwrap() >= 6, "{answer}");

    // A router that states no cost is noticed at its first answer.
    let server = Server::start(|at, request| whole(WireFormat::OpenaiCompatible, &counting(request, 6, at)));
    let folder = Folder::new();
    let output = routed(&folder, &server, "--seeds 4 --runs 4 --max-cost 0.1").output().unwrap();
    assert_eq!((output.status.code(), server.count()), (Some(2), 1), "{}", stderr(&output));
    assert!(stderr(&output).contains("`own` has no input and no output price"), "{}", stderr(&output));
}

#[test]
fn a_forecast_follows_the_episodes_that_are_finished() {
    let server = Server::start(|at, request| with_cost(&counting(request, 6, at), 0.002));
    let folder = Folder::new();
    let forecast = |words: &str| {
        let output = routed(&folder, &server, &format!("--dry-run {words}")).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        serde_json::from_slice::<Value>(&output.stdout).unwrap()["requests"].clone()
    };
    let prior = forecast("--seeds 1 --runs 4");
    assert_eq!((&prior["finished_episodes"], &prior["typical_requests"]), (&0.into(), &400.into()));
    // 400 answers of 5 s each, four at once.
    assert_eq!((&prior["typical_cost_usd"], &prior["seconds"]), (&Value::Null, &500.0.into()));
    let output = routed(&folder, &server, "--seeds 1 --runs 2").output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let seen = forecast("--seeds 1 --runs 4");
    assert_eq!((&seen["finished_episodes"], &seen["typical_requests"]), (&2.into(), &12.into()));
    assert!((seen["typical_cost_usd"].as_f64().unwrap() - 0.024).abs() < 1e-9, "{seen}");
    // The upper bound does not change, because the price is unknown.
    assert_eq!((&seen["at_most"], &seen["cost_usd_at_most"]), (&200.into(), &Value::Null));
    assert_eq!(forecast("--seeds 1 --runs 4 --requests-per-minute 3")["seconds"], 240.0);
}

#[test]
fn requests_per_minute_stay_within_the_limit_of_the_account() {
    let server = Server::start(|at, request| whole(WireFormat::OpenaiCompatible, &counting(request, 4, at)));
    let folder = Folder::new();
    let start = Instant::now();
    // One request per 50 ms.
    let words = "--seeds 1 --runs 4 --in-flight 4 --requests-per-minute 1200";
    let output = folder.record(&server, "own", words).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(server.count(), 16);
    assert!(start.elapsed() >= Duration::from_millis(15 * 50), "{:?}", start.elapsed());
}

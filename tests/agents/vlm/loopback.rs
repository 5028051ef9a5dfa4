//! A study in one command, killed halfway, with the servers of `examples/providers`, which answer like five providers.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use mirrorstats_vlm::journal::Entry;
use serde_json::Value;

use super::bench::KEY;
use super::recordings::Folder;
use crate::harness::program::{program, run, stderr};

/// A server of `examples` in Python; it is killed when this is dropped.
pub struct Provider {
    process: Child,
    pub address: String,
}

impl Provider {
    fn start(name: &str) -> Self {
        Self::serve(&format!("providers/{name}.py"), &[], Path::new(""))
    }

    /// Starts a script of `examples` that prints its address, with packages from a folder.
    pub fn serve(script: &str, words: &[&str], packages: &Path) -> Self {
        let mut command = Command::new("python3");
        command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("examples").join(script)).args(words);
        command.env("PYTHONDONTWRITEBYTECODE", "1").env("PYTHONPATH", packages).stdout(Stdio::piped());
        let mut process = command.spawn().expect("python3 runs the servers");
        let mut address = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut address).unwrap();
        Self { process, address: address.trim().to_owned() }
    }

    /// The number of answers that were paid for.
    fn paid(&self) -> u64 {
        let mut stream = TcpStream::connect(self.address.trim_start_matches("http://")).unwrap();
        stream.write_all(b"GET / HTTP/1.1\r\nhost: loopback\r\nconnection: close\r\n\r\n").unwrap();
        let mut text = String::new();
        stream.read_to_string(&mut text).unwrap();
        let (_, body) = text.split_once("\r\n\r\n").unwrap();
        serde_json::from_str::<Value>(body).unwrap()["paid"].as_u64().unwrap()
    }
}

impl Drop for Provider {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Server, wire format, path, and its models: name, id, keys, options of the study.
type Served = (&'static str, &'static str, &'static str, [[&'static str; 4]; 2]);

const PRICES: &str = "prices = { input = 1.0, cached_input = 0.1, output = 10.0 }";
const NO_TEMPERATURE: &str = "temperature = \"default\"\nprices = { input = 1.0, cached_input = 0.1, output = 10.0 }";
const NONE: [&str; 4] = [""; 4];
const SERVED: [Served; 5] = [
    (
        "openai",
        "openai-chat",
        "/v1",
        [["GPT 5.1", "gpt-5.1", PRICES, ""], ["GPT 6.1", "gpt-6.1-sol", NO_TEMPERATURE, ""]],
    ),
    (
        "anthropic",
        "anthropic-messages",
        "/v1",
        [["Haiku", "claude-haiku-4-5", PRICES, ""], ["Sonnet", "claude-sonnet-5-5", NO_TEMPERATURE, ""]],
    ),
    (
        "gemini",
        "gemini",
        "/v1beta",
        [
            ["Flash", "gemini-3.8-flash", PRICES, ""],
            ["Pro", "gemini-2.5-pro", PRICES, "accept-model = \"gemini-3.8-flash\""],
        ],
    ),
    ("openrouter", "openai-compatible", "/api/v1", [["Gemma", "google/gemma-4-31b-it:nitro", "", ""], NONE]),
    ("local", "openai-compatible", "/v1", [["Own", "own-1", "answers_as = [\"*\"]", "no-max-cost"], NONE]),
];

/// Writes the models and the study with these options; starts the servers.
fn prepare(folder: &Folder, options: &str) -> Vec<Provider> {
    let mut models = String::new();
    let mut study =
        format!("{options}\nmodels = \"models.toml\"\nconfig = \"small.toml\"\nno-log = true\nthreads = 2\n");
    let servers = SERVED.map(|(server, wire_format, path, served)| {
        let provider = Provider::start(server);
        let address = &provider.address;
        writeln!(
            models,
            "[backend.{server}]\nwire_format = \"{wire_format}\"\nkey = \"LOOPBACK_KEY\"\nbase_url = \"{address}{path}\""
        )
        .unwrap();
        for [name, id, keys, own] in served.into_iter().filter(|model| *model != NONE) {
            writeln!(models, "[model.\"{name}\"]\nbackend = \"{server}\"\nid = \"{id}\"\n{keys}").unwrap();
            let own = if own == "no-max-cost" { String::new() } else { format!("max-cost = 50.0\n{own}\n") };
            writeln!(study, "[model.\"{name}\"]\n{own}").unwrap();
        }
        provider
    });
    std::fs::write(folder.path().join("models.toml"), models).unwrap();
    std::fs::write(folder.path().join("study.toml"), study).unwrap();
    servers.into()
}

fn record(folder: &Folder) -> Command {
    let mut command = program(folder.path());
    command.env("LOOPBACK_KEY", KEY).args(["record", "study.toml", "--json"]);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Records a study, killed once half of its answers were paid for, and checks that none is paid for twice.
fn study(options: &str, episodes: u64) {
    let folder = Folder::new();
    let servers = prepare(&folder, options);
    let paid = || servers.iter().map(Provider::paid).sum::<u64>();

    let forecast = run(folder.path(), &["record", "study.toml", "--dry-run"]).done();
    let together = format!("together: {episodes} episodes, at most ");
    assert!(forecast.contains(&together) && forecast.contains("and what 2 models without prices cost"), "{forecast}");

    let mut killed = record(&folder).spawn().unwrap();
    // Four steps per episode.
    while paid() < 2 * episodes {
        assert_eq!(killed.try_wait().unwrap(), None, "it ended before half of the answers");
        sleep(Duration::from_millis(20));
    }
    killed.kill().unwrap();
    killed.wait().unwrap();
    let output = record(&folder).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let answers: Vec<Value> = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(answers.len(), 8);
    let sum = |key: &str| answers.iter().map(|answer| answer[key].as_u64().unwrap()).sum::<u64>();
    assert_eq!((sum("asked"), sum("recorded") + sum("found")), (episodes, episodes));

    let mut kept = 0;
    for (journal, entries) in folder.journals() {
        let steps =
            entries.iter().filter_map(|entry| if let Entry::Answer { t, .. } = entry { Some(*t) } else { None });
        let steps: Vec<i32> = steps.collect();
        assert_eq!(BTreeSet::from_iter(&steps).len(), steps.len(), "{}: a step was paid twice", journal.display());
        kept += steps.len() as u64;
    }
    // Requests in flight at the kill have no answer in a journal.
    let lost = paid() - kept;
    assert!(kept == 4 * episodes && lost <= 64, "{kept} answers kept, {lost} paid and lost at the kill");
    let unanswered: u64 = answers.iter().map(|answer| answer["spend"]["unanswered"].as_u64().unwrap()).sum();
    assert!(unanswered >= lost, "{unanswered} of {lost} are counted");

    let spend: BTreeMap<&str, &Value> =
        answers.iter().map(|answer| (answer["model"].as_str().unwrap(), &answer["spend"])).collect();
    // OpenRouter states the cost; OpenAI's follows from tokens and prices, with 400 tokens from the cache.
    let cost = |model: &str| spend[model]["cost_usd"].as_f64().unwrap();
    let each = episodes as f64 / 8.0 * 4.0;
    assert!((cost("Gemma") - 0.000_7 * each).abs() < 1e-6, "{}", cost("Gemma"));
    assert!((cost("GPT 5.1") - 0.001_64 * each).abs() < 1e-6, "{}", cost("GPT 5.1"));
    // Two files per model, and one per account.
    let report = run(folder.path(), &["report", "runs", "--out", "report", "--json"]).json();
    assert_eq!(report["episodes"], episodes);
}

#[test]
fn a_killed_study_is_continued_by_the_same_command() {
    study("experiment = \"E1,E2\"\nseeds = 1\nruns = 2", 32);
}

#[test]
fn the_flex_tier_is_asked_for_and_costs_half() {
    let folder = Folder::new();
    let _servers = prepare(&folder, "");
    let record = |model: &str| {
        let mut command = program(folder.path());
        command.env("LOOPBACK_KEY", KEY).args([
            "record",
            "--models",
            "models.toml",
            "--config",
            "small.toml",
            "--no-log",
        ]);
        command.args([
            "--experiment",
            "E1",
            "--seeds",
            "1",
            "--runs",
            "2",
            "--json",
            "--model",
            model,
            "--tier",
            "flex",
        ]);
        command.output().unwrap()
    };
    for model in ["GPT 5.1", "Flash"] {
        let output = record(model);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
        // Eight answers, at half of the full price of 0.00164 dollars.
        let cost = answer["spend"]["cost_usd"].as_f64().unwrap();
        assert!((cost - 8.0 * 0.001_64 / 2.0).abs() < 1e-9, "{model}: {cost}");
    }
    let refused = record("Haiku");
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("the backend `anthropic` has no such tier"), "{}", stderr(&refused));
}

#[test]
#[ignore = "minutes: make soak"]
fn soak_a_killed_study_of_eight_models_and_five_experiments_is_continued() {
    study("experiment = \"E1..E5\"\nseeds = 3\nruns = 7", 840);
}

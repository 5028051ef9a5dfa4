//! The seeds of the corpora, made from the fixtures and our own episodes: `cargo run -p mirrorstats-fuzz -- seeds`.
//!
//! `fuzz/corpus` holds what libFuzzer's merge kept of the seeds and of its own finds, so it may lack some seeds.

use std::fs;
use std::path::{Path, PathBuf};

use mirrorstats_analysis::plan::register::{NamedHash, RegisteredPlan};
use mirrorstats_analysis::plan::{Given, PlanRequest, plan};
use mirrorstats_exact::replace::folder_of;
use mirrorstats_log::message::Decision;
use mirrorstats_log::write::EpisodeLog;
use mirrorstats_log::{assemble, topic};
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_metric::file::{built_in, built_in_names};
use mirrorstats_score::format::{self, Format};
use mirrorstats_score::{score_traces, vocabulary};
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_statistics::sample_size::Clusters;
use mirrorstats_vlm::journal::Entry;
use serde_json::{Value, json};

use crate::{episodes, pages, pairs, scratch, traces};

/// The folder of the project.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn read(path: &str) -> Vec<u8> {
    let path = root().join(path);
    fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn folder(path: &str) -> Vec<Vec<u8>> {
    let mut files: Vec<_> = fs::read_dir(root().join(path)).expect("a folder of the project").flatten().collect();
    files.sort_by_key(std::fs::DirEntry::path);
    files.iter().map(|file| fs::read(file.path()).unwrap_or_default()).collect()
}

/// The seeds of a target.
pub fn of(target: &str) -> Vec<Vec<u8>> {
    match target {
        "pages" => page_seeds(),
        "footer" => vec![traces::sound_footer().to_vec()],
        "trace" => vec![episodes::trace(1), episodes::trace(4), read("fixtures/checksums/v1-snappy.parquet")],
        "import" => lines(),
        "recover" | "assemble" => logs(),
        "definitions" => definitions(),
        "manifest" => vec![read("reports/paper/manifest.json")],
        "style" => vec![read("assets/styles/default.toml"), read("assets/styles/paper.toml"), STYLE.into()],
        "world" => {
            vec![WorldConfig::default_text().into(), b"[eye]\nwidth = 64\n".into(), b"[others]\nleast = 2\n".into()]
        }
        "experiments" => folder("assets/experiments"),
        "plan" => vec![registered()],
        "lost" => vec![LOST.into()],
        "scores" => scores(),
        "journal" | "cassette" => vec![journal()],
        "replies" => replies(),
        "defined" => definitions().iter().map(|text| pairs::joined(text, &[])).collect(),
        "grouped" => texts(&["model", "experiment,model", "episode_id", "seed,run,body_color", "nope", ""]),
        "filtered" => {
            texts(&["run = 1", "any(mirror_visible) and run > 0", "TSA = 1", "model is null", "length() > 2"])
        }
        "asked" => texts(&QUESTIONS),
        "logged" => logs().iter().map(|log| pairs::joined(log, &[])).collect(),
        "styled" => vec![pairs::joined(STYLE, &scores()[0][1..])],
        other => panic!("no target `{other}`"),
    }
}

/// Texts paired with a sound trace, and with a trace of another writer.
fn texts(texts: &[&str]) -> Vec<Vec<u8>> {
    let other = read("fixtures/checksums/v1-snappy.parquet");
    let pair = |text: &&str| [pairs::joined(text.as_bytes(), &[]), pairs::joined(text.as_bytes(), &other)];
    texts.iter().flat_map(pair).collect()
}

/// A query for each answer of the page.
const QUESTIONS: [&str; 12] = [
    "live",
    "study",
    "overview?model=m",
    "figures",
    "statistics?where=run > 0",
    "episodes?sort=TSA&order=descending&offset=1&limit=2&search=e",
    "episode?id=e2",
    "text?id=e2&column=reasoning&t=1",
    "map?id=e2",
    "compare?a=e1&b=e2",
    "same_frame?a=e1&b=e2&t=1",
    "frame?id=e0&t=1",
];

/// Writes the seeds of every target into a folder named after it.
///
/// # Errors
/// If a file or folder cannot be written.
pub fn write(out: &Path) -> std::io::Result<()> {
    for (target, run) in crate::TARGETS {
        let folder = out.join(target);
        fs::create_dir_all(&folder)?;
        for (at, seed) in of(target).into_iter().enumerate() {
            run(&seed);
            fs::write(folder.join(format!("seed-{at:04}")), seed)?;
        }
    }
    Ok(())
}

/// Every base column unchanged, and some with one change of each kind.
fn page_seeds() -> Vec<Vec<u8>> {
    let whole = (0..pages::bases()).map(|at| at.to_le_bytes()[..2].to_vec());
    let changed = (0..18_u8).map(|what| {
        let [low, high, ..] = (usize::from(what) * 37 % pages::bases()).to_le_bytes();
        vec![low, high, what, what, 1, 3, 0, 65]
    });
    whole.chain(changed).collect()
}

fn lines() -> Vec<Vec<u8>> {
    let of_episode = |episode: &mirrorstats_trace::episodes::episode::Episode| {
        let line = |(t, step)| {
            let mut row = json!(episode);
            let decision = json!(Decision::from_step(t, step));
            let (Some(row_keys), Some(keys)) = (row.as_object_mut(), decision.as_object()) else {
                return String::new();
            };
            row_keys.extend(keys.clone());
            row_keys.retain(|_, value| !value.is_null());
            for key in ["action", "self_color", "selected_cube"] {
                row_keys.entry(key).or_insert(Value::Null);
            }
            row.to_string()
        };
        (1..).zip(&episode.steps).map(line).collect::<Vec<_>>().join("\n")
    };
    let all: Vec<String> = episodes::episodes(4).iter().map(of_episode).collect();
    vec![all[0].clone().into_bytes(), (all.join("\n") + "\n").into_bytes(), b"\xef\xbb\xbf\r\n{}\n".to_vec()]
}

/// Logs of one and of three episodes, with recordings; also each cut in the middle.
fn logs() -> Vec<Vec<u8>> {
    let mut parts = Vec::new();
    for (at, episode) in episodes::episodes(3).into_iter().enumerate() {
        let path = scratch::path(&format!("part-{at}.mcap"));
        let head = mirrorstats_trace::episodes::episode::Episode { steps: Vec::new(), ..episode.clone() };
        let mut log =
            EpisodeLog::create(&path, &head, &json!({ "type": "object" }), 1).expect("a folder for temporary files");
        for (t, step) in (1..).zip(&episode.steps) {
            let time = u64::try_from(t).unwrap_or(1) * 1_000_000_000;
            log.decided(time, &Decision::from_step(t, step)).expect("a folder for temporary files");
        }
        log.end(9_000_000_000, &episode).expect("a folder for temporary files");
        parts.push((assemble::place(&episode), path));
    }
    let mut found: Vec<Vec<u8>> = parts.iter().map(|(_, path)| fs::read(path).unwrap_or_default()).collect();
    let recording = json!({ "kind": "recording", "topic": topic::EPISODE, "columns": ["reasoning"] });
    for count in [1, 3] {
        let out = scratch::path("all.mcap");
        let made = assemble::assemble(&out, None, &parts[..count], &recording, folder_of(&out));
        made.expect("logs that were just written");
        found.push(fs::read(out).unwrap_or_default());
    }
    let cut: Vec<Vec<u8>> = found.iter().map(|log| log[..log.len() * 2 / 3].to_vec()).collect();
    found.into_iter().chain(cut).collect()
}

fn definitions() -> Vec<Vec<u8>> {
    let own = built_in_names().into_iter().filter_map(built_in).map(|text| text.as_bytes().to_vec());
    let mut found: Vec<Vec<u8>> = own.collect();
    found.extend(EXPRESSIONS.iter().map(|value| {
        let value = value.replace('\'', "''").replace("''", "'");
        format!("[let]\nx = \"mirror_px\"\n[metric.M]\nvalue = \"{value}\"\n[experiment]\nopen = true\n").into_bytes()
    }));
    found.push(b"[column]\nown = \"int\"\n[metric.A]\nvalue = \"count(own > 3)\"\n".to_vec());
    found
}

/// An expression for each construct of the grammar.
const EXPRESSIONS: [&str; 13] = [
    "first(action = 'done')",
    "coalesce(last(mirror_visible and t < length()), 7)",
    "any(x is null or x between 1 and 3)",
    "all(not (bumped is true)) and experiment in ('E1', 'E2')",
    "sum(case when x > 2 then x * 2 - 1 else -x end)",
    "min(x % 3) + max(x div 2)",
    "at(x, first(self_color <> 'unknown'))",
    "count(regexp_like(reasoning, '(?i)maybe'))",
    "nullif(count(true), 0)",
    "count(pose_x is distinct from 1.5)",
    "case experiment when 'E1' then 1 when 'E2' then 2 end",
    "sum(9223372036854775807)",
    "count(x < lag(x)) + count(lag(lag(action)) = action)",
];

const STYLE: &[u8] = b"[print]\ncell = \"mean_se\"\nrounding = \"once\"\ndecimals = { rate = 2, quantity = 1 }\nemphasis = \"none\"\n\
single_se = \"zero\"\nmark_n_below = 5\n[column.TSA]\nlatex = \"TSA\"\nbetter = \"higher\"\n[table.main]\ntitle = \"x\"\ncolumns = [\"TSA\"]\n";

const LOST: &[u8] = br#"{"episode_id":"E1/m/s1/r1","model":"m","experiment":"E1","seed":1,"run":1,"step":4,"status":"timeout","reason":"x"}
{"episode_id":"b","model":"m","condition":"c","experiment":"E9","seed":-1,"run":2147483647,"step":null,"status":null,"reason":""}
"#;

fn registered() -> Vec<u8> {
    let request = PlanRequest {
        given: Given::Runs(7),
        baseline: Some(0.5),
        power: 0.8,
        confidence: 0.95,
        models: 2,
        clusters: Clusters { seeds: 3, icc: 0.1, people: false },
        discordance: None,
        chance: None,
        sequential: false,
    };
    let named = |name: &str| NamedHash { name: name.into(), sha256: "00".repeat(32) };
    let plan = plan(request).expect("a plan that can be");
    RegisteredPlan::new(plan, named("paper"), vec![named("E1")], vec![named("cube-selection")]).to_json().into_bytes()
}

fn scores() -> Vec<Vec<u8>> {
    let traces = episodes::open();
    let definitions = Definitions::load("paper", &vocabulary::trace_columns(traces)).expect("built in");
    let table = score_traces::score(traces, &definitions, &[], std::num::NonZeroUsize::MIN).expect("a sound trace");
    let formats = [Format::Csv, Format::JsonLines, Format::Parquet];
    let of = |(at, format): (u8, Format)| {
        let mut bytes = vec![at];
        format::write(&table, format, &mut bytes).expect("memory takes any bytes");
        bytes
    };
    (0..).zip(formats).map(of).collect()
}

const REPLY: &str = r#"{"view-description":"a mirror","reasoning":"it is me","action":"d","selected_cube":"red","identification":"I am red","summary":"s"}"#;

/// An answer in each provider's wire format.
fn bodies() -> [Value; 4] {
    let chat = json!({ "model": "m-1", "choices": [{ "finish_reason": "stop", "message": { "content": REPLY } }],
        "usage": { "prompt_tokens": 11, "completion_tokens": 7, "cost": 0.5 } });
    let gemini = json!({ "modelVersion": "g-1",
        "candidates": [{ "finishReason": "STOP", "content": { "parts": [{ "thought": true, "text": "hm" }, { "text": REPLY }] } }],
        "usageMetadata": { "promptTokenCount": 11, "candidatesTokenCount": 7, "thoughtsTokenCount": 3 } });
    let messages = json!({ "model": "c-1", "stop_reason": "end_turn", "content": [{ "type": "text", "text": REPLY }],
        "usage": { "input_tokens": 11, "output_tokens": 7 } });
    [chat.clone(), chat, gemini, messages]
}

fn replies() -> Vec<Vec<u8>> {
    let of = |(at, body): (u8, Value)| [vec![at], body.to_string().into_bytes()].concat();
    let mut found: Vec<Vec<u8>> = (0..).zip(bodies()).map(of).collect();
    let fenced = format!("<think>so</think>Here:\n```json\n{REPLY}\n```");
    let loose = REPLY.replace("\"s\"}", "\"s\",}").replace("\"red\"", "'red'");
    for raw in [REPLY, &fenced, &loose, "", "{\"action\": \"w\"", "no object"] {
        found.push([b"\x04", raw.as_bytes()].concat());
    }
    let refused = json!({ "error": { "code": "content_policy_violation", "message": "refused" } }).to_string();
    found.push([vec![0], refused.into_bytes()].concat());
    found
}

fn journal() -> Vec<u8> {
    let mut lines = Vec::new();
    for (t, body) in (1..).zip(bodies()) {
        let question = format!("q{t}");
        let (question_of, at_most) = (question.clone(), [100, 50]);
        let request = Entry::Request { t, attempt: 1, question: question_of, frame: "f".into(), at_most };
        let failure = Entry::Failure {
            t,
            attempt: 1,
            status: "timeout".into(),
            detail: "d".into(),
            may_be_paid: t == 2,
            question: question.clone(),
        };
        let (latency_ms, model) = (5, (t == 2).then(|| "m".to_owned()));
        let answer = Entry::Answer { t, attempt: 2, question, latency_ms, model, body: body.to_string() };
        for entry in [request, failure, answer] {
            lines.extend(serde_json::to_vec(&entry).expect("texts and integers"));
            lines.push(b'\n');
        }
    }
    lines
}

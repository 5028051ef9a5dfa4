//! A model behind a provider, against a server on loopback that behaves and misbehaves.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use mirrorstats::agent::reply::Repair;
use mirrorstats::agent::vlm::dialect::Dialect;
use mirrorstats::agent::vlm::limits::{Account, Limits, Spend};
use mirrorstats::agent::vlm::models::{Backend, Choice, Contract, Model, Prices};
use mirrorstats::agent::vlm::provider::{Patience, Provider};
use mirrorstats::agent::vlm::secrets::Secret;
use mirrorstats::agent::vlm::{OnOutage, Vlm};
use mirrorstats::agent::{Agent as _, Family, Lost, Observation, Reply, Status, Task};
use mirrorstats::base::frame::Frame;
use mirrorstats::trace::episode::Action;
use serde_json::{Value, json};
use tokio::runtime::Runtime;

const KEY: &str = "sk-loopback-0123456789";

/// What the server does with a request: the bytes that it sends, and whether it waits before.
type Script = dyn Fn(usize) -> Vec<u8> + Send + Sync;

struct Server {
    address: String,
    requests: Arc<Mutex<Vec<String>>>,
}

impl Server {
    fn start(script: impl Fn(usize) -> Vec<u8> + Send + Sync + 'static) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("http://{}/v1", listener.local_addr().unwrap());
        let requests = Arc::new(Mutex::new(Vec::new()));
        let (seen, script): (_, Arc<Script>) = (Arc::clone(&requests), Arc::new(script));
        let count = Arc::new(AtomicUsize::new(0));
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                let (seen, script, count) = (Arc::clone(&seen), Arc::clone(&script), Arc::clone(&count));
                std::thread::spawn(move || serve(stream.unwrap(), &seen, &*script, &count));
            }
        });
        Self { address, requests }
    }

    fn requests(&self) -> Vec<String> {
        self.requests.lock().unwrap().clone()
    }
}

/// Answers one request and closes the connection.
fn serve(mut stream: TcpStream, seen: &Mutex<Vec<String>>, script: &Script, count: &AtomicUsize) {
    let mut reader = BufReader::new(stream.try_clone().unwrap());
    let (mut head, mut length) = (String::new(), 0);
    loop {
        let mut line = String::new();
        if reader.read_line(&mut line).unwrap_or(0) == 0 || line == "\r\n" {
            break;
        }
        if let Some(value) = line.to_ascii_lowercase().strip_prefix("content-length:") {
            length = value.trim().parse().unwrap();
        }
        head.push_str(&line);
    }
    let mut body = vec![0; length];
    if reader.read_exact(&mut body).is_err() {
        return;
    }
    seen.lock().unwrap().push(format!("{head}\n{}", String::from_utf8(body).unwrap()));
    let answer = script(count.fetch_add(1, Ordering::SeqCst));
    let _ = stream.write_all(&answer);
}

fn http(status: &str, headers: &str, body: &[u8]) -> Vec<u8> {
    let head = format!("HTTP/1.1 {status}\r\nconnection: close\r\n{headers}content-length: {}\r\n\r\n", body.len());
    [head.as_bytes(), body].concat()
}

const JSON: &str = "content-type: application/json\r\n";

fn decision(action: &str) -> String {
    json!({
        "view-description": "a wall", "reasoning": "none", "action": action, "summary": "went on",
        "selected_cube": "none", "identification": "I am red",
    })
    .to_string()
}

fn completion(text: &str, finish: &str) -> Vec<u8> {
    let body = json!({
        "id": "1", "object": "chat.completion", "model": "model-1",
        "choices": [{ "index": 0, "finish_reason": finish, "message": { "role": "assistant", "content": text } }],
        "usage": { "prompt_tokens": 1000, "completion_tokens": 100 },
    });
    http("200 OK", JSON, body.to_string().as_bytes())
}

fn patience() -> Patience {
    Patience {
        attempts: 3,
        timeout: Duration::from_millis(800),
        first_delay: Duration::from_millis(5),
        longest_delay: Duration::from_millis(20),
        largest_answer: 100_000,
        ..Patience::default()
    }
}

fn choice(dialect: Dialect) -> Choice {
    let prices = Some(Prices { input: 1.0, output: 10.0 });
    Choice {
        name: "Loopback".to_owned(),
        model: Model {
            vendor: None,
            backend: "loopback".to_owned(),
            id: "model-1".to_owned(),
            prices,
            contract: Contract::Schema,
        },
        backend: Backend { dialect, base_url: None, key: "UNUSED".to_owned() },
    }
}

struct Bench {
    folder: tempfile::TempDir,
    network: Runtime,
    account: Arc<Account>,
}

impl Bench {
    fn new(limits: Limits) -> Self {
        let network = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        let account = Arc::new(Account::new(limits, Spend::default()));
        Self { folder: tempfile::tempdir().unwrap(), network, account }
    }

    fn vlm(&self, server: &Server, dialect: Dialect, on_outage: OnOutage) -> Arc<Vlm> {
        let secret = Some(Secret::new(KEY.to_owned()));
        let provider = Provider::new(&server.address, dialect, "model-1", secret, patience(), 4).unwrap();
        let (handle, folder) = (self.network.handle().clone(), self.folder.path().to_owned());
        let account = Arc::clone(&self.account);
        Arc::new(Vlm::online(choice(dialect), provider, handle, folder, account, on_outage, 500))
    }

    /// The replies to the first `steps` steps of an episode.
    fn play(vlm: &Arc<Vlm>, episode: &str, steps: i32) -> Vec<Result<Reply, Lost>> {
        let task = Task { family: Family::CubeSelection, stated_color: None, step_budget: 100, seed: 1 };
        let mut agent = vlm.agent(task, episode).unwrap();
        let local = tokio::runtime::Builder::new_current_thread().build().unwrap();
        (1..=steps).map(|t| local.block_on(agent.decide(&observation(t)))).collect()
    }

    /// Everything that was written.
    fn written(&self) -> String {
        let files = std::fs::read_dir(self.folder.path()).unwrap();
        files.map(|file| std::fs::read_to_string(file.unwrap().path()).unwrap()).collect()
    }
}

fn observation(t: i32) -> Observation {
    Observation {
        t,
        remaining: 101 - t,
        x: 0.0,
        y: 0.0,
        yaw: 0.0,
        bumped: false,
        history: None,
        frame: Arc::new(Frame::new(2, 1, vec![1, 2, 3, 4, 5, 6])),
    }
}

#[test]
fn every_reply_ends_in_its_named_status() {
    let cases: Vec<(&str, Vec<u8>, Status)> = vec![
        ("valid", completion(&decision("w"), "stop"), Status::Ok),
        ("fenced", completion(&format!("```json\n{}\n```", decision("w")), "stop"), Status::Repaired),
        ("no JSON", completion("I go on.", "stop"), Status::ParseFailed),
        ("deep nesting", completion(&"[".repeat(50_000), "stop"), Status::ParseFailed),
        (
            "a key twice",
            completion(&decision("w").replacen('{', "{\"action\":\"s\",", 1), "stop"),
            Status::SchemaInvalid,
        ),
        ("another action", completion(&decision("jump"), "stop"), Status::SchemaInvalid),
        ("cut off", completion(&decision("w"), "length"), Status::Truncated),
        ("filtered", completion("", "content_filter"), Status::Refusal),
        ("empty", completion("", "stop"), Status::Empty),
        ("no choice", http("200 OK", JSON, br#"{"choices": [], "usage": {}}"#), Status::Empty),
        ("429", http("429 Too Many Requests", "retry-after: 0\r\n", b"slow down"), Status::RateLimited),
        ("429 alone", http("429 Too Many Requests", "", b""), Status::RateLimited),
        ("500", http("500 Internal Server Error", "", b"oops"), Status::ServerError),
        ("503", http("503 Service Unavailable", "retry-after: 0\r\n", b""), Status::ServerError),
        ("HTML", http("200 OK", "content-type: text/html\r\n", b"<html>"), Status::ServerError),
        ("another language", http("200 OK", JSON, br#"{"hello": 1}"#), Status::ServerError),
        ("not UTF-8", http("200 OK", JSON, b"{\"choices\": \"\xff\"}"), Status::ServerError),
        ("huge", http("200 OK", JSON, &vec![b' '; 200_000]), Status::ServerError),
        ("cut connection", b"HTTP/1.1 200 OK\r\ncontent-length: 100\r\n\r\nhalf".to_vec(), Status::ServerError),
        ("nothing", Vec::new(), Status::ServerError),
    ];
    let bench = Bench::new(Limits::default());
    for (name, answer, status) in cases {
        let server = Server::start(move |_| answer.clone());
        let vlm = bench.vlm(&server, Dialect::OpenaiChat, OnOutage::StandStill);
        let reply = Bench::play(&vlm, &name.replace(' ', "-"), 1).remove(0).unwrap();
        assert_eq!(reply.status, status, "{name}");
        let repairs = Repair::joined(&reply.repairs);
        assert_eq!(repairs.as_deref(), (status == Status::Repaired).then_some("code_fence"), "{name}");
        let has_decision = matches!(status, Status::Ok | Status::Repaired);
        assert_eq!(reply.action.is_some(), has_decision, "{name}");
        assert_eq!(reply.self_color.as_deref(), has_decision.then_some("red"), "{name}");
        let is_outage = matches!(status, Status::RateLimited | Status::ServerError | Status::Timeout);
        assert_eq!(server.requests().len(), if is_outage { 3 } else { 1 }, "{name}");
    }
}

#[test]
fn a_slow_answer_is_a_timeout_and_loses_the_episode() {
    let server = Server::start(|_| {
        std::thread::sleep(Duration::from_secs(2));
        Vec::new()
    });
    let bench = Bench::new(Limits::default());
    let lost = Bench::play(&bench.vlm(&server, Dialect::OpenaiChat, OnOutage::Lose), "slow", 1).remove(0).unwrap_err();
    assert!(lost.cause.starts_with("step 1: timeout after 3 attempts"), "{lost}");
}

#[test]
fn what_was_answered_is_never_asked_again_and_plays_without_a_network() {
    let server = Server::start(|at| match at {
        1 => http("500 Internal Server Error", "", b""),
        _ => completion(&decision(if at % 2 == 0 { "a" } else { "w" }), "stop"),
    });
    let bench = Bench::new(Limits::default());
    let first: Vec<_> = Bench::play(&bench.vlm(&server, Dialect::OpenaiChat, OnOutage::Lose), "episode", 3)
        .into_iter()
        .map(Result::unwrap)
        .collect();
    assert_eq!(server.requests().len(), 4);
    assert_eq!(first[0].action, Some(Action::TurnLeft));
    assert!((first[0].usage.cost_usd.unwrap() - 0.002).abs() < 1e-12);

    // A line that was cut off by the end of a process was acted on by nobody.
    let journal = bench.folder.path().join("episode.jsonl");
    let mut text = std::fs::read_to_string(&journal).unwrap();
    text.push_str("{\"kind\":\"answer\",\"t\":4,\"att");
    std::fs::write(&journal, text).unwrap();
    let again = Bench::play(&bench.vlm(&server, Dialect::OpenaiChat, OnOutage::Lose), "episode", 3);
    assert_eq!(again.into_iter().map(Result::unwrap).collect::<Vec<_>>(), first);
    assert_eq!(server.requests().len(), 4, "nothing is asked again");

    let cassette = Arc::new(Vlm::cassette(choice(Dialect::OpenaiChat), bench.folder.path().to_owned(), 500));
    let played = Bench::play(&cassette, "episode", 4);
    assert_eq!(played[..3].iter().cloned().map(Result::unwrap).collect::<Vec<_>>(), first);
    assert!(played[3].as_ref().unwrap_err().cause.contains("no answer for step 4"));

    let another = Arc::new(Vlm::cassette(choice(Dialect::OpenaiChat), bench.folder.path().to_owned(), 501));
    let refused = Bench::play(&another, "episode", 1).remove(0).unwrap_err();
    assert!(refused.cause.contains("belongs to another request"), "{refused}");
}

#[test]
fn no_key_is_in_anything_that_is_kept_or_told() {
    let echo = format!("{{\"error\": \"your key {KEY} is wrong\"}}");
    let server = Server::start(move |at| match at {
        0 => http("500 Internal Server Error", JSON, echo.as_bytes()),
        1 => completion(&decision("w").replace("a wall", KEY), "stop"),
        _ => http("401 Unauthorized", JSON, echo.as_bytes()),
    });
    let bench = Bench::new(Limits::default());
    let vlm = bench.vlm(&server, Dialect::OpenaiChat, OnOutage::Lose);
    let replies = Bench::play(&vlm, "episode", 2);
    assert_eq!(replies[0].as_ref().unwrap().words.view_description.as_deref(), Some("[key]"));
    let refused = replies[1].as_ref().unwrap_err();
    assert!(refused.cause.contains("refuses the request: HTTP 401") && refused.cause.contains("[key]"), "{refused}");
    assert!(vlm.stopped().is_some());
    let told = format!("{replies:?}{vlm:?}{}{}", bench.written(), vlm.description());
    assert!(!told.contains(KEY));
    assert!(server.requests()[0].contains(KEY), "the header does carry it");
}

#[test]
fn limits_stop_before_the_request_over_them() {
    let server = Server::start(|_| completion(&decision("w"), "stop"));
    let bench = Bench::new(Limits { requests: Some(2), ..Limits::default() });
    let vlm = bench.vlm(&server, Dialect::OpenaiChat, OnOutage::Lose);
    let replies = Bench::play(&vlm, "episode", 3);
    assert!(replies[0].is_ok() && replies[1].is_ok());
    assert!(replies[2].as_ref().unwrap_err().cause.contains("limit of requests is reached: 2 of 2"));
    assert_eq!(server.requests().len(), 2);
}

#[test]
fn each_provider_is_asked_in_its_language() {
    let answers = [
        (Dialect::OpenaiChat, completion(&decision("w"), "stop"), "/v1/chat/completions"),
        (Dialect::OpenaiCompatible, completion(&decision("w"), "stop"), "/v1/chat/completions"),
        (
            Dialect::Gemini,
            http(
                "200 OK",
                JSON,
                json!({
                    "candidates": [{ "finishReason": "STOP", "content": { "parts": [
                        { "text": "hm", "thought": true }, { "text": decision("w") },
                    ] } }],
                    "usageMetadata": { "promptTokenCount": 5, "candidatesTokenCount": 6, "thoughtsTokenCount": 7 },
                })
                .to_string()
                .as_bytes(),
            ),
            "/v1/models/model-1:generateContent",
        ),
        (
            Dialect::AnthropicMessages,
            http(
                "200 OK",
                JSON,
                json!({
                    "content": [{ "type": "text", "text": decision("w") }], "stop_reason": "end_turn",
                    "usage": { "input_tokens": 5, "output_tokens": 13 },
                })
                .to_string()
                .as_bytes(),
            ),
            "/v1/messages",
        ),
    ];
    for (dialect, answer, path) in answers {
        let server = Server::start(move |_| answer.clone());
        let bench = Bench::new(Limits::default());
        let reply = Bench::play(&bench.vlm(&server, dialect, OnOutage::Lose), "episode", 1).remove(0).unwrap();
        assert_eq!((reply.status, reply.action), (Status::Ok, Some(Action::MoveForward)), "{dialect:?}");
        assert!(reply.usage.completion_tokens.is_some_and(|tokens| tokens == 13 || tokens == 100), "{dialect:?}");
        let request = server.requests().remove(0);
        let (head, body) = request.split_once("\n{").unwrap();
        assert!(head.starts_with(&format!("POST {path} ")), "{head}");
        let body: Value = serde_json::from_str(&format!("{{{body}")).unwrap();
        let text = body.to_string();
        assert!(text.contains("0.2") && text.contains("You are a robot control agent."), "{dialect:?}");
        assert!(text.contains("selected_cube"), "the schema is asked for: {dialect:?}");
    }
}

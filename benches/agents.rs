//! The cost of waiting for a model. `make bench-agents` prints the steps per second that `record` reaches with two
//! agents, 64 episodes in flight. One answers at once, so drawing, counting and writing are the limit. The other asks a
//! loopback server that takes a second per answer.
//!
//! With 64 in flight and one second per answer, 64 steps per second are the most, and drawing may allow fewer. The
//! ideal rate is the lower of the two. Frames of 32 x 24 cost almost nothing, so that only the waiting is measured.
//!
//! E5 with logs, on as many threads as there are cores; `STEPS` steps per episode (40 by default). The server runs in
//! the same process and shares its cores, which a provider would not.

use std::fmt::Write as _;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread;
use std::time::{Duration, Instant};

use mirrorstats_agents::{Agent, Decision, Lost, Observation, Player, Reply, Status, Task, Turn, Usage, Words};
use mirrorstats_experiment::Experiment;
use mirrorstats_record::lock::FolderLock;
use mirrorstats_record::metadata;
use mirrorstats_record::plan::{Key, Plan, Shard, Subject};
use mirrorstats_record::run::{Progress, Recording, Settings};
use mirrorstats_record::store::Store;
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_trace::episodes::episode::{Action, Step};
use mirrorstats_vlm::Vlm;
use mirrorstats_vlm::limits::Account;
use mirrorstats_vlm::models::{Backend, Choice, Contract, Model, Prices};
use mirrorstats_vlm::provider::{Patience, Provider};
use mirrorstats_vlm::wire_format::WireFormat;
use tokio::runtime::Runtime;

const IN_FLIGHT: usize = 64;
const ANSWER_TAKES: Duration = Duration::from_secs(1);
const REPLY: &str =
    r#"{"view-description":"a wall","reasoning":"go on","action":"a","summary":"turned","identification":"unknown"}"#;

/// Turns left without any delay.
struct AtOnce;

impl Agent for AtOnce {
    fn decide<'a>(&'a mut self, _: &'a Observation) -> Decision<'a> {
        let reply = Reply {
            status: Status::Ok,
            repairs: Vec::new(),
            fault: None,
            action: Some(Action::TurnLeft),
            self_color: None,
            selected_cube: None,
            mark_report: None,
            answers: mirrorstats_agents::Answers::new(),
            words: Words::default(),
            raw: Some(REPLY.to_owned()),
            usage: Usage::default(),
            model: None,
        };
        Box::pin(std::future::ready(Ok(reply)))
    }
}

impl Player for AtOnce {
    fn model(&self) -> &'static str {
        "at once"
    }

    fn description(&self) -> serde_json::Value {
        "answers at once".into()
    }

    fn agent(&self, _: Task, _: &str) -> Result<Box<dyn Agent>, Lost> {
        Ok(Box::new(Self))
    }
}

/// A model behind the server.
struct Behind {
    vlm: Arc<Vlm>,
    _network: Runtime,
}

impl Behind {
    fn new(folder: &Path) -> Self {
        let address = serve();
        let network = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        let wire_format = WireFormat::OpenaiCompatible;
        let provider = Provider::new(&address, wire_format, "model", None, Patience::default(), IN_FLIGHT).unwrap();
        let model = Model {
            vendor: None,
            backend: "loopback".into(),
            id: "model".into(),
            answers_as: vec!["*".into()],
            accepted: Vec::new(),
            prices: Prices::default(),
            contract: Contract::Schema,
            max_output_tokens: None,
            reasoning_effort: None,
            temperature: None,
            extra_body: serde_json::Map::new(),
        };
        let backend = Backend {
            wire_format,
            base_url: Some(address),
            key: "UNUSED".into(),
            plain_http: false,
            extra_body: serde_json::Map::new(),
        };
        let choice = Choice { name: "a second".into(), model, backend, is_known: true };
        let (handle, account) = (network.handle().clone(), Arc::<Account>::default());
        let vlm = Vlm::online(choice, provider, handle, folder.join("journal"), account);
        Self { vlm: Arc::new(vlm), _network: network }
    }
}

impl Player for Behind {
    fn model(&self) -> &str {
        &self.vlm.choice().name
    }

    fn description(&self) -> serde_json::Value {
        self.vlm.description()
    }

    fn agent(&self, task: Task, episode_id: &str) -> Result<Box<dyn Agent>, Lost> {
        let agent = self.vlm.agent(task, &episode_id.replace('/', "-"));
        Ok(Box::new(agent.map_err(|error| Lost::because(error.to_string()))?))
    }
}

/// Starts a server that takes a second per answer, with one thread per connection.
fn serve() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("http://{}/v1", listener.local_addr().unwrap());
    thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            thread::spawn(move || while answer(&stream).is_some() {});
        }
    });
    address
}

/// Answers one request; `None` at the end of the connection.
fn answer(stream: &TcpStream) -> Option<()> {
    let mut reader = BufReader::new(stream);
    let mut length = 0;
    loop {
        let mut line = String::new();
        if reader.read_line(&mut line).ok()? == 0 {
            return None;
        }
        if line == "\r\n" {
            break;
        }
        if let Some(value) = line.to_ascii_lowercase().strip_prefix("content-length:") {
            length = value.trim().parse().ok()?;
        }
    }
    std::io::copy(&mut reader.take(length), &mut std::io::sink()).ok()?;
    thread::sleep(ANSWER_TAKES);
    let message = serde_json::json!({ "role": "assistant", "content": REPLY });
    let body = serde_json::json!({
        "choices": [{ "index": 0, "finish_reason": "stop", "message": message }],
        "usage": { "prompt_tokens": 1000, "completion_tokens": 100 },
    })
    .to_string();
    let mut answer = String::new();
    write!(answer, "HTTP/1.1 200 OK\r\ncontent-type: application/json\r\ncontent-length: {}\r\n\r\n{body}", body.len())
        .ok()?;
    let mut stream = stream;
    stream.write_all(answer.as_bytes()).ok()
}

struct Quiet;

impl Progress for Quiet {
    fn step(&self, _: &Key, _: i32, _: &Step) {}

    fn episode(&self, _: &Key, _: &str, _: usize) {}

    fn model_changed(&self, _: &str, _: i32, _: &str, _: &str) {}

    fn lost(&self, id: &str, reason: &str) {
        eprintln!("lost {id}: {reason}");
    }
}

/// Steps per second of a recording.
fn measure(config: &WorldConfig, player: &dyn Player, folder: &Path, threads: NonZeroUsize) -> f64 {
    let subject = Subject::for_model(player.model());
    let store = Store::new(
        Arc::new(FolderLock::take(&folder.join("runs")).unwrap()),
        subject.clone(),
        metadata::Recordings::new(&[Experiment::E5], config, player, None, None),
    );
    let plan = Plan { experiments: vec![Experiment::E5], seeds: 1, runs: 64, repeats: 1, shard: Shard::WHOLE };
    let keys: Vec<Key> = plan.keys();
    let stop = AtomicBool::new(false);
    let in_flight = NonZeroUsize::new(IN_FLIGHT).unwrap();
    let settings = Settings { threads, in_flight, frames: true, log: true, casts: true, max_unusable: None };
    let (store, subject) = (&store, &subject);
    let recording =
        Recording { config, player, turn: &|_| Turn::Now, subject, store, progress: &Quiet, stop: &stop, settings };
    let start = Instant::now();
    let tally = recording.run(&keys).unwrap();
    #[expect(clippy::cast_precision_loss, reason = "some thousand steps")]
    let steps = tally.steps as f64;
    steps / start.elapsed().as_secs_f64()
}

fn main() {
    // `cargo test` also runs benches; it has nothing to measure.
    if std::env::args().any(|argument| argument == "--test") {
        return;
    }
    let steps = std::env::var("STEPS").ok().and_then(|steps| steps.parse().ok()).unwrap_or(40);
    let threads = thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
    println!("E5, {threads} threads, {IN_FLIGHT} episodes of {steps} steps, all in flight");
    for [width, height] in [[640, 480], [32, 24]] {
        let config = format!("episode.steps = {steps}\neye.width = {width}\neye.height_px = {height}");
        let config = WorldConfig::from_toml(&config).expect("steps and frames of this size are allowed");
        let folder = tempfile::tempdir().expect("there is a place for temporary files");
        println!("frames of {width} x {height}");
        let alone = measure(&config, &AtOnce, folder.path(), threads);
        println!("  answers at once      {alone:6.1} steps/s");
        let waiting = measure(&config, &Behind::new(folder.path()), folder.path(), threads);
        println!("  answers in a second  {waiting:6.1} steps/s");
        #[expect(clippy::cast_precision_loss, reason = "some dozens")]
        let answered = IN_FLIGHT as f64 / ANSWER_TAKES.as_secs_f64();
        let ideal = answered.min(alone);
        println!("  {:.1} % of {ideal:.1} steps/s, which answers and frames allow", 100.0 * waiting / ideal);
    }
}

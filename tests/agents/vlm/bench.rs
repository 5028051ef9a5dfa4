//! One model and one server, without a world: the tests request steps directly.

use std::num::NonZeroU32;
use std::sync::Arc;
use std::time::Duration;

use mirrorstats_agents::secrets::Secret;
use mirrorstats_agents::{Agent as _, Lost, Observation, Reply, Task};
use mirrorstats_experiment::Experiment;
use mirrorstats_experiment::spec::Stated;
use mirrorstats_trace::frame::Frame;
use mirrorstats_vlm::Vlm;
use mirrorstats_vlm::limits::{Account, Limits};
use mirrorstats_vlm::models::{Backend, Choice, Contract, Model, Prices};
use mirrorstats_vlm::provider::{Patience, Provider};
use mirrorstats_vlm::wire_format::WireFormat;
use tempfile::TempDir;
use tokio::runtime::Runtime;

use super::server::Server;

pub const KEY: &str = "sk-loopback-0123456789";

/// Patient enough for a busy machine, with short waits between attempts.
pub fn patience() -> Patience {
    Patience {
        attempts: 3,
        timeout: Duration::from_secs(20),
        first_delay: Duration::from_millis(2),
        longest_delay: Duration::from_millis(4),
        longest_asked_delay: Duration::from_millis(30),
        longest_wait: Duration::from_millis(200),
        largest_answer: 100_000,
        ..Patience::default()
    }
}

pub fn choice(wire_format: WireFormat) -> Choice {
    let prices = Prices { input: Some(1.0), cached_input: Some(0.1), output: Some(10.0) };
    Choice {
        name: "Loopback".to_owned(),
        model: Model {
            vendor: None,
            backend: "loopback".to_owned(),
            id: "model-1".to_owned(),
            prices,
            contract: Contract::Schema,
            max_output_tokens: NonZeroU32::new(500),
            reasoning_effort: None,
            temperature: Some(0.2),
            extra_body: serde_json::Map::new(),
            answers_as: Vec::new(),
            accepted: Vec::new(),
        },
        backend: Backend {
            wire_format,
            base_url: None,
            key: "UNUSED".to_owned(),
            plain_http: false,
            extra_body: serde_json::Map::new(),
        },
        is_known: true,
    }
}

pub struct Bench {
    pub folder: TempDir,
    network: Runtime,
    account: Arc<Account>,
}

impl Bench {
    pub fn new(limits: Limits) -> Self {
        let network = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        let account = Arc::new(Account::new(limits));
        Self { folder: tempfile::tempdir().unwrap(), network, account }
    }

    pub fn vlm(&self, server: &Server, wire_format: WireFormat) -> Arc<Vlm> {
        self.vlm_with(server, wire_format, patience())
    }

    pub fn vlm_with(&self, server: &Server, wire_format: WireFormat, patience: Patience) -> Arc<Vlm> {
        self.vlm_of(server, choice(wire_format), patience)
    }

    pub fn vlm_of(&self, server: &Server, choice: Choice, patience: Patience) -> Arc<Vlm> {
        let wire_format = choice.backend.wire_format;
        let secret = Some(Secret::new(KEY.to_owned()));
        let provider = Provider::new(&server.address, wire_format, &choice.model.id, secret, patience, 4).unwrap();
        let (handle, folder) = (self.network.handle().clone(), self.folder.path().to_owned());
        let account = Arc::clone(&self.account);
        Arc::new(Vlm::online(choice, provider, handle, folder, account))
    }

    /// The replies to the first `steps` steps of an episode.
    pub fn play(vlm: &Arc<Vlm>, episode: &str, steps: i32) -> Vec<Result<Reply, Lost>> {
        Self::play_task(vlm, task(Experiment::E1), episode, steps)
    }

    /// The replies to the first `steps` steps of another task.
    pub fn play_task(vlm: &Arc<Vlm>, task: Task, episode: &str, steps: i32) -> Vec<Result<Reply, Lost>> {
        let mut agent = vlm.agent(task, episode).unwrap();
        let local = tokio::runtime::Builder::new_current_thread().build().unwrap();
        (1..=steps).map(|t| local.block_on(agent.decide(&observation(t)))).collect()
    }

    /// The contents of all written files.
    pub fn written(&self) -> String {
        let files = std::fs::read_dir(self.folder.path()).unwrap();
        files.map(|file| std::fs::read_to_string(file.unwrap().path()).unwrap()).collect()
    }
}

/// A task; with a false colour if the experiment states one.
pub fn task(experiment: Experiment) -> Task {
    let stated_color = (experiment.stated_color != Stated::None).then(|| "yellow".to_owned());
    Task { experiment, stated_color, step_budget: 100, seed: 1 }
}

/// The observation before a step.
pub fn observation(t: i32) -> Observation {
    Observation {
        t,
        remaining: 101 - t,
        x: 0.0,
        y: 0.0,
        yaw: 0.0,
        bumped: false,
        history: None,
        frame: Arc::new(Frame::new(2, 1, vec![1, 2, 3, 4, 5, 6])),
        past: Arc::default(),
        fov_y: 110.0,
    }
}

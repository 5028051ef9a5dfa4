//! A person as the agent: the same frame, words and reply as for a model, in a browser.
//!
//! Rule: a person gets what a model gets and nothing else: no body colour, no pixel count, no id. Each person has a
//! link and a code; no other personal data is stored.

pub mod design;
pub mod hub;
pub mod journal;
pub mod seat;
pub mod server;

use std::sync::{Arc, Mutex};

use serde_json::{Value, json};

use self::hub::Hub;
use self::journal::PlayedStep;
use self::seat::{Given, PlayerQuestion};
use self::server::Server;
use super::prompt::{self, Prompt, Rendered};
use super::reply::{self, Ending};
use super::{Agent, Decision, Ended, Farewell, Lost, Observation, Person, Player, Reply, Task, Usage, locked};
use mirrorstats_exact::hash;

const PROTOCOL: u32 = 3;

#[derive(Debug)]
pub struct Human {
    model: String,
    /// SHA-256 of the consent text; `None` if no consent is asked for.
    consent: Option<String>,
    hub: Arc<Hub>,
    /// `None` if nobody is asked to play, and at the end of the recording.
    server: Mutex<Option<Server>>,
}

impl Human {
    pub fn new(model: &str, hub: Arc<Hub>, server: Option<Server>) -> Self {
        let consent = hub.terms.consent.as_deref().map(|words| hash::of_bytes(words.as_bytes()));
        Self { model: model.to_owned(), consent, hub, server: Mutex::new(server) }
    }

    pub fn hub(&self) -> &Hub {
        &self.hub
    }

    pub fn end(&self, is_complete: bool) {
        self.hub.end(is_complete);
        drop(locked(&self.server).take());
    }
}

impl Player for Human {
    fn model(&self) -> &str {
        &self.model
    }

    fn description(&self) -> Value {
        let schedule = &self.hub.schedule;
        json!({
            "human": self.model,
            "protocol": PROTOCOL,
            "view": {
                "frame": "the frame of a model, drawn as large as the window allows",
                "words": "the system prompt and the user prompt of a model",
                "history": "what the prompt tells of the steps before: action and summary of the last one, or every action where a hand reaches",
                "position": true,
                "remaining_steps": true,
            },
            "reply": "the keys of a model's reply: actions by keys or buttons, colours from a list, free text; all but the \
                      action may stay empty",
            "prefilled_identification": self.hub.terms.prefills,
            "practice": "one episode of another scene before the first, not recorded; its end is announced",
            "begin": "each episode begins when the person says so",
            "clock": "breaks and times of more than 10 s without the page do not count",
            "time_limit": null,
            "design": schedule.design.name(),
            "order": schedule.design.order(),
            "consent": self.consent,
            "identification_version": mirrorstats_identification::VERSION,
        })
    }

    fn agent(&self, task: Task, episode_id: &str) -> Result<Box<dyn Agent>, Lost> {
        let prompt = Prompt::for_experiment(&task.experiment).map_err(|fault| Lost::because(fault.to_string()))?;
        let seat = self.hub.sit(episode_id).ok_or_else(Lost::by_leaving)?;
        let code = self.hub.code(seat);
        let hub = Arc::clone(&self.hub);
        let (practice, episode_id, has_ended) = (None, episode_id.to_owned(), false);
        Ok(Box::new(HumanAgent { hub, seat, code, task, practice, prompt, episode_id, has_ended }))
    }

    fn waits(&self) -> bool {
        true
    }
}

#[derive(Debug)]
struct HumanAgent {
    hub: Arc<Hub>,
    seat: usize,
    code: String,
    task: Task,
    practice: Option<Task>,
    prompt: Prompt,
    episode_id: String,
    has_ended: bool,
}

impl Drop for HumanAgent {
    fn drop(&mut self) {
        if !self.has_ended {
            self.hub.over(self.seat, &self.episode_id, false);
        }
    }
}

impl Agent for HumanAgent {
    fn decide<'a>(&'a mut self, observation: &'a Observation) -> Decision<'a> {
        Box::pin(self.step(observation))
    }

    fn end(&mut self, ended: Ended) -> Farewell<'_> {
        self.has_ended = true;
        self.hub.over(self.seat, &self.episode_id, ended != Ended::Stopped);
        Box::pin(std::future::ready(()))
    }

    fn person(&mut self) -> Option<&mut dyn Person> {
        Some(self)
    }
}

impl Person for HumanAgent {
    fn code(&self) -> &str {
        &self.code
    }

    fn wants_practice(&self) -> bool {
        !self.hub.seat(self.seat).has_practised
    }

    fn practise(&mut self, task: Option<Task>) {
        if task.is_none() {
            self.hub.practised(self.seat);
        }
        self.practice = task;
    }
}

impl HumanAgent {
    async fn step(&mut self, observation: &Observation) -> Result<Reply, Lost> {
        let task = self.practice.as_ref().unwrap_or(&self.task);
        let is_practice = self.practice.is_some();
        if let Some(entry) = self.hub.answered(self.seat, &self.episode_id, observation.t).filter(|_| !is_practice) {
            return Ok(read(&entry.reply, task, entry.latency_ms));
        }
        let Rendered { system, user } = self.prompt.render(task, observation).map_err(Lost::unobservable)?;
        let question = PlayerQuestion {
            frame: Arc::clone(&observation.frame),
            system,
            user,
            t: observation.t,
            is_practice,
            experiment: task.experiment.clone(),
            actions: prompt::actions(task.experiment.actions).iter().map(|action| prompt::letter(*action)).collect(),
        };
        let given = self.hub.ask(self.seat, question).await;
        let gone = || if self.hub.is_stopping() { Lost::by_stop() } else { Lost::by_leaving() };
        let Given { reply, latency_ms } = given.ok_or_else(gone)?;
        if !is_practice {
            let (episode_id, reply) = (self.episode_id.clone(), reply.clone());
            let kept = self.hub.keep(&self.code, PlayedStep { episode_id, t: observation.t, latency_ms, reply });
            kept.map_err(|error| Lost::because(format!("the journal cannot be written: {error}")))?;
        }
        Ok(read(&reply, task, latency_ms))
    }
}

fn read(text: &str, task: &Task, latency_ms: i32) -> Reply {
    let usage = Usage { latency_ms: Some(latency_ms), ..Usage::default() };
    reply::read(text, &task.experiment, Ending::Whole).with_text(text.to_owned(), usage)
}

//! Agents that are functions of this process, such as those of a program that uses the library.
//!
//! A function gets the messages that a program gets ([`exec::message`](super::exec::message)), in the same order, and its
//! replies are read as those of a program are. A function that fails loses its episode, as a program that ends does.

use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use super::exec::Images;
use super::exec::conversation::Conversation;
use super::exec::message::{EndMessage, Message, PROTOCOL};
use super::exec::said::without;
use super::vlm::secrets::{Secret, from_every_key_variable};
use super::{Agent, Decision, Ended, Farewell, Lost, Observation, Player, Reply, Status, Task, Usage};
use exact::hash;

/// One episode's function: gets a message and gives its reply. What it gives for a task or for the end is not looked at.
pub type Listener = Box<dyn FnMut(&Message) -> Result<String, String>>;

/// Makes the function of each episode; an error is why there is none.
pub type Listeners = dyn Fn() -> Result<Listener, String> + Send + Sync;

/// What plays, and how it is dealt with.
pub struct Function {
    pub model: String,
    /// The text of the function, if it has one: recordings carry its hash.
    pub source: Option<String>,
    pub images: Images,
    /// The folder in which each episode gets one for its frames.
    pub scratch: PathBuf,
    /// Makes the function of each episode.
    pub listeners: Box<Listeners>,
}

/// A function as a player.
#[derive(Debug)]
pub struct FunctionPlayer {
    function: Function,
    secrets: Arc<[Secret]>,
}

impl FunctionPlayer {
    /// A player that calls the function.
    pub fn new(function: Function) -> Self {
        Self { function, secrets: from_every_key_variable().into() }
    }
}

impl fmt::Debug for Function {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Function").field("model", &self.model).field("images", &self.images).finish_non_exhaustive()
    }
}

impl Player for FunctionPlayer {
    fn model(&self) -> &str {
        &self.function.model
    }

    fn description(&self) -> serde_json::Value {
        let Function { model, source, images, .. } = &self.function;
        serde_json::json!({
            "function": model,
            "source": source.as_ref().map(|source| hash::of_bytes(source.as_bytes())),
            "protocol": PROTOCOL,
            "images": images.name(),
            "identification_version": trace::identification::VERSION,
        })
    }

    fn agent(&self, task: Task, episode_id: &str) -> Result<Box<dyn Agent>, Lost> {
        let Function { images, scratch, listeners, .. } = &self.function;
        let conversation = Conversation::new(task, episode_id, *images, scratch)?;
        let secrets = Arc::clone(&self.secrets);
        let listener = listeners().map_err(|fault| failed(&secrets, 0, &fault))?;
        Ok(Box::new(FunctionAgent { conversation, listener, secrets, steps: 0 }))
    }

    fn waits(&self) -> bool {
        true
    }
}

struct FunctionAgent {
    conversation: Conversation,
    listener: Listener,
    secrets: Arc<[Secret]>,
    steps: i32,
}

impl Agent for FunctionAgent {
    fn decide<'a>(&'a mut self, observation: &'a Observation) -> Decision<'a> {
        let reply = self.step(observation);
        Box::pin(std::future::ready(reply))
    }

    fn end(&mut self, reason: Ended) -> Farewell<'_> {
        // The episode is committed: what a function makes of its end changes nothing.
        let _ = (self.listener)(&Message::End(EndMessage { reason, steps: self.steps }));
        Box::pin(std::future::ready(()))
    }
}

impl FunctionAgent {
    fn step(&mut self, observation: &Observation) -> Result<Reply, Lost> {
        self.steps = observation.t;
        let (task, question) = self.conversation.messages(observation)?;
        let start = Instant::now();
        if let Some(task) = task {
            self.tell(&task)?;
        }
        let text = self.tell(&question)?;
        let latency_ms = Some(i32::try_from(start.elapsed().as_millis()).unwrap_or(i32::MAX));
        let text = without(&self.secrets, &text);
        Ok(self.conversation.read(text, Usage { latency_ms, ..Usage::default() }))
    }

    fn tell(&mut self, message: &Message) -> Result<String, Lost> {
        (self.listener)(message).map_err(|fault| failed(&self.secrets, self.steps, &fault))
    }
}

/// That the function gave no reply, without any key.
fn failed(secrets: &[Secret], step: i32, fault: &str) -> Lost {
    let at = if step == 0 { String::new() } else { format!("step {step}: ") };
    Lost::counted_as(Status::ServerError, without(secrets, &format!("{at}{fault}")))
}

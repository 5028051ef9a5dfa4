//! Agents that are functions of this process, such as those of a program that uses the library.
//!
//! A function gets the messages that a program gets ([`exec::message`](super::exec::message)), in the same order, and
//! its replies are read the same way. A function that fails loses its episode, as a program that ends does. Each
//! episode's function has its own thread, so several slow functions run at once, and a stopped recording waits for
//! none.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

use tokio::sync::oneshot;
use tokio::time::timeout;

use super::exec::Images;
use super::exec::conversation::Conversation;
use super::exec::message::{Message, PROTOCOL};
use super::reply::Ending;
use super::secrets::{Secret, from_every_key_variable};
use super::{Agent, Decision, Ended, Farewell, Lost, Observation, Player, Reply, Status, Task, Usage};
use mirrorstats_exact::hash;

/// One episode's function: gets a message and returns its reply. Return values for a task or an end are ignored.
pub type Listener = Box<dyn FnMut(&Message) -> Result<String, String> + Send>;

/// The interval of checks whether the recording is stopped.
const GLANCE: Duration = Duration::from_millis(20);

/// Makes the function of each episode, or returns the reason why it cannot.
pub(crate) type Listeners = dyn Fn() -> Result<Listener, String> + Send + Sync;

pub struct Function {
    pub model: String,
    /// The function's source text, if known: recordings carry its hash.
    pub source: Option<String>,
    pub images: Images,
    /// The parent folder of the episodes' temporary frame folders.
    pub scratch: PathBuf,
    pub listeners: Arc<Listeners>,
    /// Set to stop the recording: episodes under way then end without their functions.
    pub stop: Arc<AtomicBool>,
}

pub struct FunctionPlayer {
    function: Function,
    secrets: Arc<[Secret]>,
}

impl FunctionPlayer {
    pub fn new(function: Function) -> Self {
        Self { function, secrets: from_every_key_variable().into() }
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
            "identification_version": mirrorstats_identification::VERSION,
        })
    }

    fn agent(&self, task: Task, episode_id: &str) -> Result<Box<dyn Agent>, Lost> {
        let Function { images, scratch, listeners, stop, .. } = &self.function;
        let conversation = Conversation::new(task, episode_id, *images, scratch, &self.secrets)?;
        let (questions, stop) = (questions(Arc::clone(listeners))?, Arc::clone(stop));
        Ok(Box::new(FunctionAgent { conversation, questions, stop }))
    }

    fn waits(&self) -> bool {
        true
    }
}

type Question = (Message, oneshot::Sender<Result<String, String>>);

fn questions(listeners: Arc<Listeners>) -> Result<Sender<Question>, Lost> {
    let (questions, asked) = channel::<Question>();
    let answer = move || {
        let mut listener = listeners();
        for (message, reply) in asked {
            let said = listener.as_mut().map_err(|fault| fault.clone()).and_then(|listener| listener(&message));
            // If the recording is stopped, no receiver is left.
            let _ = reply.send(said);
        }
    };
    match thread::Builder::new().name("function".to_owned()).spawn(answer) {
        Ok(_) => Ok(questions),
        Err(error) => Err(Lost::because(format!("no thread for the function: {error}"))),
    }
}

struct FunctionAgent {
    conversation: Conversation,
    questions: Sender<Question>,
    stop: Arc<AtomicBool>,
}

impl Agent for FunctionAgent {
    fn decide<'a>(&'a mut self, observation: &'a Observation) -> Decision<'a> {
        Box::pin(self.step(observation))
    }

    fn end(&mut self, reason: Ended) -> Farewell<'_> {
        Box::pin(async move {
            // The episode is committed: the function's response to its end changes nothing.
            let _ = self.tell(self.conversation.end(reason)).await;
        })
    }
}

impl FunctionAgent {
    async fn step(&mut self, observation: &Observation) -> Result<Reply, Lost> {
        let (task, question) = self.conversation.messages(observation)?;
        let start = Instant::now();
        if let Some(task) = task {
            self.tell(task).await?;
        }
        let text = self.tell(question).await?;
        Ok(self.conversation.read(&text, Ending::Whole, Usage::of_time(start.elapsed())))
    }

    /// The reply to a message; a stopped recording ends the wait without losing the episode.
    async fn tell(&self, message: Message) -> Result<String, Lost> {
        let (reply, mut said) = oneshot::channel();
        // If the thread has ended, the question is dropped, which the receiver notices.
        let _ = self.questions.send((message, reply));
        loop {
            match timeout(GLANCE, &mut said).await {
                Ok(Ok(said)) => return said.map_err(|fault| self.failed(&fault)),
                Ok(Err(_)) => return Err(self.failed("the function ended without a reply")),
                Err(_) if self.stop.load(Ordering::Relaxed) => return Err(Lost::by_stop()),
                Err(_) => {}
            }
        }
    }

    fn failed(&self, fault: &str) -> Lost {
        let cause = self.conversation.without_secrets(&format!("step {}: {fault}", self.conversation.steps));
        Lost::counted_as(Status::ServerError, cause)
    }
}

//! The agent of a harness: it hands out each observation, and waits until the harness replies.
//!
//! The harness runs in the same thread as the episode, which stands still between two replies. So an episode that a
//! harness plays has the rows of an episode that the recorder plays.

use std::future::poll_fn;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::task::Poll;

use super::exec::Images;
use super::exec::conversation::Conversation;
use super::prompt::{Prompt, Rendered};
use super::reply::Ending;
use super::secrets::{Secret, from_every_key_variable};
use super::{Agent, Decision, Ended, Farewell, Lost, Observation, Player, Reply, Task, Usage, locked};

/// An observation that waits for a reply.
#[derive(Clone, Debug)]
pub struct Asked {
    pub task: Arc<Task>,
    pub observation: Observation,
}

impl Asked {
    /// The words that a model gets with the frame.
    pub fn prompt(&self) -> Result<Rendered, Lost> {
        let prompt = Prompt::for_experiment(&self.task.experiment).map_err(Lost::unobservable)?;
        prompt.render(&self.task, &self.observation).map_err(Lost::unobservable)
    }
}

/// The text of a reply, and its cost.
#[derive(Clone, Debug, Default)]
pub struct Said {
    pub text: String,
    pub ending: Ending,
    pub usage: Usage,
}

#[derive(Debug, Default)]
struct Exchange {
    asked: Option<Asked>,
    said: Option<Said>,
    ended: Option<Ended>,
}

/// The player of one episode at a time.
pub struct HarnessPlayer {
    model: String,
    /// True if the harness sees ground truth, which recordings then say.
    is_privileged: bool,
    exchange: Arc<Mutex<Exchange>>,
    secrets: Arc<[Secret]>,
}

impl HarnessPlayer {
    pub fn new(model: String, is_privileged: bool) -> Self {
        Self { model, is_privileged, exchange: Arc::default(), secrets: from_every_key_variable().into() }
    }

    pub const fn is_privileged(&self) -> bool {
        self.is_privileged
    }

    /// Takes the observation that waits for a reply.
    pub fn asked(&self) -> Option<Asked> {
        locked(&self.exchange).asked.take()
    }

    /// Takes the ending of an episode that has just ended.
    pub fn ended(&self) -> Option<Ended> {
        locked(&self.exchange).ended.take()
    }

    pub fn say(&self, said: Said) {
        locked(&self.exchange).said = Some(said);
    }
}

impl Player for HarnessPlayer {
    fn model(&self) -> &str {
        &self.model
    }

    fn description(&self) -> serde_json::Value {
        serde_json::json!({
            "harness": self.model,
            "privileged": self.is_privileged,
            "identification_version": mirrorstats_identification::VERSION,
        })
    }

    fn agent(&self, task: Task, episode_id: &str) -> Result<Box<dyn Agent>, Lost> {
        *locked(&self.exchange) = Exchange::default();
        // Frames go to the harness as pixels, so the conversation needs no folder for files.
        let conversation = Conversation::new(task.clone(), episode_id, Images::Base64, Path::new(""), &self.secrets)?;
        Ok(Box::new(HarnessAgent { task: Arc::new(task), conversation, exchange: Arc::clone(&self.exchange) }))
    }

    fn waits(&self) -> bool {
        true
    }
}

struct HarnessAgent {
    task: Arc<Task>,
    conversation: Conversation,
    exchange: Arc<Mutex<Exchange>>,
}

impl Agent for HarnessAgent {
    fn decide<'a>(&'a mut self, observation: &'a Observation) -> Decision<'a> {
        locked(&self.exchange).asked = Some(Asked { task: Arc::clone(&self.task), observation: observation.clone() });
        Box::pin(async move {
            let Said { text, ending, usage } =
                poll_fn(|_| locked(&self.exchange).said.take().map_or(Poll::Pending, Poll::Ready)).await;
            Ok::<Reply, Lost>(self.conversation.read(&text, ending, usage))
        })
    }

    fn end(&mut self, ended: Ended) -> Farewell<'_> {
        locked(&self.exchange).ended = Some(ended);
        Box::pin(std::future::ready(()))
    }
}

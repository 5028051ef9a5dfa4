//! A model in one episode: its question at each step, and the reply in what is recorded.

use std::sync::{Arc, Mutex};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::journal::{Journal, JournalError, Recorded};
use super::model::{Memory, Vlm};
use super::step::{Step, locked};
use crate::agent::prompt::Prompt;
use crate::agent::{Agent, Decision, Lost, Observation, Reply, Status, Task, Usage, Words, reply};
use exact::hash;

impl Vlm {
    /// The agent of one episode.
    pub fn agent(self: &Arc<Self>, task: Task, episode: &str) -> Result<VlmAgent, JournalError> {
        let path = self.memory.path(episode);
        let journal = match self.memory {
            Memory::Journals(_) => Journal::open(&path)?,
            Memory::Cassette(_) => Journal::cassette(&path)?,
        };
        Ok(VlmAgent { vlm: Arc::clone(self), task, journal: Arc::new(Mutex::new(journal)) })
    }
}

/// A model in one episode.
#[derive(Debug)]
pub struct VlmAgent {
    vlm: Arc<Vlm>,
    task: Task,
    journal: Arc<Mutex<Journal>>,
}

impl Agent for VlmAgent {
    fn decide<'a>(&'a mut self, observation: &'a Observation) -> Decision<'a> {
        Box::pin(self.step(observation))
    }
}

impl VlmAgent {
    async fn step(&mut self, observation: &Observation) -> Result<Reply, Lost> {
        let words = Prompt::of(self.task.experiment)
            .and_then(|prompt| prompt.render(&self.task, observation))
            .map_err(|fault| self.vlm.halt(Lost::because(format!("the prompt cannot be made: {fault}"))))?;
        let schema = reply::structure(&self.task.experiment.reply);
        let dialect = self.vlm.choice.backend.dialect;
        // Pixels differ between machines, words do not: a cassette plays on any.
        let question = hash::of_bytes(dialect.body(&self.vlm.question(&words, &schema, "")).to_string().as_bytes());
        let recorded = locked(&self.journal).recorded(observation.t).cloned();
        if let Some(recorded) = recorded {
            return self.reply_to(observation.t, &question, &recorded);
        }
        let (Some(network), Some(_)) = (&self.vlm.network, &self.vlm.provider) else {
            return Err(Lost::because(format!("the cassette has no answer for step {}", observation.t)));
        };
        let png = observation
            .frame
            .to_png()
            .map_err(|fault| Lost::because(format!("the frame cannot be encoded: {fault}")))?;
        let step = Step {
            vlm: Arc::clone(&self.vlm),
            journal: Arc::clone(&self.journal),
            t: observation.t,
            frame: hash::of_bytes(png),
            body: dialect.body(&self.vlm.question(&words, &schema, &STANDARD.encode(png))),
            question: question.clone(),
        };
        let recorded = network
            .spawn(step.ask())
            .await
            .map_err(|fault| Lost::because(format!("a request broke off: {fault}")))??;
        self.reply_to(observation.t, &question, &recorded)
    }

    /// The reply in what is recorded, which must belong to this question.
    fn reply_to(&self, t: i32, question: &str, recorded: &Recorded) -> Result<Reply, Lost> {
        if recorded.question() != question {
            let reason = format!(
                "the recorded answer of step {t} belongs to another request: the prompt, the model's settings or the world changed\n  help: record into another folder, or remove the episode's journal"
            );
            return Err(Lost::because(reason));
        }
        match recorded {
            Recorded::GivenUp { status, .. } => Ok(without_decision(*status)),
            Recorded::Answer { body, latency_ms, .. } => {
                self.vlm.note_answered();
                let (answer, cost_usd) = self
                    .vlm
                    .read(body)
                    .ok_or_else(|| Lost::because(format!("the recorded answer of step {t} cannot be read")))?;
                self.vlm.check_model(answer.model.as_deref())?;
                let count = |tokens: Option<u32>| tokens.and_then(|tokens| i32::try_from(tokens).ok());
                let usage = Usage {
                    latency_ms: Some(*latency_ms),
                    prompt_tokens: count(answer.prompt_tokens),
                    completion_tokens: count(answer.completion_tokens),
                    cost_usd,
                };
                let reading = reply::read(&answer.text, &self.task.experiment, answer.ending).after(&answer.repairs);
                Ok(Reply { model: answer.model, ..reading.into_reply(answer.text, usage) })
            }
        }
    }
}

fn without_decision(status: Status) -> Reply {
    Reply {
        status,
        repairs: Vec::new(),
        action: None,
        self_color: None,
        selected_cube: None,
        mark_report: None,
        words: Words::default(),
        raw: None,
        usage: Usage::default(),
        model: None,
    }
}

//! A model in one episode: the question of each step, and the reply from the recorded answer.

use std::sync::{Arc, Mutex};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::journal::{Journal, JournalError, Recorded};
use super::limits::Begun;
use super::model::Vlm;
use super::step::Step;
use super::wire_format::ModelAnswer;
use mirrorstats_agents::prompt::Prompt;
use mirrorstats_agents::reply;
use mirrorstats_agents::{Agent, Decision, Lost, Observation, Reply, Status, Task, Usage, locked};
use mirrorstats_exact::hash;

impl Vlm {
    pub fn agent(self: &Arc<Self>, task: Task, episode: &str) -> Result<VlmAgent, JournalError> {
        let path = self.path(episode);
        let journal = if self.online.is_some() { Journal::open(&path)? } else { Journal::cassette(&path)? };
        Ok(VlmAgent { vlm: Arc::clone(self), task, journal: Arc::new(Mutex::new(journal)), begun: None })
    }
}

#[derive(Debug)]
pub struct VlmAgent {
    vlm: Arc<Vlm>,
    task: Task,
    journal: Arc<Mutex<Journal>>,
    begun: Option<Begun>,
}

impl Agent for VlmAgent {
    fn decide<'a>(&'a mut self, observation: &'a Observation) -> Decision<'a> {
        Box::pin(self.step(observation))
    }
}

impl VlmAgent {
    async fn step(&mut self, observation: &Observation) -> Result<Reply, Lost> {
        let words = Prompt::for_experiment(&self.task.experiment)
            .and_then(|prompt| prompt.render(&self.task, observation))
            .map_err(|fault| self.vlm.halt(Lost::because(format!("the prompt cannot be made: {fault}"))))?;
        let schema = reply::structure(&self.task.experiment);
        // Pixels differ between machines, words do not: a cassette plays on any machine.
        let without_frame = self.vlm.choice.body(&words, &schema, "").to_string();
        let question = hash::of_bytes(without_frame.as_bytes());
        let recorded = locked(&self.journal).recorded(observation.t).cloned();
        if let Some(recorded) = recorded {
            return self.reply_to(observation.t, &question, &recorded);
        }
        let Some((_, network)) = &self.vlm.online else {
            return Err(Lost::because(format!("the cassette has no answer for step {}", observation.t)));
        };
        let frame = &observation.frame;
        let view = [frame.width, frame.height].map(|pixels| u32::try_from(pixels).unwrap_or(u32::MAX));
        let at_most = self.vlm.at_most(without_frame.len(), view);
        let png = frame.to_png().map_err(|fault| Lost::because(format!("the frame cannot be encoded: {fault}")))?;
        let step = Step {
            vlm: Arc::clone(&self.vlm),
            journal: Arc::clone(&self.journal),
            t: observation.t,
            frame: hash::of_bytes(png),
            body: self.vlm.choice.body(&words, &schema, &STANDARD.encode(png)),
            question,
            at_most,
        };
        let network = network.clone();
        self.take_turn(observation, at_most).await?;
        let asked = network.spawn(step.ask()).await;
        let asked = asked.map_err(|fault| Lost::because(format!("a request broke off: {fault}")))??;
        Ok(self.reply_of(asked.answer, asked.latency_ms))
    }

    async fn take_turn(&mut self, observation: &Observation, at_most: [u64; 2]) -> Result<(), Lost> {
        let account = &self.vlm.account;
        let left = u64::try_from(observation.remaining).unwrap_or(0);
        match &mut self.begun {
            Some(begun) => begun.note_left(left),
            // The cost of earlier steps is lost if the episode is not finished.
            None if observation.t > 1 => self.begun = Some(account.go_on(left)),
            None => {
                let begun = account.begin(left, self.vlm.cost_of(at_most));
                self.begun = Some(self.vlm.unless_stopped(begun).await?);
            }
        }
        Ok(())
    }

    /// The reply from a recorded answer, which must belong to this question.
    fn reply_to(&self, t: i32, question: &str, recorded: &Recorded) -> Result<Reply, Lost> {
        if recorded.question != question {
            let reason = format!(
                "the recorded answer of step {t} belongs to another request: the prompt, the model's settings or the world changed\n  help: record into another folder, or remove the episode's journal"
            );
            return Err(Lost::because(reason));
        }
        self.vlm.note_answered();
        let unreadable = || Lost::because(format!("the recorded answer of step {t} cannot be read"));
        let answer = self.vlm.read(&recorded.body).ok_or_else(unreadable)?;
        self.vlm.check_model(answer.model.as_deref())?;
        Ok(self.reply_of(answer, recorded.latency_ms))
    }

    fn reply_of(&self, answer: ModelAnswer, latency_ms: i32) -> Reply {
        let count = |tokens: Option<u32>| tokens.and_then(|tokens| i32::try_from(tokens).ok());
        let usage = Usage {
            latency_ms: Some(latency_ms),
            prompt_tokens: count(answer.prompt_tokens),
            completion_tokens: count(answer.completion_tokens),
            cost_usd: self.vlm.choice.cost_usd(&answer),
        };
        let mut reply = reply::read(&answer.text, &self.task.experiment, answer.ending).after(&answer.repairs);
        if answer.is_reasoning_alone && reply.status == Status::Empty {
            reply.fault = Some(reply::REASONING_ALONE.to_owned());
        }
        Reply { model: answer.model, ..reply.with_text(answer.text, usage) }
    }
}

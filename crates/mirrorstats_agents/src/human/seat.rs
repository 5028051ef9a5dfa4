//! One participant at play: the open question, the clock, and the content of the page.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tokio::sync::oneshot;

use super::journal::Leaving;
use crate::milliseconds;
use mirrorstats_experiment::Experiment;
use mirrorstats_trace::frame::Frame;
use mirrorstats_trace::schema::colors::Color;

/// The maximum time between two polls of an open page.
pub(super) const LISTENING: Duration = Duration::from_secs(3);

/// A page that is silent for longer is closed or disconnected, and its clock stops.
const AWAY: Duration = Duration::from_secs(10);

#[derive(Clone, Debug)]
pub struct PlayerQuestion {
    pub frame: Arc<Frame>,
    pub system: String,
    pub user: String,
    pub t: i32,
    pub(crate) is_practice: bool,
    pub experiment: Experiment,
    /// The letters or numbers of the available actions.
    pub actions: Vec<&'static str>,
}

#[derive(Debug)]
pub struct Given {
    pub reply: String,
    /// From the frame to the reply, ms; breaks and times without the page do not count.
    pub latency_ms: i32,
}

/// The texts and settings that apply to all participants of a recording.
#[derive(Clone, Debug, Default)]
pub struct Terms {
    pub consent: Option<String>,
    pub contact: Option<String>,
    /// True if an identification stays in its field from step to step of an episode.
    pub prefills: bool,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct End {
    pub(crate) is_complete: bool,
    pub is_shown: bool,
}

#[derive(Debug)]
pub(super) struct OpenQuestion {
    pub question: PlayerQuestion,
    pub answer: Option<oneshot::Sender<Given>>,
    shown: Option<Instant>,
    breaks: Duration,
    pause: Option<Instant>,
}

impl OpenQuestion {
    pub fn new(question: PlayerQuestion, answer: oneshot::Sender<Given>) -> Self {
        Self { question, answer: Some(answer), shown: None, breaks: Duration::ZERO, pause: None }
    }
}

#[derive(Debug, Default)]
#[expect(clippy::struct_excessive_bools, reason = "independent facts of a person")]
pub(super) struct Seat {
    pub code: String,
    /// The episodes still to be played, in order, including the one under way.
    pub(crate) lane: VecDeque<String>,
    /// Episodes of this participant that are recorded.
    pub played: usize,
    pub(crate) is_dealt: bool,
    pub episode: Option<String>,
    pub(crate) has_agreed: bool,
    pub(crate) has_practised: bool,
    /// The next episode waits for the person to begin it.
    pub(crate) is_ready: bool,
    pub left: Option<Leaving>,
    pub is_deleted: bool,
    pub asked: Option<OpenQuestion>,
    pub number: u64,
    pub seen: Option<Instant>,
    pub end: Option<End>,
}

impl Seat {
    pub fn is_open(&self) -> bool {
        self.seen.is_some_and(|seen| seen.elapsed() < LISTENING)
    }

    fn may_play(&self, terms: &Terms) -> bool {
        self.left.is_none() && !self.is_ready && (self.has_agreed || terms.consent.is_none())
    }

    /// Registers a sign of life of the page: the time without it does not count.
    fn heard(&mut self) {
        let away = self.seen.replace(Instant::now()).map_or(Duration::ZERO, |seen| seen.elapsed());
        if let Some(asked) = &mut self.asked
            && away > AWAY
            && asked.shown.is_some()
            && asked.pause.is_none()
        {
            asked.breaks += away;
        }
    }

    pub fn state(&mut self, terms: &Terms) -> Value {
        self.heard();
        if let Some(end) = &mut self.end {
            end.is_shown = true;
        }
        let mut state = self.phase(terms);
        (state["code"], state["contact"]) = (json!(self.code), json!(terms.contact));
        (state["played"], state["number"]) = (json!(self.played), json!(self.number));
        state
    }

    fn phase(&mut self, terms: &Terms) -> Value {
        let (episode, of) = (self.played + 1, self.played + self.lane.len());
        if let Some(left) = self.left {
            return json!({"phase": "left", "left": left, "is_deleted": self.is_deleted});
        }
        if let Some(End { is_complete, .. }) = self.end {
            return json!({"phase": "over", "is_complete": is_complete});
        }
        if self.is_dealt && self.lane.is_empty() {
            return json!({"phase": "finished"});
        }
        if !self.has_agreed && terms.consent.is_some() {
            return json!({"phase": "consent", "words": terms.consent});
        }
        if self.is_ready {
            return json!({"phase": "ready", "episode": episode, "of": of, "is_first": !self.has_practised});
        }
        let Some(asked) = self.asked.as_mut().filter(|asked| asked.answer.is_some()) else {
            return json!({"phase": "waiting"});
        };
        if asked.pause.is_some() {
            return json!({"phase": "break"});
        }
        asked.shown.get_or_insert_with(Instant::now);
        let PlayerQuestion { system, user, t, is_practice, experiment, actions, .. } = &asked.question;
        json!({
            "phase": if *is_practice { "practice" } else { "play" },
            "episode": episode,
            "of": of,
            "t": t,
            "system": system,
            "user": user,
            "keys": experiment.keys(),
            "answers": experiment.answers,
            "actions": actions,
            "prefills": terms.prefills,
            "colors": Color::ALL.map(Color::name),
        })
    }

    pub fn frame(&self, terms: &Terms) -> Option<Arc<Frame>> {
        self.asked.as_ref().filter(|_| self.may_play(terms)).map(|asked| Arc::clone(&asked.question.frame))
    }

    pub fn pause(&mut self, is_on: bool) {
        self.heard();
        let Some(asked) = &mut self.asked else { return };
        if is_on {
            asked.pause.get_or_insert_with(Instant::now);
        } else if let Some(begun) = asked.pause.take() {
            asked.breaks += begun.elapsed();
        }
    }

    /// Takes the answer to the question with this number; false if another question is open.
    pub fn answer(&mut self, terms: &Terms, number: u64, reply: String) -> bool {
        self.heard();
        if self.number != number || !self.may_play(terms) {
            return false;
        }
        let Some(asked) = self.asked.as_mut().filter(|asked| asked.pause.is_none()) else { return false };
        let Some(answer) = asked.answer.take() else { return false };
        let taken = asked.shown.map_or(Duration::ZERO, |shown| shown.elapsed().saturating_sub(asked.breaks));
        answer.send(Given { reply, latency_ms: milliseconds(taken) }).is_ok()
    }
}

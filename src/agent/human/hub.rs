//! Which person is asked what. Episodes wait here for people, and people for episodes.

use std::collections::BTreeMap;
use std::io;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tokio::sync::oneshot;

use super::journal::{Entry, Journal};
use crate::base::frame::Frame;
use crate::base::palette::Color;

/// What a person is asked at a step: what a model is sent.
#[derive(Clone, Debug)]
pub struct Question {
    /// What the eye sees.
    pub frame: Arc<Frame>,
    /// The system prompt.
    pub system: String,
    /// The user prompt.
    pub user: String,
    /// The step, from 1.
    pub t: i32,
    /// Whether it is of a practice episode.
    pub is_practice: bool,
    /// The keys of a reply.
    pub keys: Vec<&'static str>,
    /// The letters or numbers of what can be done.
    pub actions: Vec<&'static str>,
}

/// What a person answered.
#[derive(Debug)]
pub struct Given {
    /// The JSON object of a reply.
    pub reply: String,
    /// From the frame to the reply, ms; breaks do not count.
    pub latency_ms: i32,
}

/// The people of a recording.
#[derive(Debug)]
pub struct Hub {
    consent: Option<String>,
    seats: Vec<Mutex<Seat>>,
    /// Answers of an earlier start, and whose episodes they are.
    answers: BTreeMap<(String, i32), Entry>,
    journal: Mutex<Journal>,
    tokens: Vec<String>,
    codes: Vec<String>,
}

/// One person.
#[derive(Debug, Default)]
struct Seat {
    /// The episode that is theirs.
    episode: Option<String>,
    has_agreed: bool,
    has_practised: bool,
    asked: Option<Asked>,
    /// How many episodes they played to the end.
    played: usize,
    /// Raised with each question.
    number: u64,
    is_last_over: bool,
}

#[derive(Debug)]
struct Asked {
    question: Question,
    answer: Option<oneshot::Sender<Given>>,
    /// When the frame was first shown.
    shown: Option<Instant>,
    /// Time in breaks so far.
    breaks: Duration,
    /// When the break that is now has begun.
    pause: Option<Instant>,
}

impl Hub {
    /// People of these codes, each with a token for their link; `consent` is what they agree to before they begin.
    pub fn new(people: Vec<(String, String)>, consent: Option<String>, journal: Journal) -> Self {
        let answers = journal.entries().into_iter().map(|entry| ((entry.episode_id.clone(), entry.t), entry)).collect();
        let seat = |code: &String| {
            let (has_agreed, has_practised) =
                (journal.has_agreed(code, consent.as_deref()), journal.has_practised(code));
            Mutex::new(Seat { has_agreed, has_practised, ..Seat::default() })
        };
        let (codes, tokens): (Vec<String>, Vec<String>) = people.into_iter().unzip();
        let seats = codes.iter().map(seat).collect();
        Self { consent, seats, answers, journal: Mutex::new(journal), tokens, codes }
    }

    /// What people agree to, if anything.
    pub fn consent(&self) -> Option<&str> {
        self.consent.as_deref()
    }

    /// How many people there are.
    pub fn seats(&self) -> usize {
        self.seats.len()
    }

    /// The code of a person.
    pub fn code(&self, seat: usize) -> String {
        self.codes[seat].clone()
    }

    /// Whose link has this token.
    pub(super) fn seat_of(&self, token: &str) -> Option<usize> {
        self.tokens.iter().position(|own| own == token)
    }

    /// Gives an episode to a person: to the one who began it, else to the next who has none.
    pub fn seat(&self, episode_id: &str) -> Option<usize> {
        let begun = self.answers.range((episode_id.to_owned(), 0)..).next().filter(|((id, _), _)| id == episode_id);
        let own = begun.and_then(|(_, entry)| self.codes.iter().position(|code| *code == entry.participant));
        let free = |seat: &usize| self.locked(*seat).episode.is_none();
        let seat = own.filter(|seat| free(seat)).or_else(|| (0..self.seats.len()).find(free))?;
        let mut taken = self.locked(seat);
        (taken.episode, taken.is_last_over) = (Some(episode_id.to_owned()), false);
        drop(taken);
        Some(seat)
    }

    /// What was answered to a step in an earlier start.
    pub(super) fn answered(&self, episode_id: &str, t: i32) -> Option<Entry> {
        self.answers.get(&(episode_id.to_owned(), t)).cloned()
    }

    pub(super) fn keep(&self, entry: Entry) -> io::Result<()> {
        self.journal.lock().unwrap_or_else(PoisonError::into_inner).keep(entry)
    }

    pub(super) fn has_practised(&self, seat: usize) -> bool {
        self.locked(seat).has_practised
    }

    pub(super) fn practised(&self, seat: usize) {
        self.locked(seat).has_practised = true;
        // What is lost with the journal is that the practice is behind: it comes again.
        let _ = self.journal.lock().unwrap_or_else(PoisonError::into_inner).practised(&self.codes[seat]);
    }

    /// Asks a person and waits for the answer, for as long as it takes; `None` where nobody can answer any more.
    pub(super) async fn ask(&self, seat: usize, question: Question) -> Option<Given> {
        let (sender, answer) = oneshot::channel();
        {
            let mut seat = self.locked(seat);
            seat.number += 1;
            let (shown, breaks, pause) = (None, Duration::ZERO, None);
            seat.asked = Some(Asked { question, answer: Some(sender), shown, breaks, pause });
        }
        answer.await.ok()
    }

    /// The episode of a person is over.
    pub(super) fn over(&self, seat: usize, is_whole: bool) {
        let mut seat = self.locked(seat);
        (seat.episode, seat.asked, seat.is_last_over) = (None, None, true);
        seat.played += usize::from(is_whole);
    }

    /// What a page shows now. It holds what a model gets, and nothing else.
    pub(super) fn told(&self, seat: usize) -> Value {
        let mut seat = self.locked(seat);
        let (number, played) = (seat.number, seat.played);
        if !seat.has_agreed && self.consent.is_some() {
            return json!({"phase": "consent", "words": self.consent});
        }
        let Some(asked) = seat.asked.as_mut().filter(|asked| asked.answer.is_some()) else {
            return json!({"phase": "waiting", "played": played, "number": number});
        };
        if asked.pause.is_some() {
            return json!({"phase": "break", "number": number});
        }
        asked.shown.get_or_insert_with(Instant::now);
        let Question { system, user, t, is_practice, keys, actions, .. } = &asked.question;
        json!({
            "phase": if *is_practice { "practice" } else { "play" },
            "number": number,
            "t": t,
            "system": system,
            "user": user,
            "keys": keys,
            "actions": actions,
            "colors": Color::ALL.map(Color::name),
        })
    }

    /// The frame of the question that is shown.
    pub(super) fn frame(&self, seat: usize) -> Option<Arc<Frame>> {
        let seat = self.locked(seat);
        let is_shown = seat.has_agreed || self.consent.is_none();
        seat.asked.as_ref().filter(|_| is_shown).map(|asked| Arc::clone(&asked.question.frame))
    }

    /// A person agrees.
    pub(super) fn agree(&self, seat: usize) -> io::Result<()> {
        let mut journal = self.journal.lock().unwrap_or_else(PoisonError::into_inner);
        journal.agreed(&self.codes[seat], self.consent.as_deref().unwrap_or_default())?;
        drop(journal);
        self.locked(seat).has_agreed = true;
        Ok(())
    }

    /// A person takes a break, or is back.
    pub(super) fn pause(&self, seat: usize, is_on: bool) {
        let mut seat = self.locked(seat);
        let Some(asked) = &mut seat.asked else { return };
        if is_on {
            asked.pause.get_or_insert_with(Instant::now);
        } else if let Some(begun) = asked.pause.take() {
            asked.breaks += begun.elapsed();
        }
    }

    /// Takes the answer to a question; says whether it was still open.
    pub(super) fn answer(&self, seat: usize, number: u64, reply: String) -> bool {
        let mut seat = self.locked(seat);
        if seat.number != number || !seat.has_agreed && self.consent.is_some() {
            return false;
        }
        let Some(asked) = &mut seat.asked else { return false };
        let (Some(answer), None) = (asked.answer.take(), asked.pause) else { return false };
        let taken = asked.shown.map_or(Duration::ZERO, |shown| shown.elapsed().saturating_sub(asked.breaks));
        let latency_ms = i32::try_from(taken.as_millis()).unwrap_or(i32::MAX);
        answer.send(Given { reply, latency_ms }).is_ok()
    }

    fn locked(&self, seat: usize) -> std::sync::MutexGuard<'_, Seat> {
        self.seats[seat].lock().unwrap_or_else(PoisonError::into_inner)
    }
}

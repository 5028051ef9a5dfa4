//! The queue between episodes and people.

use std::collections::BTreeMap;
use std::io;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tokio::sync::oneshot;

use super::journal::{Entry, Journal};
use trace::frame::Frame;
use trace::palette::Color;

/// The question to a person at a step: the same that a model gets.
#[derive(Clone, Debug)]
pub struct Question {
    pub frame: Arc<Frame>,
    pub system: String,
    pub user: String,
    /// The step, from 1.
    pub t: i32,
    /// True if it is of a practice episode.
    pub is_practice: bool,
    /// The keys of a reply.
    pub keys: Vec<&'static str>,
    /// The letters or numbers of what can be done.
    pub actions: Vec<&'static str>,
}

/// A person's answer.
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
    answers: BTreeMap<(String, String, i32), Entry>,
    journal: Mutex<Journal>,
    tokens: Vec<String>,
    codes: Vec<String>,
}

#[derive(Debug, Default)]
struct Seat {
    episode: Option<String>,
    has_agreed: bool,
    has_practised: bool,
    is_ready: bool,
    asked: Option<Asked>,
    begun: usize,
    played: usize,
    number: u64,
    seen: Option<Instant>,
    end: Option<End>,
}

/// The end of a recording, as a page gets it.
#[derive(Clone, Copy, Debug)]
struct End {
    is_complete: bool,
    is_told: bool,
}

/// The time in which a page that is open asks again.
const LISTENING: Duration = Duration::from_secs(3);

#[derive(Debug)]
struct Asked {
    question: Question,
    answer: Option<oneshot::Sender<Given>>,
    shown: Option<Instant>,
    breaks: Duration,
    pause: Option<Instant>,
}

impl Hub {
    /// People of these codes, each with a token for their link; `consent` is what they agree to before they begin.
    pub fn new(people: Vec<(String, String)>, consent: Option<String>, journal: Journal) -> Self {
        let key = |entry: &Entry| (entry.episode_id.clone(), entry.participant.clone(), entry.t);
        let answers = journal.entries().into_iter().map(|entry| (key(&entry), entry)).collect();
        let seat = |code: &String| {
            let (has_agreed, has_practised) =
                (journal.has_agreed(code, consent.as_deref()), journal.has_practised(code));
            Mutex::new(Seat { has_agreed, has_practised, ..Seat::default() })
        };
        let (codes, tokens): (Vec<String>, Vec<String>) = people.into_iter().unzip();
        let seats = codes.iter().map(seat).collect();
        Self { consent, seats, answers, journal: Mutex::new(journal), tokens, codes }
    }

    /// The consent text, if there is one.
    pub fn consent(&self) -> Option<&str> {
        self.consent.as_deref()
    }

    /// The number of people.
    pub fn seats(&self) -> usize {
        self.seats.len()
    }

    /// The code of a person.
    pub fn code(&self, seat: usize) -> String {
        self.codes[seat].clone()
    }

    pub(super) fn seat_of(&self, token: &str) -> Option<usize> {
        self.tokens.iter().position(|own| own == token)
    }

    /// Gives an episode to a person: to the one who began it, else to the next who has none.
    pub fn seat(&self, episode_id: &str) -> Option<usize> {
        let has_begun = |code: &String| {
            let first = (episode_id.to_owned(), code.clone(), 0);
            self.answers.range(first..).next().is_some_and(|((id, own, _), _)| id == episode_id && own == code)
        };
        let is_free = |seat: &usize| self.locked(*seat).episode.is_none();
        let mut own = (0..self.seats.len()).filter(|seat| has_begun(&self.codes[*seat]));
        let seat = own.find(is_free).or_else(|| (0..self.seats.len()).find(is_free))?;
        let mut taken = self.locked(seat);
        taken.episode = Some(episode_id.to_owned());
        taken.begun += 1;
        drop(taken);
        Some(seat)
    }

    pub(super) fn answered(&self, seat: usize, episode_id: &str, t: i32) -> Option<Entry> {
        self.answers.get(&(episode_id.to_owned(), self.codes[seat].clone(), t)).cloned()
    }

    pub(super) fn keep(&self, entry: Entry) -> io::Result<()> {
        self.journal.lock().unwrap_or_else(PoisonError::into_inner).keep(entry)
    }

    pub(super) fn has_practised(&self, seat: usize) -> bool {
        self.locked(seat).has_practised
    }

    /// The practice is over: the person is informed, and no step counts before they begin.
    pub(super) fn practised(&self, seat: usize) {
        self.locked(seat).is_ready = true;
    }

    pub(super) fn begin(&self, seat: usize) {
        let mut own = self.locked(seat);
        if !std::mem::take(&mut own.is_ready) {
            return;
        }
        own.has_practised = true;
        drop(own);
        // What is lost with the journal is that the practice is behind: it comes again.
        let _ = self.journal.lock().unwrap_or_else(PoisonError::into_inner).practised(&self.codes[seat]);
    }

    /// Asks a person and waits for the answer, for as long as it takes; `None` where nobody can answer any more.
    pub(super) async fn ask(&self, seat: usize, question: Question) -> Option<Given> {
        let (sender, answer) = oneshot::channel();
        {
            let mut seat = self.locked(seat);
            seat.number += 1;
            seat.is_ready &= !question.is_practice;
            let (shown, breaks, pause) = (None, Duration::ZERO, None);
            seat.asked = Some(Asked { question, answer: Some(sender), shown, breaks, pause });
        }
        answer.await.ok()
    }

    pub(super) fn over(&self, seat: usize, is_whole: bool) {
        let mut seat = self.locked(seat);
        (seat.episode, seat.asked) = (None, None);
        seat.played += usize::from(is_whole);
    }

    /// The recording is over. Waits a moment for the pages that are open to ask, so that they can say so.
    pub(super) fn end(&self, is_complete: bool) {
        let start = Instant::now();
        let seats = || (0..self.seats.len()).map(|seat| self.locked(seat));
        seats().for_each(|mut seat| seat.end = Some(End { is_complete, is_told: false }));
        let is_open = |seat: &Seat| seat.seen.is_some_and(|seen| seen.elapsed() < LISTENING);
        let is_due = |seat: &Seat| is_open(seat) && seat.end.is_some_and(|end| !end.is_told);
        while start.elapsed() < LISTENING && seats().any(|seat| is_due(&seat)) {
            std::thread::sleep(Duration::from_millis(20));
        }
        if seats().any(|seat| is_open(&seat)) {
            // The last answer is on its way.
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    pub(super) fn told(&self, seat: usize) -> Value {
        let mut seat = self.locked(seat);
        let (number, played, episode) = (seat.number, seat.played, seat.begun);
        seat.seen = Some(Instant::now());
        if let Some(end) = &mut seat.end {
            end.is_told = true;
            return json!({"phase": "over", "is_complete": end.is_complete, "played": played});
        }
        if !seat.has_agreed && self.consent.is_some() {
            return json!({"phase": "consent", "words": self.consent});
        }
        if seat.is_ready {
            return json!({"phase": "ready"});
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
            "episode": episode,
            "t": t,
            "system": system,
            "user": user,
            "keys": keys,
            "actions": actions,
            "colors": Color::ALL.map(Color::name),
        })
    }

    pub(super) fn frame(&self, seat: usize) -> Option<Arc<Frame>> {
        let seat = self.locked(seat);
        let is_shown = (seat.has_agreed || self.consent.is_none()) && !seat.is_ready;
        seat.asked.as_ref().filter(|_| is_shown).map(|asked| Arc::clone(&asked.question.frame))
    }

    pub(super) fn agree(&self, seat: usize) -> io::Result<()> {
        let mut journal = self.journal.lock().unwrap_or_else(PoisonError::into_inner);
        journal.agreed(&self.codes[seat], self.consent.as_deref().unwrap_or_default())?;
        drop(journal);
        self.locked(seat).has_agreed = true;
        Ok(())
    }

    pub(super) fn pause(&self, seat: usize, is_on: bool) {
        let mut seat = self.locked(seat);
        let Some(asked) = &mut seat.asked else { return };
        if is_on {
            asked.pause.get_or_insert_with(Instant::now);
        } else if let Some(begun) = asked.pause.take() {
            asked.breaks += begun.elapsed();
        }
    }

    pub(super) fn answer(&self, seat: usize, number: u64, reply: String) -> bool {
        let mut seat = self.locked(seat);
        if seat.number != number || seat.is_ready || !seat.has_agreed && self.consent.is_some() {
            return false;
        }
        let Some(asked) = seat.asked.as_mut().filter(|asked| asked.pause.is_none()) else { return false };
        let Some(answer) = asked.answer.take() else { return false };
        let taken = asked.shown.map_or(Duration::ZERO, |shown| shown.elapsed().saturating_sub(asked.breaks));
        let latency_ms = i32::try_from(taken.as_millis()).unwrap_or(i32::MAX);
        answer.send(Given { reply, latency_ms }).is_ok()
    }

    fn locked(&self, seat: usize) -> std::sync::MutexGuard<'_, Seat> {
        self.seats[seat].lock().unwrap_or_else(PoisonError::into_inner)
    }
}

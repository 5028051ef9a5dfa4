//! The participants of a recording: their episodes, their open questions, and withdrawals.
//!
//! Rule: an episode belongs to one participant, and a participant plays one episode at a time. A participant's decision
//! about taking part is on disk before it takes effect.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard};
use std::time::{Duration, Instant};

use serde_json::Value;
use tokio::sync::oneshot;

use super::design::{Design, Planned, Schedule};
use super::journal::{Leaving, ParticipantJournal, PlayedStep};
use super::seat::{End, Given, LISTENING, OpenQuestion, PlayerQuestion, Seat, Terms};
use crate::{Turn, locked};

/// Removes the episodes of a code from a folder; returns their ids.
pub type Eraser = fn(&Path, &str) -> Result<BTreeSet<String>, String>;

/// The maximum wait for an episode under way to end before its deletion.
const ENDING: Duration = Duration::from_mins(1);

#[derive(Debug)]
pub struct Hub {
    pub(super) terms: Terms,
    pub(super) schedule: Schedule,
    seats: Vec<Mutex<Seat>>,
    tokens: Vec<String>,
    answers: BTreeMap<(String, String, i32), PlayedStep>,
    journal: Mutex<ParticipantJournal>,
    eraser: Eraser,
    /// The participant of each episode that is still to be played.
    owners: Mutex<BTreeMap<String, usize>>,
    deleted: Mutex<BTreeSet<String>>,
    is_stopping: AtomicBool,
}

impl Hub {
    pub fn new(
        people: Vec<(String, String)>,
        terms: Terms,
        schedule: Schedule,
        journal: ParticipantJournal,
        eraser: Eraser,
    ) -> Self {
        let answer =
            |(code, step): (&str, &PlayedStep)| ((step.episode_id.clone(), code.to_owned(), step.t), step.clone());
        let answers = journal.answers().map(answer).collect();
        let (codes, tokens): (Vec<String>, Vec<String>) = people.into_iter().unzip();
        let seat = |code: String| Seat {
            has_agreed: journal.has_agreed(&code, terms.consent.as_deref()),
            has_practised: journal.has_practised(&code),
            left: journal.left(&code),
            code,
            ..Seat::default()
        };
        let seats = codes.into_iter().map(seat).map(Mutex::new).collect();
        let (journal, owners, deleted) = (Mutex::new(journal), Mutex::default(), Mutex::default());
        let is_stopping = AtomicBool::new(false);
        Self { terms, schedule, seats, tokens, answers, journal, eraser, owners, deleted, is_stopping }
    }

    pub fn seats(&self) -> usize {
        self.seats.len()
    }

    pub(super) fn code(&self, seat: usize) -> String {
        self.seat(seat).code.clone()
    }

    pub(super) fn seat_of(&self, token: &str) -> Option<usize> {
        self.tokens.iter().position(|own| own == token)
    }

    /// Deals the episodes: begun ones to their players, those of people who left to others if the design permits.
    pub fn deal(&self, planned: &[Planned]) {
        let begun_by = |id: &str| (0..self.seats()).find(|seat| self.has_begun(*seat, id));
        let mut left_over = Vec::new();
        for (at, lane) in self.schedule.lanes(planned, self.seats()).into_iter().enumerate() {
            for episode in lane {
                let own = if self.schedule.design == Design::Split { begun_by(&episode.episode_id) } else { None };
                let at = own.unwrap_or(at);
                let mut seat = self.seat(at);
                match (episode.is_recorded, seat.left) {
                    (true, _) => seat.played += 1,
                    (false, Some(_)) => left_over.push(episode.episode_id.clone()),
                    (false, None) => {
                        seat.lane.push_back(episode.episode_id.clone());
                        locked(&self.owners).insert(episode.episode_id.clone(), at);
                    }
                }
            }
        }
        self.deal_again(left_over);
        (0..self.seats()).for_each(|seat| self.seat(seat).is_dealt = true);
    }

    fn has_begun(&self, seat: usize, episode_id: &str) -> bool {
        let first = (episode_id.to_owned(), self.code(seat), 0);
        let last = (first.0.clone(), first.1.clone(), i32::MAX);
        self.answers.range(first..=last).next().is_some()
    }

    /// Deals the unplayed episodes of participants who left: to the others, or to nobody.
    fn deal_again(&self, episodes: Vec<String>) {
        let stays = |seat: &usize| self.schedule.design == Design::Split && self.seat(*seat).left.is_none();
        let others: Vec<usize> = (0..self.seats()).filter(stays).collect();
        for (at, episode) in episodes.into_iter().enumerate() {
            if others.is_empty() {
                locked(&self.owners).remove(&episode);
                continue;
            }
            let seat = others[at % others.len()];
            self.seat(seat).lane.push_back(episode.clone());
            locked(&self.owners).insert(episode, seat);
        }
    }

    pub fn turn(&self, episode_id: &str) -> Turn {
        let Some(seat) = locked(&self.owners).get(episode_id).copied() else { return Turn::Never };
        let seat = self.seat(seat);
        let is_next = seat.episode.is_none() && seat.lane.front().is_some_and(|next| next == episode_id);
        if is_next { Turn::Now } else { Turn::Later }
    }

    /// Gives an episode to its participant, who begins it when ready; `None` if nobody is to play it.
    pub(super) fn sit(&self, episode_id: &str) -> Option<usize> {
        let seat = locked(&self.owners).get(episode_id).copied()?;
        let has_begun = self.has_begun(seat, episode_id);
        let mut own = self.seat(seat);
        if own.left.is_some() {
            return None;
        }
        own.episode = Some(episode_id.to_owned());
        own.is_ready = own.has_practised && !has_begun;
        drop(own);
        Some(seat)
    }

    pub(super) fn answered(&self, seat: usize, episode_id: &str, t: i32) -> Option<PlayedStep> {
        self.answers.get(&(episode_id.to_owned(), self.code(seat), t)).cloned()
    }

    pub(super) fn keep(&self, code: &str, step: PlayedStep) -> io::Result<()> {
        locked(&self.journal).keep(code, step)
    }

    /// The practice is over: the person is informed, and steps count only after the start.
    pub(super) fn practised(&self, seat: usize) {
        self.seat(seat).is_ready = true;
    }

    pub(super) fn begin(&self, seat: usize) {
        let mut own = self.seat(seat);
        if !std::mem::take(&mut own.is_ready) || std::mem::replace(&mut own.has_practised, true) {
            return;
        }
        let code = own.code.clone();
        drop(own);
        // If the journal cannot be written, the practice repeats after a restart.
        let _ = locked(&self.journal).practised(&code);
    }

    /// Asks a person and waits for the answer without a time limit; `None` if the person leaves or the recording stops.
    pub(super) async fn ask(&self, seat: usize, question: PlayerQuestion) -> Option<Given> {
        let (sender, answer) = oneshot::channel();
        {
            let mut seat = self.seat(seat);
            if self.is_stopping() || seat.left.is_some() {
                return None;
            }
            seat.number += 1;
            seat.is_ready &= !question.is_practice;
            seat.asked = Some(OpenQuestion::new(question, sender));
        }
        answer.await.ok()
    }

    pub(super) fn is_stopping(&self) -> bool {
        self.is_stopping.load(Ordering::Relaxed)
    }

    pub fn interrupt(&self) {
        self.is_stopping.store(true, Ordering::Relaxed);
        (0..self.seats()).for_each(|seat| self.seat(seat).asked = None);
    }

    /// Ends an episode; unless it is to continue, it leaves its participant's queue for this start.
    pub(super) fn over(&self, seat: usize, episode_id: &str, is_whole: bool) {
        let mut own = self.seat(seat);
        (own.episode, own.asked) = (None, None);
        own.played += usize::from(is_whole);
        let goes_on = !is_whole && (own.left.is_some() || self.is_stopping());
        drop(own);
        if goes_on {
            return;
        }
        let owner = locked(&self.owners).remove(episode_id);
        if let Some(owner) = owner {
            self.seat(owner).lane.retain(|id| id != episode_id);
        }
    }

    /// Ends the recording. Waits briefly for open pages to poll, so that they can show the end.
    pub(super) fn end(&self, is_complete: bool) {
        let start = Instant::now();
        let seats = || (0..self.seats.len()).map(|seat| self.seat(seat));
        seats().for_each(|mut seat| seat.end = Some(End { is_complete, is_shown: false }));
        let is_due = |seat: &Seat| seat.is_open() && seat.end.is_some_and(|end| !end.is_shown);
        while start.elapsed() < LISTENING && seats().any(|seat| is_due(&seat)) {
            std::thread::sleep(Duration::from_millis(20));
        }
        if seats().any(|seat| seat.is_open()) {
            // Lets the last response arrive.
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    pub(super) fn state(&self, seat: usize) -> Value {
        self.seat(seat).state(&self.terms)
    }

    pub(super) fn agree(&self, seat: usize) -> io::Result<()> {
        let code = self.code(seat);
        locked(&self.journal).agreed(&code, self.terms.consent.as_deref().unwrap_or_default())?;
        self.seat(seat).has_agreed = true;
        Ok(())
    }

    /// Ends a person's part in the study. Their data stays unless they want it deleted.
    pub(super) fn leave(&self, seat: usize, how: Leaving) -> io::Result<()> {
        let code = self.code(seat);
        locked(&self.journal).leave(&code, how)?;
        let mut own = self.seat(seat);
        own.left = Some(how);
        (own.asked, own.is_ready) = (None, false);
        let lane = std::mem::take(&mut own.lane);
        drop(own);
        self.deal_again(lane.into());
        if how == Leaving::Deleted { self.erase(seat).map_err(io::Error::other) } else { Ok(()) }
    }

    fn erase(&self, seat: usize) -> Result<(), String> {
        let start = Instant::now();
        while self.seat(seat).episode.is_some() && start.elapsed() < ENDING {
            std::thread::sleep(Duration::from_millis(10));
        }
        let code = self.code(seat);
        let Some(folder) = locked(&self.journal).forget(&code).map_err(|error| error.to_string())? else {
            return Ok(());
        };
        let episodes = (self.eraser)(&folder, &code)?;
        locked(&self.deleted).extend(episodes);
        self.seat(seat).is_deleted = true;
        Ok(())
    }

    /// Deletes the remaining data of those who asked for it; returns the ids of all deleted episodes.
    pub fn delete_due(&self) -> Result<BTreeSet<String>, String> {
        for seat in (0..self.seats()).filter(|seat| self.seat(*seat).left == Some(Leaving::Deleted)) {
            let failed = |error| format!("what `{}` did could not be deleted: {error}", self.code(seat));
            self.erase(seat).map_err(failed)?;
        }
        Ok(locked(&self.deleted).clone())
    }

    pub(super) fn seat(&self, seat: usize) -> MutexGuard<'_, Seat> {
        locked(&self.seats[seat])
    }
}

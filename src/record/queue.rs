//! The episodes that a recording has still to take.
//!
//! Rule: an episode is taken with its lock, so that processes that record the same episodes divide them. One that another
//! process has is asked for again until it is recorded, or that process has given it back or has ended.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::error::StoreError;
use super::lock::EpisodeLock;
use super::plan::Key;
use super::store::{Store, Turn};

/// The episodes of a recording that no thread has taken yet.
#[derive(Debug)]
pub struct Queue<'a> {
    store: &'a Store,
    waiting: Mutex<Waiting>,
}

#[derive(Debug)]
struct Waiting {
    keys: VecDeque<Key>,
    /// Those that other processes have recorded since.
    elsewhere: Vec<Key>,
}

/// What a thread does next.
#[derive(Debug)]
pub enum Next {
    /// Play this episode.
    Play(Key, EpisodeLock),
    /// Ask again later: other processes have all that are left.
    Held(Held),
    /// Nothing: all are taken.
    Nothing,
}

/// Episodes that other processes have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Held {
    /// One of them.
    pub key: Key,
    /// The id of the process that has it, as far as it is known.
    pub process: Option<u32>,
    /// How many they are.
    pub count: usize,
}

impl<'a> Queue<'a> {
    /// These episodes, in this order.
    pub fn new(store: &'a Store, keys: &[Key]) -> Self {
        let waiting = Waiting { keys: keys.iter().copied().collect(), elsewhere: Vec::new() };
        Self { store, waiting: Mutex::new(waiting) }
    }

    /// The next episode, with its lock.
    ///
    /// # Errors
    /// When the folder cannot be read or locked.
    pub fn next(&self) -> Result<Next, StoreError> {
        let mut waiting = self.waiting();
        let mut held = None;
        for _ in 0..waiting.keys.len() {
            let Some(key) = waiting.keys.pop_front() else { break };
            match self.store.turn(key)? {
                Turn::Ours(lock) => return Ok(Next::Play(key, lock)),
                Turn::Recorded => waiting.elsewhere.push(key),
                Turn::Theirs(process) => {
                    waiting.keys.push_back(key);
                    held = held.or(Some((key, process)));
                }
            }
        }
        let count = waiting.keys.len();
        Ok(held.map_or(Next::Nothing, |(key, process)| Next::Held(Held { key, process, count })))
    }

    /// Whether episodes are left.
    pub fn has_more(&self) -> bool {
        !self.waiting().keys.is_empty()
    }

    /// The episodes that other processes have recorded meanwhile.
    pub fn elsewhere(&self) -> Vec<Key> {
        self.waiting().elsewhere.clone()
    }

    fn waiting(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

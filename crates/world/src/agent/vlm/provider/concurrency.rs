//! The number of concurrent requests: one more after a round of good answers, half after a reply that says that there
//! were too many. No request is sent before a rate limit is renewed, or above the user's limit per minute.
//!
//! The time of the next request is shared by all processes that record into a folder with the same account.

use std::io;
use std::path::Path;
use std::sync::{Mutex, OnceLock};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tokio::sync::Semaphore;
use tokio::time::sleep;

use crate::agent::locked;
use crate::agent::vlm::spending::shared_file::{SharedFile, now};

#[derive(Debug)]
pub(crate) struct Pace {
    permits: Semaphore,
    state: Mutex<State>,
    interval: Duration,
    shared: OnceLock<SharedFile>,
}

#[derive(Debug)]
struct State {
    limit: usize,
    most: usize,
    /// Permits to discard when they return, after the limit fell below the number in flight.
    debt: usize,
    /// Good answers since the limit last changed.
    good: usize,
    gate: Gate,
}

/// The time from which an account takes requests, since 1970.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct Gate {
    not_before: Duration,
    next: Duration,
}

/// Permission for one request, which counts as in flight until this is dropped.
#[derive(Debug)]
pub struct Permit<'a> {
    pace: &'a Pace,
}

impl Pace {
    /// At most `most` concurrent requests, and at least one; one per `interval`.
    pub fn new(most: usize, interval: Duration) -> Self {
        let most = most.clamp(1, Semaphore::MAX_PERMITS);
        let state = State { limit: most, most, debt: 0, good: 0, gate: Gate::default() };
        Self { permits: Semaphore::new(most), state: Mutex::new(state), interval, shared: OnceLock::new() }
    }

    pub fn share(&self, path: &Path) -> io::Result<()> {
        let file = SharedFile::open(path)?;
        // A second call has no effect.
        let _ = self.shared.set(file);
        Ok(())
    }

    pub async fn turn(&self) -> Permit<'_> {
        // The semaphore is never closed, so this always yields a permit.
        if let Ok(permit) = self.permits.acquire().await {
            permit.forget();
        }
        let turn = Permit { pace: self };
        let mut at = Duration::ZERO;
        if !self.interval.is_zero() {
            at = self.gate(|gate| {
                let due = gate.next.max(gate.not_before).max(now());
                gate.next = due + self.interval;
                due
            });
        }
        // A rate limit may be used up during the wait.
        while let Some(wait) =
            at.max(self.gate(|gate| gate.not_before)).checked_sub(now()).filter(|wait| !wait.is_zero())
        {
            sleep(wait).await;
        }
        turn
    }

    pub fn pause(&self, wait: Duration) {
        self.gate(|gate| gate.not_before = gate.not_before.max(now().saturating_add(wait)));
    }

    fn gate<T>(&self, change: impl FnOnce(&mut Gate) -> T) -> T {
        let mut state = locked(&self.state);
        let Some(file) = self.shared.get() else { return change(&mut state.gate) };
        file.locked(|| {
            let read: Gate = file.read().unwrap_or_default();
            let mut gate = read;
            let outcome = change(&mut gate);
            if gate != read {
                // If the file cannot be written, nothing is shared.
                let _ = file.write(&gate);
            }
            outcome
        })
    }

    pub fn good(&self) {
        let mut state = locked(&self.state);
        state.good += 1;
        if state.good >= state.limit && state.limit < state.most {
            state.limit += 1;
            state.good = 0;
            self.give_back(&mut state);
        }
    }

    pub fn too_many(&self) {
        let mut state = locked(&self.state);
        let lower = (state.limit / 2).max(1);
        let fewer = state.limit - lower;
        state.debt += fewer - self.permits.forget_permits(fewer);
        state.limit = lower;
        state.good = 0;
    }

    fn give_back(&self, state: &mut State) {
        if state.debt > 0 {
            state.debt -= 1;
        } else {
            self.permits.add_permits(1);
        }
    }
}

impl Drop for Permit<'_> {
    fn drop(&mut self) {
        let mut state = locked(&self.pace.state);
        self.pace.give_back(&mut state);
    }
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use super::{Duration, Pace, locked};

    /// The limit of requests in flight, and the free ones of them.
    fn limit_and_free(pace: &Pace) -> (usize, usize) {
        (locked(&pace.state).limit, pace.permits.available_permits())
    }

    #[tokio::test]
    async fn a_rate_limit_halves_the_concurrency_and_successes_raise_it() {
        let pace = Pace::new(8, Duration::ZERO);
        let turns = [pace.turn().await, pace.turn().await, pace.turn().await, pace.turn().await, pace.turn().await];
        pace.too_many();
        assert_eq!(limit_and_free(&pace), (4, 0));
        drop(turns);
        assert_eq!(limit_and_free(&pace), (4, 4), "one of five was over the new limit");
        for _ in 0..4 {
            pace.good();
        }
        assert_eq!(limit_and_free(&pace), (5, 5));
    }

    #[tokio::test]
    async fn no_request_starts_during_a_pause() {
        let (pace, start) = (Pace::new(2, Duration::ZERO), Instant::now());
        pace.pause(Duration::from_millis(50));
        pace.pause(Duration::from_millis(1));
        let turns = [pace.turn().await, pace.turn().await];
        assert!(start.elapsed() >= Duration::from_millis(50));
        drop(turns);
        assert_eq!(limit_and_free(&pace), (2, 2));
    }

    #[tokio::test]
    async fn processes_of_a_folder_share_pauses_and_the_rate() {
        let folder = tempfile::tempdir().unwrap();
        let [one, other] = [(); 2].map(|()| Pace::new(8, Duration::from_millis(20)));
        for pace in [&one, &other] {
            pace.share(&folder.path().join("ledger/at.json")).unwrap();
        }
        let start = Instant::now();
        for _ in 0..3 {
            drop((one.turn().await, other.turn().await));
        }
        assert!(start.elapsed() >= Duration::from_millis(100), "six requests, 20 ms apart: {:?}", start.elapsed());
        one.pause(Duration::from_millis(150));
        let start = Instant::now();
        drop(other.turn().await);
        assert!(start.elapsed() >= Duration::from_millis(140), "{:?}", start.elapsed());
    }

    #[tokio::test]
    async fn one_request_is_always_allowed_and_the_most_is_kept() {
        let pace = Pace::new(2, Duration::ZERO);
        for _ in 0..5 {
            pace.too_many();
        }
        assert_eq!(limit_and_free(&pace), (1, 1));
        for _ in 0..9 {
            pace.good();
        }
        assert_eq!(limit_and_free(&pace), (2, 2));
    }
}

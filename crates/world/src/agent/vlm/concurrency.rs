//! How many requests a provider gets at once: one more after a round of good answers, half as many after a reply that
//! says that there were too many; none before a rate limit is renewed.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::Semaphore;
use tokio::time::{Instant, sleep_until};

/// The concurrency of one provider, shared by all episodes.
#[derive(Debug)]
pub struct Pace {
    permits: Semaphore,
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    limit: usize,
    most: usize,
    /// Permits to swallow as they come back, after the limit fell below what was out.
    debt: usize,
    /// Good answers since the limit last changed.
    good: usize,
    /// When the next request may go out; `None` if now.
    not_before: Option<Instant>,
}

/// A request that may go out; counts as out until it is dropped.
#[derive(Debug)]
pub struct Turn<'a> {
    pace: &'a Pace,
}

impl Pace {
    /// At most `most` requests at once, and at least one.
    pub fn new(most: usize) -> Self {
        let most = most.clamp(1, Semaphore::MAX_PERMITS);
        Self {
            permits: Semaphore::new(most),
            state: Mutex::new(State { limit: most, most, debt: 0, good: 0, not_before: None }),
        }
    }

    /// Waits until a request may go out.
    pub async fn turn(&self) -> Turn<'_> {
        // The semaphore is never closed, so that there is no other outcome than a permit.
        if let Ok(permit) = self.permits.acquire().await {
            permit.forget();
        }
        let turn = Turn { pace: self };
        while let Some(at) = self.not_before() {
            sleep_until(at).await;
        }
        turn
    }

    /// Lets no request out for this time.
    pub fn pause(&self, wait: Duration) {
        let mut state = self.state();
        state.not_before = state.not_before.max(Instant::now().checked_add(wait));
    }

    fn not_before(&self) -> Option<Instant> {
        self.state().not_before.filter(|at| *at > Instant::now())
    }

    /// How many requests may be out now.
    pub fn limit(&self) -> usize {
        self.state().limit
    }

    pub fn good(&self) {
        let mut state = self.state();
        state.good += 1;
        if state.good >= state.limit && state.limit < state.most {
            state.limit += 1;
            state.good = 0;
            self.give_back(&mut state);
        }
    }

    /// The provider said that it gets too many requests.
    pub fn too_many(&self) {
        let mut state = self.state();
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

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        let mut state = self.pace.state();
        self.pace.give_back(&mut state);
    }
}

#[cfg(test)]
mod tests {
    use super::{Duration, Instant, Pace};

    fn free(pace: &Pace) -> usize {
        pace.permits.available_permits()
    }

    #[tokio::test]
    async fn too_many_halves_and_good_answers_add_one() {
        let pace = Pace::new(8);
        let turns = [pace.turn().await, pace.turn().await, pace.turn().await, pace.turn().await, pace.turn().await];
        pace.too_many();
        assert_eq!((pace.limit(), free(&pace)), (4, 0));
        drop(turns);
        assert_eq!(free(&pace), 4, "one of five was over the new limit");
        for _ in 0..4 {
            pace.good();
        }
        assert_eq!((pace.limit(), free(&pace)), (5, 5));
    }

    #[tokio::test]
    async fn nobody_asks_before_a_pause_is_over() {
        let (pace, start) = (Pace::new(2), Instant::now());
        pace.pause(Duration::from_millis(50));
        pace.pause(Duration::from_millis(1));
        let turns = [pace.turn().await, pace.turn().await];
        assert!(start.elapsed() >= Duration::from_millis(50));
        drop(turns);
        assert_eq!(free(&pace), 2);
    }

    #[tokio::test]
    async fn one_request_is_always_allowed_and_the_most_is_kept() {
        let pace = Pace::new(2);
        for _ in 0..5 {
            pace.too_many();
        }
        assert_eq!((pace.limit(), free(&pace)), (1, 1));
        for _ in 0..9 {
            pace.good();
        }
        assert_eq!((pace.limit(), free(&pace)), (2, 2));
    }
}

//! The number of concurrent requests: one more after a round of good answers, half after a reply that says that there
//! were too many. No request is sent before a rate limit is renewed, or above the user's limit per minute.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use tokio::sync::Semaphore;
use tokio::time::sleep_until;

use mirrorstats_agents::locked;

#[derive(Debug)]
pub(crate) struct ConcurrencyLimiter {
    permits: Semaphore,
    state: Mutex<State>,
    interval: Duration,
}

#[derive(Debug)]
struct State {
    limit: usize,
    most: usize,
    /// Permits to discard when they return, after the limit fell below the number in flight.
    debt: usize,
    /// Good answers since the limit last changed.
    good: usize,
    /// The time from which the account takes requests.
    not_before: Instant,
    /// The time of the next request.
    next: Instant,
}

/// Permission for one request, which counts as in flight until this is dropped.
#[derive(Debug)]
pub struct Permit<'a> {
    limiter: &'a ConcurrencyLimiter,
}

impl ConcurrencyLimiter {
    /// At most `most` concurrent requests, and at least one; one per `interval`.
    pub fn new(most: usize, interval: Duration) -> Self {
        let most = most.clamp(1, Semaphore::MAX_PERMITS);
        let state = State { limit: most, most, debt: 0, good: 0, not_before: Instant::now(), next: Instant::now() };
        Self { permits: Semaphore::new(most), state: Mutex::new(state), interval }
    }

    pub async fn turn(&self) -> Permit<'_> {
        // The semaphore is never closed, so this always yields a permit.
        if let Ok(permit) = self.permits.acquire().await {
            permit.forget();
        }
        let turn = Permit { limiter: self };
        let mut at = self.due();
        while at > Instant::now() {
            sleep_until(at.into()).await;
            // A rate limit may be used up during the wait.
            at = locked(&self.state).not_before;
        }
        turn
    }

    fn due(&self) -> Instant {
        let mut state = locked(&self.state);
        let due = state.next.max(state.not_before).max(Instant::now());
        state.next = due + self.interval;
        due
    }

    pub fn pause(&self, wait: Duration) {
        let mut state = locked(&self.state);
        state.not_before = state.not_before.max(Instant::now() + wait);
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
        let mut state = locked(&self.limiter.state);
        self.limiter.give_back(&mut state);
    }
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use super::{ConcurrencyLimiter, Duration, locked};

    /// The limit of requests in flight, and the free ones of them.
    fn limit_and_free(limiter: &ConcurrencyLimiter) -> (usize, usize) {
        (locked(&limiter.state).limit, limiter.permits.available_permits())
    }

    #[tokio::test]
    async fn a_rate_limit_halves_the_concurrency_and_successes_raise_it() {
        let limiter = ConcurrencyLimiter::new(8, Duration::ZERO);
        let turns = [
            limiter.turn().await,
            limiter.turn().await,
            limiter.turn().await,
            limiter.turn().await,
            limiter.turn().await,
        ];
        limiter.too_many();
        assert_eq!(limit_and_free(&limiter), (4, 0));
        drop(turns);
        assert_eq!(limit_and_free(&limiter), (4, 4), "one of five was over the new limit");
        for _ in 0..4 {
            limiter.good();
        }
        assert_eq!(limit_and_free(&limiter), (5, 5));
    }

    #[tokio::test]
    async fn no_request_starts_during_a_pause() {
        let (limiter, start) = (ConcurrencyLimiter::new(2, Duration::ZERO), Instant::now());
        limiter.pause(Duration::from_millis(50));
        limiter.pause(Duration::from_millis(1));
        let turns = [limiter.turn().await, limiter.turn().await];
        assert!(start.elapsed() >= Duration::from_millis(50));
        drop(turns);
        assert_eq!(limit_and_free(&limiter), (2, 2));
    }

    #[tokio::test]
    async fn requests_keep_the_rate_of_the_account() {
        let (limiter, start) = (ConcurrencyLimiter::new(8, Duration::from_millis(20)), Instant::now());
        for _ in 0..6 {
            drop(limiter.turn().await);
        }
        assert!(start.elapsed() >= Duration::from_millis(100), "six requests, 20 ms apart: {:?}", start.elapsed());
    }

    #[tokio::test]
    async fn one_request_is_always_allowed_and_the_most_is_kept() {
        let limiter = ConcurrencyLimiter::new(2, Duration::ZERO);
        for _ in 0..5 {
            limiter.too_many();
        }
        assert_eq!(limit_and_free(&limiter), (1, 1));
        for _ in 0..9 {
            limiter.good();
        }
        assert_eq!(limit_and_free(&limiter), (2, 2));
    }
}

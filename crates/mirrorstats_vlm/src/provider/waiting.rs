//! The wait of a step after a failure, and the end of its attempts.
//!
//! Rule: a failure uses up an attempt; a rate limit or an overloaded provider uses up only time.

use std::time::Duration;

use backon::{BackoffBuilder as _, ExponentialBackoff, ExponentialBuilder};

use super::Patience;
use super::failure::Failure;

#[derive(Debug)]
pub(crate) struct Waiting {
    patience: Patience,
    failed: u32,
    after_failures: ExponentialBackoff,
    waited: Duration,
    while_busy: ExponentialBackoff,
}

impl Waiting {
    pub(crate) fn new(patience: Patience) -> Self {
        let backoff = ExponentialBuilder::default()
            .with_min_delay(patience.first_delay)
            .with_max_delay(patience.longest_delay)
            .without_max_times()
            .with_jitter();
        let [after_failures, while_busy] = [backoff, backoff].map(ExponentialBuilder::build);
        Self { patience, failed: 0, after_failures, waited: Duration::ZERO, while_busy }
    }

    pub(crate) fn next(&mut self, failure: &Failure) -> Option<Duration> {
        if failure.kind.is_busy() { self.busy(failure.after) } else { self.failed(failure.after) }
    }

    fn busy(&mut self, asked: Option<Duration>) -> Option<Duration> {
        // A provider that keeps requesting no wait would be called without a pause.
        let wait = match asked.filter(|asked| !asked.is_zero()) {
            Some(asked) => asked,
            None => self.while_busy.next()?,
        };
        self.waited = self.waited.saturating_add(wait);
        (self.waited <= self.patience.longest_wait).then_some(wait)
    }

    fn failed(&mut self, asked: Option<Duration>) -> Option<Duration> {
        self.failed += 1;
        if self.failed >= self.patience.attempts {
            return None;
        }
        let wait = self.after_failures.next()?;
        Some(asked.map_or(wait, |asked| asked.min(self.patience.longest_asked_delay)))
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::{Failure, Patience, Waiting};
    use crate::provider::failure::FailureKind;

    fn failure(kind: FailureKind, seconds: Option<u64>) -> Failure {
        Failure { kind, detail: String::new(), after: seconds.map(Duration::from_secs), may_be_paid: false }
    }

    #[test]
    fn failures_use_attempts_and_rate_limits_use_time() {
        let mut waiting = Waiting::new(Patience { attempts: 3, ..Patience::default() });
        // An hour in total, longer than 6 attempts.
        for kind in [FailureKind::RateLimited, FailureKind::Overloaded] {
            for _ in 0..3 {
                assert_eq!(waiting.next(&failure(kind, Some(500))), Some(Duration::from_secs(500)));
            }
        }
        assert!(waiting.next(&failure(FailureKind::Server, None)).is_some());
        assert_eq!(waiting.next(&failure(FailureKind::Timeout, Some(3_600))), Some(Duration::from_mins(10)));
        assert_eq!(waiting.next(&failure(FailureKind::Server, None)), None);
        assert_eq!(waiting.next(&failure(FailureKind::RateLimited, Some(601))), None);
        assert_eq!(waiting.next(&failure(FailureKind::RateLimited, Some(u64::MAX))), None);
    }

    #[test]
    fn a_provider_that_asks_for_no_wait_gets_a_growing_one() {
        let mut waiting = Waiting::new(Patience::default());
        let waits: Vec<_> = (0..5).map_while(|_| waiting.next(&failure(FailureKind::RateLimited, Some(0)))).collect();
        assert_eq!(waits.len(), 5);
        assert!(waits[0] >= Duration::from_secs(1) && waits[4] >= Duration::from_secs(16), "{waits:?}");
    }
}

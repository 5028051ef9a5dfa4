//! The time of a recording by activity.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// The time of a recording by activity, over all threads.
#[derive(Debug, Default)]
pub struct Shares {
    rendering: AtomicU64,
    visibility: AtomicU64,
    writing: AtomicU64,
    all: AtomicU64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Spent {
    /// Drawing frames.
    pub rendering: Duration,
    /// Moving the world and casting rays.
    pub visibility: Duration,
    /// Writing logs and parts.
    pub writing: Duration,
    /// The rest of the threads' time: deciding agents, and waiting for external ones.
    pub agent: Duration,
}

impl Shares {
    pub(super) fn rendering(&self, start: Instant) {
        add(&self.rendering, start);
    }

    pub(super) fn visibility(&self, start: Instant) {
        add(&self.visibility, start);
    }

    pub(super) fn writing(&self, start: Instant) {
        add(&self.writing, start);
    }

    /// Adds a thread's total time since its start.
    pub(super) fn thread(&self, start: Instant) {
        add(&self.all, start);
    }

    pub fn spent(&self) -> Spent {
        let read = |share: &AtomicU64| Duration::from_nanos(share.load(Ordering::Relaxed));
        let [rendering, visibility, writing] = [&self.rendering, &self.visibility, &self.writing].map(read);
        let agent = read(&self.all).saturating_sub(rendering + visibility + writing);
        Spent { rendering, visibility, writing, agent }
    }
}

fn add(share: &AtomicU64, start: Instant) {
    let spent = u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
    share.fetch_add(spent, Ordering::Relaxed);
}

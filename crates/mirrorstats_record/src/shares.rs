use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// The time of a recording by activity, over all threads.
#[derive(Debug, Default)]
pub struct Shares {
    pub(super) rendering: Share,
    pub(super) visibility: Share,
    pub(super) writing: Share,
    /// The threads' total time.
    pub(super) all: Share,
}

/// Nanoseconds.
#[derive(Debug, Default)]
pub(super) struct Share(AtomicU64);

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

impl Share {
    pub(super) fn add(&self, start: Instant) {
        let spent = u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
        self.0.fetch_add(spent, Ordering::Relaxed);
    }
}

impl Shares {
    pub fn spent(&self) -> Spent {
        let read = |share: &Share| Duration::from_nanos(share.0.load(Ordering::Relaxed));
        let [rendering, visibility, writing] = [&self.rendering, &self.visibility, &self.writing].map(read);
        let agent = read(&self.all).saturating_sub(rendering + visibility + writing);
        Spent { rendering, visibility, writing, agent }
    }
}

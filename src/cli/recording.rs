//! What `record` tells while it runs and when it has ended, on standard error: progress, and where the time went.

use std::io::{self, IsTerminal as _, Write as _};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use schemars::JsonSchema;
use serde::Serialize;

use super::listing::counted;
use crate::base::visible::visible;
use crate::record::run::{Progress, Spent, Tally};

/// The answer of `record --json`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct RecordAnswer {
    /// The model's name as shown in tables.
    pub model: String,
    /// Episodes asked for, those of other shards not among them.
    pub asked: usize,
    /// Episodes that were there before.
    pub found: usize,
    /// Episodes that were recorded now.
    pub recorded: usize,
    /// Their steps.
    pub steps: u64,
    /// Episodes that were lost to failures which are not the agent's; they are in no trace.
    pub lost: Vec<LostEpisode>,
    /// Whether the recording was stopped before its end.
    pub stopped: bool,
    /// The traces of these episodes.
    pub traces: Vec<String>,
    /// Their logs.
    pub logs: Vec<String>,
}

/// An episode that was lost.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct LostEpisode {
    /// Its id.
    pub episode_id: String,
    /// What failed.
    pub reason: String,
}

impl RecordAnswer {
    /// What became of the episodes.
    pub fn of(tally: Tally, model: &str, asked: usize, found: usize, [traces, logs]: [Vec<String>; 2]) -> Self {
        let lost = tally.lost.into_iter().map(|(episode_id, reason)| LostEpisode { episode_id, reason }).collect();
        let Tally { recorded, steps, stopped, .. } = tally;
        Self { model: model.to_owned(), asked, found, recorded, steps, lost, stopped, traces, logs }
    }
}

/// The progress bar, which a terminal alone shows.
pub(super) struct Bar {
    line: ProgressBar,
    episodes: usize,
    ended: AtomicUsize,
    budget: u64,
}

impl Bar {
    /// A bar for so many episodes of so many steps at most.
    pub(super) fn new(episodes: usize, steps: u32) -> Self {
        let target =
            if io::stderr().is_terminal() { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let budget = u64::from(steps);
        let line = ProgressBar::with_draw_target(Some(episodes as u64 * budget), target);
        let style = ProgressStyle::with_template("{msg} {wide_bar} {pos} steps, {per_sec}, {eta} left");
        line.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        let bar = Self { line, episodes, ended: AtomicUsize::new(0), budget };
        bar.tell();
        bar
    }

    /// Takes it off the terminal.
    pub(super) fn clear(&self) {
        self.line.finish_and_clear();
    }

    fn tell(&self) {
        self.line.set_message(format!("{} of {} episodes", self.ended.load(Ordering::Relaxed), self.episodes));
    }
}

impl Progress for Bar {
    fn step(&self) {
        self.line.inc(1);
    }

    fn episode(&self, _: &str, steps: usize) {
        self.ended.fetch_add(1, Ordering::Relaxed);
        // Steps that an early decision leaves unused are not still to come.
        let unused = self.budget.saturating_sub(steps as u64);
        self.line.set_length(self.line.length().unwrap_or_default().saturating_sub(unused));
        self.tell();
    }

    fn lost(&self, id: &str, reason: &str) {
        self.line.suspend(|| {
            // With standard error closed there is nobody left to tell.
            let _ = writeln!(io::stderr(), "lost {}: {}", visible(id), visible(reason));
        });
    }
}

/// Says what became of the episodes, and where the time went.
pub(super) fn say(answer: &RecordAnswer, elapsed: Duration, spent: Spent) -> io::Result<()> {
    let mut out = io::stderr().lock();
    let seconds = elapsed.as_secs_f64();
    #[expect(clippy::cast_precision_loss, reason = "a rate for people")]
    let rate = if seconds > 0.0 { answer.steps as f64 / seconds } else { 0.0 };
    let (episodes, steps) = (counted(answer.recorded as u64, "episode"), counted(answer.steps, "step"));
    write!(out, "{}: recorded {episodes}, {steps} in {seconds:.1} s", visible(&answer.model))?;
    if answer.recorded > 0 {
        write!(out, " ({rate:.0} steps a second)")?;
    }
    match answer.found {
        0 => writeln!(out)?,
        found => writeln!(out, "; {found} of {} were there before", answer.asked)?,
    }
    if let Some(shares) = shares(spent) {
        writeln!(out, "time: {shares}")?;
    }
    if !answer.lost.is_empty() {
        let lost = counted(answer.lost.len() as u64, "episode");
        writeln!(out, "lost {lost} to failures that are not the agent's: in no trace; the same command tries again")?;
    }
    if answer.stopped {
        let left = answer.asked - answer.found - answer.recorded - answer.lost.len();
        writeln!(out, "stopped, {} to go: the same command continues", counted(left as u64, "episode"))?;
    }
    Ok(())
}

/// What share of the work each part took.
fn shares(spent: Spent) -> Option<String> {
    let parts = [
        ("rendering", spent.rendering),
        ("world and census", spent.census),
        ("agents", spent.agent),
        ("writing", spent.writing),
    ];
    let total: f64 = parts.iter().map(|(_, time)| time.as_secs_f64()).sum();
    let words = parts.map(|(name, time)| format!("{name} {:.0} %", 100.0 * time.as_secs_f64() / total));
    (total > 0.0).then(|| words.join(", "))
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::shares;
    use crate::record::run::Spent;

    #[test]
    fn shares_are_of_the_whole_and_need_one() {
        let spent = Spent {
            rendering: Duration::from_secs(7),
            census: Duration::from_secs(2),
            agent: Duration::ZERO,
            writing: Duration::from_secs(1),
        };
        let expected = "rendering 70 %, world and census 20 %, agents 0 %, writing 10 %";
        assert_eq!(shares(spent).as_deref(), Some(expected));
        assert_eq!(shares(Spent::default()), None);
    }
}

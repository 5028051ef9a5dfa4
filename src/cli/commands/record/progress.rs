//! The progress of a recording on standard error.

use std::collections::BTreeMap;
use std::io::{self, IsTerminal as _, Write as _};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::agent::AnyPlayer;
use super::answer::{spent, unreadable};
use mirrorstats_exact::escape::{visible, visible_lines};
use mirrorstats_exact::format::fixed;
use mirrorstats_experiment::Experiment;
use mirrorstats_record::plan::{Key, Subject};
use mirrorstats_record::replies::{Replies, RepliesAnswer};
use mirrorstats_record::run::Progress;
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_trace::episodes::episode::Step;

const BETWEEN_LINES: Duration = Duration::from_secs(10);
const BETWEEN_UPDATES: Duration = Duration::from_millis(100);
/// Returns to the start of the terminal's line and empties it.
const CLEAR: &str = "\r\x1b[2K";

/// The steps and episodes of this start so far.
#[derive(Debug)]
struct Counts {
    steps: u64,
    ended: usize,
    /// The steps of ended episodes, and the most that they could have had.
    used: u64,
    budget: u64,
    shown: Instant,
}

impl Counts {
    /// The steps of all episodes, if they end as early as those that have ended. `None` before one has: nobody knows
    /// how long an episode takes.
    fn expected(&self, planned: u64) -> Option<u64> {
        let expected = u128::from(planned) * u128::from(self.used) / u128::from(self.budget.max(1));
        (self.ended > 0).then(|| u64::try_from(expected).unwrap_or(u64::MAX).max(self.steps))
    }
}

fn rate(per_second: f64) -> String {
    let is_known = per_second.is_finite() && per_second > 0.0;
    if is_known { format!(", {} a second", fixed(Some(per_second), 1)) } else { String::new() }
}

fn time_left(seconds: u64) -> String {
    match seconds {
        0..60 => format!(", about {seconds} s left"),
        _ => format!(", about {} min left", seconds.div_ceil(60)),
    }
}

/// The progress: one line on a terminal. Otherwise occasional lines, for agents that wait for a provider or a program,
/// or whose replies are unreadable.
pub(super) struct Bar<'a> {
    player: &'a AnyPlayer,
    subject: &'a Subject,
    episodes: usize,
    /// The steps of all episodes at most.
    planned: u64,
    replies: Replies,
    budget: BTreeMap<Experiment, u64>,
    start: Instant,
    counts: Mutex<Counts>,
    is_terminal: bool,
}

impl<'a> Bar<'a> {
    pub(super) fn new(player: &'a AnyPlayer, subject: &'a Subject, todo: &[Key], world: &WorldConfig) -> Self {
        let steps_of = |key: &Key| u64::from(world.for_experiment(&key.experiment).episode.steps);
        let start = Instant::now();
        Self {
            player,
            subject,
            episodes: todo.len(),
            planned: todo.iter().map(steps_of).sum(),
            replies: Replies::default(),
            budget: todo.iter().map(|key| (key.experiment.clone(), steps_of(key))).collect(),
            start,
            counts: Mutex::new(Counts { steps: 0, ended: 0, used: 0, budget: 0, shown: start }),
            is_terminal: io::stderr().is_terminal(),
        }
    }

    fn counts(&self) -> MutexGuard<'_, Counts> {
        self.counts.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn clear(&self) {
        if self.is_terminal {
            let _ = write!(io::stderr(), "{CLEAR}");
        }
    }

    /// The steps played by this start, those of unfinished episodes too.
    pub(super) fn steps(&self) -> u64 {
        self.counts().steps
    }

    pub(super) fn replies(&self) -> RepliesAnswer {
        self.replies.answer()
    }

    fn message(&self, counts: &Counts) -> String {
        let unreadable = unreadable(&self.replies.counts()).map_or_else(String::new, |words| format!(", {words}"));
        let spent = self.player.spend().map_or_else(String::new, |spend| format!(", {}", spent(&spend)));
        format!("{} of {} episodes{unreadable}{spent}", counts.ended, self.episodes)
    }

    fn say(&self, line: &str) {
        self.clear();
        // If standard error is closed, the message cannot be shown.
        let _ = writeln!(io::stderr(), "{line}");
    }

    fn has_news(&self) -> bool {
        self.player.player().waits() || self.replies.counts().all_unreadable() > 0
    }

    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "for people"
    )]
    fn show(&self, counts: &mut Counts) {
        let between = if self.is_terminal { BETWEEN_UPDATES } else { BETWEEN_LINES };
        if counts.shown.elapsed() < between || !(self.is_terminal || self.has_news()) {
            return;
        }
        counts.shown = Instant::now();
        let per_second = counts.steps as f64 / self.start.elapsed().as_secs_f64();
        let left = counts.expected(self.planned).filter(|_| counts.steps > 0);
        let left =
            left.map(|all| ((all - counts.steps) as f64 / per_second) as u64).map_or_else(String::new, time_left);
        let line = format!("{}, {} steps{}{left}", self.message(counts), counts.steps, rate(per_second));
        let _ = if self.is_terminal { write!(io::stderr(), "{CLEAR}{line}") } else { writeln!(io::stderr(), "{line}") };
    }
}

impl Progress for Bar<'_> {
    fn step(&self, episode: &Key, t: i32, row: &Step) {
        if let Some(first) = self.replies.add(self.subject, episode, t, row) {
            self.say(&format!("a reply could not be read: {}: {}", first.status, first.words()));
        }
        let mut counts = self.counts();
        counts.steps += 1;
        self.show(&mut counts);
    }

    fn episode(&self, key: &Key, _: &str, steps: usize) {
        let mut counts = self.counts();
        counts.ended += 1;
        counts.used += steps as u64;
        counts.budget += self.budget.get(&key.experiment).copied().unwrap_or_default();
    }

    fn model_changed(&self, id: &str, t: i32, before: &str, after: &str) {
        self.say(&format!(
            "{}: from step {t} on the provider answers as `{}` and not as `{}`; the episode keeps the first name, the next \
             one has another fingerprint",
            visible(id),
            visible(after),
            visible(before)
        ));
    }

    fn lost(&self, id: &str, reason: &str) {
        self.say(&format!("lost {}: {}", visible(id), visible_lines(reason)));
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::{AnyPlayer, Bar, rate, time_left};
    use mirrorstats_agents::scripted::{Scripted, ScriptedPlayer};
    use mirrorstats_agents::{Player, exec};
    use mirrorstats_experiment::Experiment;
    use mirrorstats_record::plan::{Key, Subject};
    use mirrorstats_record::run::Progress as _;
    use mirrorstats_sim::config::WorldConfig;
    use mirrorstats_trace::episodes::episode::{Extra, Step};

    fn frozen() -> Box<dyn Player> {
        Box::new(ScriptedPlayer { script: Scripted::Frozen, model: "frozen".to_owned() })
    }

    #[test]
    fn the_progress_counts_unreadable_replies() {
        let player = AnyPlayer::Other(frozen());
        let subject = Subject::for_model("frozen");
        let todo = [1, 2].map(|run| Key::first(Experiment::E1, 1, run));
        let bar = Bar::new(&player, &subject, &todo, &WorldConfig::default());
        let row = |status: &str| {
            let extra = Extra { reply_status: Some(status.to_owned()), ..Extra::default() };
            Step { action: None, self_color: None, selected_cube: None, mirror_visible: false, extra }
        };
        let key = Key::first(Experiment::E1, 1, 1);
        bar.step(&key, 1, &row("ok"));
        assert_eq!((bar.message(&bar.counts()).as_str(), bar.has_news()), ("0 of 2 episodes", false));
        for (t, status) in [(2, "refusal"), (3, "parse_failed"), (4, "refusal")] {
            bar.step(&key, t, &row(status));
        }
        let expected = "0 of 2 episodes, 3 of 4 replies could not be read: parse_failed 1, refusal 2";
        assert_eq!((bar.message(&bar.counts()).as_str(), bar.has_news()), (expected, true));
    }

    #[test]
    fn the_time_left_follows_the_episodes_that_ended() {
        let player = AnyPlayer::Other(frozen());
        let subject = Subject::for_model("frozen");
        let todo = [1, 2, 3, 4].map(|run| Key::first(Experiment::E1, 1, run));
        let bar = Bar::new(&player, &subject, &todo, &WorldConfig::default());
        let all = bar.planned;
        assert_eq!(bar.counts().expected(all), None);
        bar.episode(&todo[0], "", usize::try_from(all / 20).unwrap());
        assert_eq!(bar.counts().expected(all), Some(all / 5));
        assert_eq!([rate(2.7208), rate(0.0), rate(f64::NAN)], [", 2.7 a second", "", ""]);
        assert_eq!(time_left(59), ", about 59 s left");
        assert_eq!(time_left(61), ", about 2 min left");
    }

    #[test]
    fn a_log_names_programs_but_not_scripted_agents() {
        let settings = exec::ExecSettings {
            model: "own".to_owned(),
            command: "true".to_owned(),
            images: exec::Images::Path,
            timeout: Duration::from_secs(1),
            scratch: std::env::temp_dir(),
            standard_error: std::env::temp_dir(),
        };
        let program = exec::Exec::new(settings).unwrap();
        let subject = Subject::for_model("own");
        let world = WorldConfig::default();
        let has_news = |player: Box<dyn Player>| Bar::new(&AnyPlayer::Other(player), &subject, &[], &world).has_news();
        assert_eq!([has_news(Box::new(program)), has_news(frozen())], [true, false]);
    }
}

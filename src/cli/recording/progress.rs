//! The progress of a recording on standard error.

use std::collections::BTreeMap;
use std::fmt;
use std::io::{self, IsTerminal as _, Write as _};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use super::player::AnyPlayer;
use super::{spent, unreadable};
use mirrorstats_exact::escape::{visible, visible_lines};
use mirrorstats_exact::format::fixed;
use mirrorstats_experiment::Experiment;
use mirrorstats_record::plan::{Key, Subject};
use mirrorstats_record::replies::{Replies, RepliesAnswer};
use mirrorstats_record::run::Progress;
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_trace::episodes::episode::Step;

const BETWEEN_LINES: Duration = Duration::from_secs(10);

/// The steps of ended episodes, and the most that they could have had.
#[derive(Debug, Default)]
struct Used {
    steps: u64,
    budget: u64,
}

impl Used {
    /// The expected steps of a budget, if all episodes end as early as those that have ended.
    fn expected(&self, planned: u64) -> u64 {
        let expected = u128::from(planned) * u128::from(self.steps) / u128::from(self.budget.max(1));
        u64::try_from(expected).unwrap_or(u64::MAX)
    }
}

fn rate(per_second: f64) -> String {
    let is_known = per_second.is_finite() && per_second > 0.0;
    if is_known { format!(", {} a second", fixed(Some(per_second), 1)) } else { String::new() }
}

fn time_left(left: Duration) -> String {
    match left.as_secs() {
        seconds @ 0..60 => format!(", about {seconds} s left"),
        seconds => format!(", about {} min left", seconds.div_ceil(60)),
    }
}

/// The progress: a bar on a terminal. Otherwise occasional lines, for agents that wait for a provider or a program, or
/// whose replies are unreadable.
pub(crate) struct Bar<'a> {
    line: ProgressBar,
    player: &'a AnyPlayer,
    subject: &'a Subject,
    episodes: usize,
    /// The steps of all episodes at most.
    planned: u64,
    ended: AtomicUsize,
    replies: Replies,
    budget: BTreeMap<Experiment, u64>,
    used: Mutex<Used>,
    /// True once an episode has ended: before, nobody knows how long one takes.
    known: Arc<AtomicBool>,
    is_shown: bool,
    told: Mutex<Instant>,
}

impl<'a> Bar<'a> {
    pub(crate) fn new(player: &'a AnyPlayer, subject: &'a Subject, todo: &[Key], world: &WorldConfig) -> Self {
        let steps_of = |key: &Key| u64::from(world.for_experiment(&key.experiment).episode.steps);
        let budget: BTreeMap<Experiment, u64> =
            todo.iter().map(|key| (key.experiment.clone(), steps_of(key))).collect();
        let planned = todo.iter().filter_map(|key| budget.get(&key.experiment)).sum();
        let episodes = todo.len();
        let is_shown = io::stderr().is_terminal();
        let target = if is_shown { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let line = ProgressBar::with_draw_target(Some(planned), target);
        let style = ProgressStyle::with_template("{msg} {wide_bar} {pos} steps{rate}{left}");
        let (ended, known) = (AtomicUsize::new(0), Arc::new(AtomicBool::new(false)));
        let is_known = Arc::clone(&known);
        let style = style.unwrap_or_else(|_| ProgressStyle::default_bar());
        let style = style.with_key("rate", |state: &ProgressState, out: &mut dyn fmt::Write| {
            let _ = out.write_str(&rate(state.per_sec()));
        });
        line.set_style(style.with_key("left", move |state: &ProgressState, out: &mut dyn fmt::Write| {
            let left = is_known.load(Ordering::Relaxed).then(|| state.eta());
            let _ = out.write_str(&left.map_or_else(String::new, time_left));
        }));
        let told = Mutex::new(Instant::now());
        let (replies, used) = (Replies::default(), Mutex::default());
        let bar =
            Self { line, player, subject, episodes, planned, ended, replies, budget, used, known, is_shown, told };
        bar.line.set_message(bar.message());
        bar
    }

    pub(crate) fn clear(&self) {
        self.line.finish_and_clear();
    }

    /// The steps played by this start, those of unfinished episodes too.
    pub(crate) fn steps(&self) -> u64 {
        self.line.position()
    }

    pub(crate) fn replies(&self) -> RepliesAnswer {
        self.replies.answer()
    }

    fn message(&self) -> String {
        let unreadable = unreadable(&self.replies.counts()).map_or_else(String::new, |words| format!(", {words}"));
        let spent = self.player.spend().map_or_else(String::new, |spend| format!(", {}", spent(&spend)));
        format!("{} of {} episodes{unreadable}{spent}", self.ended.load(Ordering::Relaxed), self.episodes)
    }

    fn say(&self, line: &str) {
        self.line.suspend(|| {
            // If standard error is closed, the message cannot be shown.
            let _ = writeln!(io::stderr(), "{line}");
        });
    }

    fn has_news(&self) -> bool {
        self.player.player().waits() || self.replies.counts().all_unreadable() > 0
    }

    fn write_line(&self) {
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        if self.is_shown || told.elapsed() < BETWEEN_LINES || !self.has_news() {
            return;
        }
        *told = Instant::now();
        let (message, steps, rate) = (self.message(), self.line.position(), rate(self.line.per_sec()));
        let is_known = self.known.load(Ordering::Relaxed);
        let left = if is_known { time_left(self.line.eta()) } else { String::new() };
        // If standard error is closed, the message cannot be shown.
        let _ = writeln!(io::stderr(), "{message}, {steps} steps{rate}{left}");
    }
}

impl Progress for Bar<'_> {
    fn step(&self, episode: &Key, t: i32, row: &Step) {
        self.line.inc(1);
        if let Some(first) = self.replies.add(self.subject, episode, t, row) {
            self.say(&format!("a reply could not be read: {}: {}", first.status, first.words()));
        }
        if self.is_shown {
            self.line.set_message(self.message());
        } else {
            self.write_line();
        }
    }

    fn episode(&self, key: &Key, _: &str, steps: usize) {
        self.ended.fetch_add(1, Ordering::Relaxed);
        let budget = self.budget.get(&key.experiment).copied().unwrap_or_default();
        let mut used = self.used.lock().unwrap_or_else(PoisonError::into_inner);
        used.steps += steps as u64;
        used.budget += budget;
        self.line.set_length(used.expected(self.planned).max(self.line.position()));
        self.known.store(true, Ordering::Relaxed);
        self.line.set_message(self.message());
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
    use mirrorstats_agents::scripted::Scripted;
    use mirrorstats_agents::{Player, exec};
    use mirrorstats_experiment::Experiment;
    use mirrorstats_record::plan::{Key, Subject};
    use mirrorstats_record::run::Progress as _;
    use mirrorstats_sim::config::WorldConfig;
    use mirrorstats_trace::episodes::episode::{Extra, Step};

    #[test]
    fn the_progress_counts_unreadable_replies() {
        let player = AnyPlayer::Other(Box::new(Scripted::named("frozen").unwrap()));
        let subject = Subject::for_model("frozen");
        let todo = [1, 2].map(|run| Key::first(Experiment::E1, 1, run));
        let bar = Bar::new(&player, &subject, &todo, &WorldConfig::default());
        let row = |status: &str| {
            let extra = Extra { reply_status: Some(status.to_owned()), ..Extra::default() };
            Step { action: None, self_color: None, selected_cube: None, mirror_visible: false, extra }
        };
        let key = Key::first(Experiment::E1, 1, 1);
        bar.step(&key, 1, &row("ok"));
        assert_eq!((bar.message().as_str(), bar.has_news()), ("0 of 2 episodes", false));
        for (t, status) in [(2, "refusal"), (3, "parse_failed"), (4, "refusal")] {
            bar.step(&key, t, &row(status));
        }
        let expected = "0 of 2 episodes, 3 of 4 replies could not be read: parse_failed 1, refusal 2";
        assert_eq!((bar.message().as_str(), bar.has_news()), (expected, true));
    }

    #[test]
    fn the_time_left_follows_the_episodes_that_ended() {
        let player = AnyPlayer::Other(Box::new(Scripted::named("frozen").unwrap()));
        let subject = Subject::for_model("frozen");
        let todo = [1, 2, 3, 4].map(|run| Key::first(Experiment::E1, 1, run));
        let bar = Bar::new(&player, &subject, &todo, &WorldConfig::default());
        let all = bar.line.length().unwrap();
        bar.line.inc(all / 20);
        bar.episode(&todo[0], "", usize::try_from(all / 20).unwrap());
        assert_eq!(bar.line.length(), Some(all / 5));
        assert_eq!([rate(2.7208), rate(0.0), rate(f64::NAN)], [", 2.7 a second", "", ""]);
        assert_eq!(time_left(Duration::from_secs(59)), ", about 59 s left");
        assert_eq!(time_left(Duration::from_secs(61)), ", about 2 min left");
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
        let (program, scripted) = (exec::Exec::new(settings).unwrap(), Scripted::named("frozen").unwrap());
        let subject = Subject::for_model("own");
        let world = WorldConfig::default();
        let has_news = |player: Box<dyn Player>| Bar::new(&AnyPlayer::Other(player), &subject, &[], &world).has_news();
        assert_eq!([has_news(Box::new(program)), has_news(Box::new(scripted))], [true, false]);
    }
}

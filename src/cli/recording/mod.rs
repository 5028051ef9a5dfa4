//! Messages of `record` on standard error, during and after the recording: progress, and time by part.

pub mod dry_run;
pub mod episodes;
pub mod exec;
#[cfg(feature = "view")]
pub mod human;
pub mod interrupt;
pub mod probe;
pub mod registration;
pub mod several;
pub mod vlm;

use std::collections::BTreeMap;
use std::io::{self, IsTerminal as _, Write as _};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::NAME;
use crate::cli::scoring::commands;
use exact::escape::{visible, visible_lines};
use exact::format::counted;
use exact::format::fixed;
use exact::number::Decimal;
use report::html;
use study::{Study, StudyError};
use trace::episode::Step;
use trace::renderer::Renderer;
use trace::replies::ReplyCounts;
use world::agent::Player;
use world::agent::vlm::limits::Spend;
use world::experiment::Experiment;
use world::record::failures::LostEpisode;
use world::record::plan::{Key, Subject};
use world::record::queue::Held;
use world::record::replies::{Replies, RepliesAnswer, UnreadableReply};
use world::record::run::Progress;
use world::record::shares::Spent;
use world::sim::config::WorldConfig;

/// The answer of `record --json`.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
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
    /// Episodes that other processes recorded into the same folder meanwhile.
    pub elsewhere: usize,
    /// Episodes of participants who declined or left: not played, or deleted.
    pub left_out: usize,
    /// The replies of this start.
    pub replies: RepliesAnswer,
    /// Episodes that were lost for want of an answer: in no trace, listed in `lost.jsonl` of the folder.
    pub lost: Vec<LostEpisode>,
    /// Episodes under way that a limit of what may be spent has stopped; they are not lost, and go on under a higher limit.
    pub stopped_by_limit: usize,
    /// The spending on all that the model played into the folder, over all starts; null for agents that cost nothing.
    pub spend: Option<Spend>,
    /// True if the recording was stopped before its end.
    pub stopped: bool,
    /// What drew the frames that the agent saw in these traces; empty for an agent that sees none.
    pub renderers: Vec<Renderer>,
    /// The traces of these episodes.
    pub traces: Vec<String>,
    /// Their logs.
    pub logs: Vec<String>,
}

/// The interval of progress lines without a terminal.
const BETWEEN_LINES: Duration = Duration::from_secs(10);

/// The progress: a bar on a terminal. Otherwise occasional lines, for agents that wait for a provider or a program, or
/// whose replies are unreadable.
pub(crate) struct Bar<'a> {
    line: ProgressBar,
    player: &'a dyn Player,
    subject: &'a Subject,
    episodes: usize,
    ended: AtomicUsize,
    replies: Replies,
    budget: BTreeMap<Experiment, u64>,
    is_shown: bool,
    told: Mutex<Instant>,
    is_waiting: AtomicBool,
}

impl<'a> Bar<'a> {
    pub(crate) fn new(player: &'a dyn Player, subject: &'a Subject, todo: &[Key], world: &WorldConfig) -> Self {
        let budget: BTreeMap<Experiment, u64> =
            todo.iter().map(|key| (key.experiment, u64::from(world.of(key.experiment).episode.steps))).collect();
        let steps = todo.iter().filter_map(|key| budget.get(&key.experiment)).sum();
        let episodes = todo.len();
        let is_shown = io::stderr().is_terminal();
        let target = if is_shown { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let line = ProgressBar::with_draw_target(Some(steps), target);
        let style = ProgressStyle::with_template("{msg} {wide_bar} {pos} steps, {per_sec}, {eta} left");
        line.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        let told = Mutex::new(Instant::now());
        let (ended, is_waiting, replies) = (AtomicUsize::new(0), AtomicBool::new(false), Replies::default());
        let bar = Self { line, player, subject, episodes, ended, replies, budget, is_shown, told, is_waiting };
        bar.line.set_message(bar.message());
        bar
    }

    pub(crate) fn clear(&self) {
        self.line.finish_and_clear();
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
        self.player.waits() || self.replies.counts().all_unreadable() > 0
    }

    fn write_line(&self) {
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        if self.is_shown || told.elapsed() < BETWEEN_LINES || !self.has_news() {
            return;
        }
        *told = Instant::now();
        let (steps, rate, left) = (self.line.position(), self.line.per_sec(), self.line.eta().as_secs().div_ceil(60));
        // If standard error is closed, the message cannot be shown.
        let (message, rate) = (self.message(), fixed(Some(rate), 1));
        let _ = writeln!(io::stderr(), "{message}, {steps} steps, {rate} a second, about {left} min left");
    }
}

impl Progress for Bar<'_> {
    fn step(&self, episode: Key, t: i32, row: &Step) {
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

    fn episode(&self, key: Key, _: &str, steps: usize) {
        self.ended.fetch_add(1, Ordering::Relaxed);
        // Steps left unused by an early decision are not remaining work.
        let budget = self.budget.get(&key.experiment).copied().unwrap_or_default();
        let unused = budget.saturating_sub(steps as u64);
        self.line.set_length(self.line.length().unwrap_or_default().saturating_sub(unused));
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

    fn waiting(&self, id: &str, held: Held) {
        if !self.is_waiting.swap(true, Ordering::Relaxed) {
            self.say(&waiting(id, held));
        }
    }
}

fn waiting(id: &str, held: Held) -> String {
    let others = match held.count - 1 {
        0 => String::new(),
        more => format!(" and {}", counted(more as u64, "other episode")),
    };
    let process = held.process.map_or_else(|| "another process".to_owned(), |process| format!("process {process}"));
    format!("waiting for {}{others}: {process} records it into the same folder; press Ctrl-C to stop waiting", visible(id))
}

fn unreadable(counts: &ReplyCounts) -> Option<String> {
    let (bad, all) = (counts.all_unreadable(), counts.replies);
    let noun = if all == 1 { "reply" } else { "replies" };
    (bad > 0).then(|| format!("{bad} of {all} {noun} could not be read: {counts}"))
}

fn spent(spend: &Spend) -> String {
    let (requests, answers) = (counted(spend.requests, "request"), counted(spend.uncosted, "answer"));
    let known = match (spend.uncosted, spend.cost_usd > 0.0) {
        (0, _) => dollars(spend.cost_usd),
        (_, true) => format!("{} and what {answers} cost, which is unknown,", dollars(spend.cost_usd)),
        (_, false) => "an unknown cost".to_owned(),
    };
    let unanswered = match spend.unanswered {
        0 => String::new(),
        count => {
            let (requests, most) = (counted(count, "request"), dollars(spend.uncosted_usd_at_most));
            format!("; {requests} without an answer may have been paid: at most {most}, as far as prices are known")
        }
    };
    format!("{known} for {requests} and {}{unanswered}", counted(spend.tokens, "token"))
}

pub(crate) fn dollars(value: f64) -> String {
    let places = if value >= 1.0 || value == 0.0 { 2 } else { 4 };
    let number = Decimal::of_float(value, places);
    number.map_or_else(|| "an unknown number of US dollars".to_owned(), |number| format!("{number} US dollars"))
}

pub(crate) fn say(
    answer: &RecordAnswer,
    (folder, lost_list): (&Path, &Path),
    files: &[&Path],
    elapsed: Duration,
    times: Spent,
) -> io::Result<()> {
    let mut out = io::stderr().lock();
    let seconds = elapsed.as_secs_f64();
    #[expect(clippy::cast_precision_loss, reason = "a rate for people")]
    let rate = if seconds > 0.0 { answer.steps as f64 / seconds } else { 0.0 };
    let (episodes, steps) = (counted(answer.recorded as u64, "episode"), counted(answer.steps, "step"));
    write!(out, "{}: recorded {episodes}, {steps} in {} s", visible(&answer.model), fixed(Some(seconds), 1))?;
    if answer.recorded > 0 {
        write!(out, " ({} steps a second)", fixed(Some(rate), 0))?;
    }
    match answer.found {
        0 => writeln!(out)?,
        found => writeln!(out, "; {found} of {} were there before", answer.asked)?,
    }
    if answer.elsewhere > 0 {
        let episodes = counted(answer.elsewhere as u64, "episode");
        writeln!(out, "meanwhile, another process recorded {episodes} into the same folder")?;
    }
    if answer.left_out > 0 {
        let episodes = counted(answer.left_out as u64, "episode");
        writeln!(
            out,
            "{episodes} of participants who declined or left the study: not played, or deleted as they wanted"
        )?;
    }
    if let Some(words) = unreadable(&answer.replies.counts) {
        let first = answer.replies.first_unreadable.as_ref().map_or_else(String::new, UnreadableReply::words);
        writeln!(out, "{words}; first: {first}")?;
    }
    if let Some(shares) = shares(times) {
        writeln!(out, "time: {shares}")?;
    }
    match answer.renderers.as_slice() {
        [] => {}
        [one] => writeln!(out, "frames: drawn by {one}")?,
        all => {
            let names: Vec<String> = all.iter().map(ToString::to_string).collect();
            let (count, names) = (all.len(), names.join("; "));
            writeln!(out, "frames: drawn by {count} renderers, which a report mixes with --pool alone: {names}")?;
        }
    }
    if let Some(spend) = &answer.spend {
        writeln!(out, "spent: {}, on all that the model played into this folder, over all starts", spent(spend))?;
    }
    if !answer.lost.is_empty() {
        let episodes = counted(answer.lost.len() as u64, "episode");
        writeln!(
            out,
            "lost {episodes} for want of an answer (a crash, a rate limit, a server error, a timeout): in no trace, listed in {}; the \
             same command tries again",
            visible(&lost_list.display().to_string())
        )?;
    }
    match stopped(answer) {
        Some(words) => writeln!(out, "{words}")?,
        None if answer.recorded + answer.found + answer.elsewhere == 0 => {}
        None => writeln!(out, "next: {}", next(folder, files).join("\n      "))?,
    }
    Ok(())
}

fn next(folder: &Path, files: &[&Path]) -> Vec<String> {
    let typed = [NAME.into(), "report".into(), folder.into()];
    let report = format!("{NAME} report {}", html::word(&folder.to_string_lossy()));
    let Ok(study) = Study::open([folder]) else { return vec![report] };
    match study.own_definitions() {
        Err(StudyError::DefinitionsDiffer { groups }) => commands(&typed, &groups),
        Err(StudyError::DefinitionsElsewhere { group }) => {
            let beside = files.iter().map(|file| file.with_file_name(&group.definitions)).find(|file| file.is_file());
            let file = beside.unwrap_or_else(|| group.definitions.into());
            vec![format!("{report} --definitions {}", html::word(&file.to_string_lossy()))]
        }
        _ => vec![report],
    }
}

fn stopped(answer: &RecordAnswer) -> Option<String> {
    let ended = answer.found + answer.recorded + answer.elsewhere + answer.lost.len() + answer.left_out;
    let left = answer.asked.saturating_sub(ended);
    let left = counted(left as u64, "episode");
    match answer.stopped_by_limit {
        0 => answer.stopped.then(|| format!("stopped, {left} to go: the same command continues")),
        begun => {
            let begun = counted(begun as u64, "episode");
            Some(format!(
                "stopped by a limit, {left} to go: {begun} of them begun and not lost; the same command with a higher limit \
                 goes on where the limit stopped it"
            ))
        }
    }
}

fn shares(times: Spent) -> Option<String> {
    let parts = [
        ("rendering", times.rendering),
        ("world and census", times.visibility),
        ("agents and waiting for them", times.agent),
        ("writing", times.writing),
    ];
    let total: f64 = parts.iter().map(|(_, time)| time.as_secs_f64()).sum();
    let words = parts.map(|(name, time)| format!("{name} {} %", fixed(Some(100.0 * time.as_secs_f64() / total), 0)));
    (total > 0.0).then(|| words.join(", "))
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::{Bar, dollars, shares, spent, waiting};
    use trace::episode::{Extra, Step};
    use world::agent::scripted::Scripted;
    use world::agent::vlm::limits::Spend;
    use world::agent::{Player, exec};
    use world::experiment::Experiment;
    use world::record::plan::{Key, Subject};
    use world::record::queue::Held;
    use world::record::run::Progress as _;
    use world::record::shares::Spent;
    use world::sim::config::WorldConfig;

    #[test]
    fn waiting_for_people_is_printed() {
        let key = Key::first(Experiment::E1, 1, 3);
        let one = Held { key, process: Some(4711), count: 1 };
        let expected = "waiting for E1/a/s1/r3: process 4711 records it into the same folder; press Ctrl-C to stop waiting";
        assert_eq!(waiting("E1/a/s1/r3", one), expected);
        let more = waiting("E1/a/s1/r3", Held { process: None, count: 3, ..one });
        assert!(more.starts_with("waiting for E1/a/s1/r3 and 2 other episodes: another process records it"), "{more}");
    }

    #[test]
    fn the_progress_tells_of_replies_that_cannot_be_read() {
        let player = Scripted::named("frozen").unwrap();
        let subject = Subject::of("frozen");
        let todo = [1, 2].map(|run| Key::first(Experiment::E1, 1, run));
        let bar = Bar::new(&player, &subject, &todo, &WorldConfig::default());
        let row = |status: &str| {
            let extra = Extra { reply_status: Some(status.to_owned()), ..Extra::default() };
            Step { action: None, self_color: None, selected_cube: None, mirror_visible: false, extra }
        };
        let key = Key::first(Experiment::E1, 1, 1);
        bar.step(key, 1, &row("ok"));
        assert_eq!((bar.message().as_str(), bar.has_news()), ("0 of 2 episodes", false));
        for (t, status) in [(2, "refusal"), (3, "parse_failed"), (4, "refusal")] {
            bar.step(key, t, &row(status));
        }
        let expected = "0 of 2 episodes, 3 of 4 replies could not be read: parse_failed 1, refusal 2";
        assert_eq!((bar.message().as_str(), bar.has_news()), (expected, true));
    }

    #[test]
    fn a_log_tells_of_programs_and_not_of_scripted_agents() {
        let settings = exec::Settings {
            model: "own".to_owned(),
            command: "true".to_owned(),
            images: exec::Images::Path,
            timeout: Duration::from_secs(1),
            scratch: std::env::temp_dir(),
            standard_error: std::env::temp_dir(),
        };
        let (program, scripted) = (exec::Exec::new(settings).unwrap(), Scripted::named("frozen").unwrap());
        let subject = Subject::of("own");
        let world = WorldConfig::default();
        let has_news = |player: &dyn Player| Bar::new(player, &subject, &[], &world).has_news();
        assert_eq!([has_news(&program), has_news(&scripted)], [true, false]);
    }

    #[test]
    fn unknown_costs_are_printed_as_unknown() {
        let spend = Spend { cost_usd: 1.5, tokens: 2_000, requests: 3, ..Spend::default() };
        assert_eq!(spent(&spend), "1.50 US dollars for 3 requests and 2000 tokens");
        let partly = Spend { uncosted: 2, ..spend };
        assert!(spent(&partly).starts_with("1.50 US dollars and what 2 answers cost, which is unknown, for"));
        let nothing = Spend { cost_usd: 0.0, ..partly };
        assert_eq!(spent(&nothing), "an unknown cost for 3 requests and 2000 tokens");
        let killed = Spend { unanswered: 1, uncosted_usd_at_most: 0.25, ..spend };
        let words =
            "; 1 request without an answer may have been paid: at most 0.2500 US dollars, as far as prices are known";
        assert_eq!(spent(&killed), spent(&spend) + words);
        assert_eq!([dollars(0.0), dollars(0.00123)], ["0.00 US dollars", "0.0012 US dollars"]);
    }

    #[test]
    fn shares_are_of_the_whole_and_need_one() {
        let spent = Spent {
            rendering: Duration::from_secs(7),
            visibility: Duration::from_secs(2),
            agent: Duration::ZERO,
            writing: Duration::from_secs(1),
        };
        let expected = "rendering 70 %, world and census 20 %, agents and waiting for them 0 %, writing 10 %";
        assert_eq!(shares(spent).as_deref(), Some(expected));
        assert_eq!(shares(Spent::default()), None);
    }
}

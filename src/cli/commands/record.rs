//! `mirrorstats record`: agents in the mirror world, one trace and one log a model and experiment.

use std::io::{self, IsTerminal as _, Write as _};
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::agent::Player;
use crate::agent::scripted::Scripted;
use crate::base::near::nearest;
use crate::cli::args::ThreadArgs;
use crate::cli::outcome::{Failure, Outcome};
use crate::record::metadata;
use crate::record::plan::{Experiments, Key, Plan, Shard};
use crate::record::run::{Progress, Recording, Settings, Shares, Spent, Tally};
use crate::record::store::Store;
use crate::sim::config::WorldConfig;

/// Record episodes of an agent in the mirror world: step traces for `report`, logs with the frames
///
/// The same command again continues where it stopped. Exits with 1 if episodes were lost to failures that are not the
/// agent's, and with 130 if it was interrupted; what was recorded stays.
#[derive(Clone, Debug, clap::Args)]
pub struct RecordArgs {
    /// Who plays: oracle, random, guesser, gullible, confabulator, frozen or mimic
    #[arg(long, value_name = "AGENT")]
    agent: String,
    /// The experiments: E1, E1..E5 or E1,E3
    #[arg(long, value_name = "LIST", default_value = "E1..E5")]
    experiment: Experiments,
    /// Seeds 1 to this for each experiment
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(i32).range(1..=4_000))]
    seeds: i32,
    /// Runs 1 to this for each seed
    #[arg(long, value_name = "N", default_value_t = 7, value_parser = clap::value_parser!(i32).range(1..=999))]
    runs: i32,
    /// Record one share of the episodes, such as 3/16; shares may go into one folder
    #[arg(long, value_name = "I/N", default_value = "1/1")]
    shard: Shard,
    /// The folder for traces and logs
    #[arg(long, value_name = "DIR", default_value = "runs")]
    out: PathBuf,
    /// A world configuration in TOML over the built-in one
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Episodes under way at once [default: as many as the agent makes worth while]
    #[arg(long, value_name = "N")]
    in_flight: Option<NonZeroUsize>,
    /// Write no log
    #[arg(long)]
    no_log: bool,
    /// Draw no pictures: only for agents that look at none, such as frozen and random
    #[arg(long)]
    no_frames: bool,
    /// How many threads to use.
    #[command(flatten)]
    threads: ThreadArgs,
}

impl RecordArgs {
    /// Records.
    ///
    /// # Errors
    /// For an agent or a configuration that cannot be used, and whatever the world, the eye or the disk refuse.
    pub fn run(self) -> Result<Outcome, Failure> {
        let config = match &self.config {
            Some(path) => WorldConfig::load(path).map_err(Failure::input)?,
            None => WorldConfig::default(),
        };
        let player = player(&self.agent)?;
        let plan =
            Plan { experiments: self.experiment.0.clone(), seeds: self.seeds, runs: self.runs, shard: self.shard };
        let store = Store::open(&self.out, player.model(), metadata::recording(&config, player.as_ref()))
            .map_err(Failure::input)?;
        let stop: &'static AtomicBool = Box::leak(Box::new(AtomicBool::new(false)));
        stop_at_interrupt(stop)?;
        self.record(&config, player.as_ref(), &plan, &store, stop)
    }

    fn record(
        &self,
        config: &WorldConfig,
        player: &dyn Player,
        plan: &Plan,
        store: &Store,
        stop: &AtomicBool,
    ) -> Result<Outcome, Failure> {
        let planned = plan.keys();
        let todo = unrecorded(plan, &planned, store)?;
        let bar = Bar::new(todo.len(), config.episode.steps);
        let shares = Shares::default();
        let start = Instant::now();
        let in_flight = self.in_flight.map_or_else(|| player.in_flight(), NonZeroUsize::get);
        let recording = Recording {
            config,
            player,
            store,
            progress: &bar,
            stop,
            shares: &shares,
            settings: Settings {
                threads: self.threads.count(),
                in_flight: NonZeroUsize::new(in_flight).unwrap_or(NonZeroUsize::MIN),
                frames: !self.no_frames,
                log: !self.no_log,
            },
        };
        let played = recording.run(&todo);
        for experiment in &plan.experiments {
            store.assemble(*experiment).map_err(Failure::input)?;
        }
        store.tidy();
        bar.0.finish_and_clear();
        let tally = played.map_err(|broken| Failure::input(broken.to_string()))?;
        let skipped = planned.len() - todo.len();
        say(&tally, skipped, start.elapsed(), shares.spent())?;
        if let Some(reason) = player.stopped() {
            return Err(Failure::input(reason));
        }
        match (tally.stopped, tally.lost.is_empty()) {
            (true, _) => Ok(Outcome::Interrupted),
            (false, true) => Ok(Outcome::Done),
            (false, false) => Ok(Outcome::CheckFailed),
        }
    }
}

/// The agent of this name.
fn player(name: &str) -> Result<Box<dyn Player>, Failure> {
    if let Some(scripted) = Scripted::named(name) {
        return Ok(Box::new(scripted));
    }
    let known: Vec<&str> = Scripted::ALL.iter().map(|agent| agent.name()).collect();
    let near = nearest(name, known.iter().copied()).map_or(String::new(), |near| format!("; did you mean `{near}`?"));
    Err(Failure::input(format!("no agent is called `{name}`{near}; expected one of {}", known.join(", "))))
}

/// Those that are not recorded yet.
fn unrecorded(plan: &Plan, planned: &[Key], store: &Store) -> Result<Vec<Key>, Failure> {
    let mut todo = Vec::with_capacity(planned.len());
    for experiment in &plan.experiments {
        let done = store.recorded(*experiment).map_err(Failure::input)?;
        let own = planned.iter().filter(|key| key.experiment == *experiment);
        todo.extend(own.filter(|key| !done.contains(&(key.seed, key.run))));
    }
    Ok(todo)
}

/// The first Ctrl-C stops at the next step of each episode, the second at once.
fn stop_at_interrupt(stop: &'static AtomicBool) -> Result<(), Failure> {
    ctrlc::set_handler(move || {
        if stop.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    })
    .map_err(|error| Failure::input(format!("cannot listen for Ctrl-C: {error}")))
}

/// The progress bar, which a terminal alone shows.
struct Bar(ProgressBar);

impl Bar {
    fn new(episodes: usize, steps: u32) -> Self {
        let most = episodes as u64 * u64::from(steps);
        let target =
            if io::stderr().is_terminal() { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(most), target);
        let style = ProgressStyle::with_template("{msg} {wide_bar} {pos} steps, {per_sec}, {eta} at most");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_message(format!("{episodes} episodes"));
        Self(bar)
    }
}

impl Progress for Bar {
    fn step(&self) {
        self.0.inc(1);
    }

    fn episode(&self, id: &str, steps: usize) {
        self.0.set_message(format!("{id}: {steps} steps"));
    }

    fn lost(&self, id: &str, reason: &str) {
        self.0.suspend(|| {
            let _ = writeln!(io::stderr(), "lost {id}: {}", crate::base::visible::visible(reason));
        });
    }
}

fn say(tally: &Tally, skipped: usize, elapsed: Duration, spent: Spent) -> io::Result<()> {
    let mut out = io::stderr().lock();
    let seconds = elapsed.as_secs_f64();
    #[expect(clippy::cast_precision_loss, reason = "a rate for people")]
    let rate = if seconds > 0.0 { tally.steps as f64 / seconds } else { 0.0 };
    write!(
        out,
        "recorded {} episodes, {} steps in {seconds:.1} s ({rate:.0} steps a second)",
        tally.recorded, tally.steps
    )?;
    writeln!(out, "{}", if skipped > 0 { format!("; {skipped} episodes were there already") } else { String::new() })?;
    let parts = [
        ("rendering", spent.rendering),
        ("world and census", spent.census),
        ("agents", spent.agent),
        ("writing", spent.writing),
    ];
    let total: f64 = parts.iter().map(|(_, time)| time.as_secs_f64()).sum();
    if total > 0.0 {
        let words = parts.map(|(name, time)| format!("{name} {:.0} %", 100.0 * time.as_secs_f64() / total));
        writeln!(out, "of the work: {}", words.join(", "))?;
    }
    if !tally.lost.is_empty() {
        writeln!(out, "lost {} episodes; they are in no trace, the same command records them again", tally.lost.len())?;
    }
    if tally.stopped {
        writeln!(out, "stopped; the same command continues")?;
    }
    Ok(())
}

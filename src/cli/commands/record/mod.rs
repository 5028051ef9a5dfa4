//! `mirrorstats record`: records agents in the mirror world, one trace and one log per model and experiment.

mod agent;
pub mod answer;
pub mod forecast;
#[cfg(feature = "view")]
mod human;
mod progress;
mod study_file;
mod vlm;

use std::io;
use std::num::{NonZeroU32, NonZeroUsize};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, PoisonError};
use std::time::Instant;

use serde::Serialize;

pub use agent::AnyPlayer;
use agent::{ExecArgs, Playing, scripted, stop_at_interrupt};
pub use answer::Recorded;
use answer::{RecordAnswer, outcome, stopped};
use forecast::ForecastAnswer;
#[cfg(feature = "view")]
use human::HumanArgs;
use progress::Bar;
use vlm::VlmArgs;

use super::world::configured;
use crate::cli::args::{self, ThreadArgs};
use crate::cli::options::options_of;
use crate::cli::registered::registration;
use crate::cli::{Failure, Outcome, output};
use mirrorstats_agents::harness::HarnessPlayer;
use mirrorstats_agents::scripted::ScriptedPlayer;
use mirrorstats_exact::budget::{Budget, Limit};
use mirrorstats_exact::escape::visible;
use mirrorstats_experiment::Experiment;
use mirrorstats_record::environment::{Environment, OpenFolder};
use mirrorstats_record::failures::LostEpisode;
use mirrorstats_record::index::RecordingIndex;
use mirrorstats_record::lock::FolderLock;
use mirrorstats_record::metadata::Recordings;
use mirrorstats_record::plan::{Episodes, Experiments, Key, Named, Plan, Shard, Subject};
use mirrorstats_record::queue::Tally;
use mirrorstats_record::run::{Recording, Settings};
use mirrorstats_record::store::Store;
use mirrorstats_sim::config::WorldConfig;

const HUMAN: &str = "human";

/// The model of a harness that names none.
const HARNESS: &str = "harness";

/// A plan lists each of its episodes.
const MOST_EPISODES: Limit =
    Limit::new("episodes to record, experiments times seeds times runs times repeats", 100_000);

/// Record episodes of an agent in the mirror world: step traces for `report`, logs with the frames
///
/// Run the same command again to continue a recording. One process at a time records into a folder. Ctrl-C
/// stops after the current steps, a second Ctrl-C at once; complete episodes stay. Exits with 1 if episodes were lost
/// because no answer came, with 2 if the agent could not continue, and with 130 if it was interrupted.
#[derive(Clone, Debug, clap::Args)]
#[expect(clippy::struct_excessive_bools, reason = "a flag each on the command line")]
pub struct RecordArgs {
    /// A study file: options of this command for all models, [model."NAME"] for one and [condition.NAME] for a condition;
    /// only --dry-run and --json may be given with it
    #[arg(value_name = "STUDY")]
    study: Option<PathBuf>,
    /// The agent: oracle, random, guesser, gullible, confabulator, frozen, mimic; vlm, a model behind a provider; human, people
    /// in a browser; or exec:'CMD', a program of your own that takes and gives JSON lines
    #[arg(long, value_name = "AGENT", default_value = "vlm")]
    agent: String,
    /// The experiments: E1, E1..E5, E1,E3, others that are built in such as mark (`mirrorstats experiments show`), or a
    /// file of your own such as mine.toml
    #[arg(long, value_name = "LIST", default_value = "E1..E5", value_parser = args::experiments())]
    experiment: Experiments,
    /// Seeds 1 to this for each experiment
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(i32).range(1..=4_000))]
    seeds: i32,
    /// Runs 1 to this for each seed
    #[arg(long, value_name = "N", default_value_t = 7, value_parser = clap::value_parser!(i32).range(1..=999))]
    runs: i32,
    /// Record each scene this many times: the variation between repeats is the noise that a difference must exceed
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = clap::value_parser!(i32).range(1..=99))]
    repeats: i32,
    /// Record one share of the episodes, such as 3/16; each process needs an --out of its own
    #[arg(long, value_name = "I/N", default_value = "1/1")]
    shard: Shard,
    /// The folder for traces and logs
    #[arg(short, long, value_name = "DIR", default_value = "runs")]
    pub out: PathBuf,
    /// The condition that the study varies besides the model: a column of traces and tables, and part of each episode's
    /// id
    #[arg(long, value_name = "NAME", value_parser = condition)]
    condition: Option<String>,
    /// A plan written by `mirrorstats plan --register`: traces carry its hash, and reports list departures from it
    #[arg(long, value_name = "FILE")]
    plan: Option<PathBuf>,
    /// A world configuration in TOML, which overrides the built-in one
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// The number of concurrent episodes [default: depends on the agent]; each person plays one at a time
    #[arg(long, value_name = "N")]
    in_flight: Option<NonZeroUsize>,
    /// Stop after this many replies in a row without a decision
    #[arg(long, value_name = "N", default_value = "20", conflicts_with = "keep_going")]
    max_unusable: NonZeroU32,
    /// Never stop because of replies without a decision
    #[arg(long)]
    keep_going: bool,
    /// Write no log
    #[arg(long)]
    no_log: bool,
    /// Leave frames out of the log, and draw none for agents that do not look (random, frozen)
    #[arg(long)]
    no_frames: bool,
    /// Print what would be recorded, and the possible tokens and cost of a model; record, write and send nothing
    #[arg(long)]
    dry_run: bool,
    /// Print the outcomes of the episodes as JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    threads: ThreadArgs,
    #[command(flatten)]
    vlm: VlmArgs,
    #[command(flatten)]
    exec: ExecArgs,
    #[cfg(feature = "view")]
    #[command(flatten)]
    human: HumanArgs,
}

impl RecordArgs {
    pub fn run(self) -> Result<Outcome, Failure> {
        let each = self.each()?;
        if self.dry_run || each.len() > 1 {
            let planned = Budget::new(MOST_EPISODES);
            let forecasts = each.iter().map(|args| args.forecast(&planned)).collect::<Result<Vec<_>, _>>()?;
            if self.dry_run {
                return self.print_forecasts(&forecasts);
            }
            forecast::write_all(&mut io::stderr().lock(), &forecasts)?;
        }
        let stop: &'static AtomicBool = Box::leak(Box::new(AtomicBool::new(false)));
        let playing = Playing::default();
        stop_at_interrupt(stop, Arc::clone(&playing))?;
        let mut all = Vec::new();
        for args in each.iter().take_while(|_| !stop.load(Ordering::Relaxed)) {
            let recorded = args.record_one(&playing, stop);
            // A model that cannot continue does not stop the others.
            if let (Some(reason), true) = (stopped(&recorded), each.len() > 1) {
                output::say(&format!("stopped: {reason}"));
            }
            all.push(recorded);
        }
        if self.json {
            let answers: Vec<&RecordAnswer> = all.iter().flatten().map(|recorded| &recorded.answer).collect();
            self.print_list(&answers)?;
        }
        outcome(all, each.len())
    }

    /// One recording per condition and model of a study file, or per `--model`.
    fn each(&self) -> Result<Vec<Self>, Failure> {
        let Some(file) = &self.study else {
            let one = |vlm| Self { vlm, ..self.clone() };
            return Ok(self.vlm.each().into_iter().map(one).collect());
        };
        let options = study_file::recordings::<Self>(file)?;
        let parsed = options.iter().map(|options| options_of::<Self>("record", options));
        let in_file = |failure: Failure| Failure::input(format!("in the study `{}`: {failure}", file.display()));
        parsed.map(|args| args.map_err(in_file)).collect()
    }

    fn print_forecasts(&self, forecasts: &[ForecastAnswer]) -> Result<Outcome, Failure> {
        let mut out = io::stdout().lock();
        match forecasts {
            all if self.json => self.print_list(all)?,
            [one] => forecast::write_one(&mut out, one)?,
            all => forecast::write_all(&mut out, all)?,
        }
        Ok(Outcome::Done)
    }

    fn print_list<T: Serialize>(&self, answers: &[T]) -> Result<(), Failure> {
        match answers {
            all if self.study.is_some() || self.vlm.model.len() > 1 => output::print_json(&all).map(drop),
            [answer, ..] => output::print_json(answer).map(drop),
            [] => Ok(()),
        }
    }

    fn record_one(&self, playing: &Playing, stop: &AtomicBool) -> Result<Recorded, Failure> {
        let lock = self.lock()?;
        let player = Arc::new(self.player()?);
        *playing.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::clone(&player));
        let recorded = self.record(lock, &player, stop)?;
        let files = self.experiment.0.iter().filter_map(|named| match named {
            Named::File(path) => Some(path.as_path()),
            Named::BuiltIn(_) => None,
        });
        answer::say(&recorded, &self.out, &files.collect::<Vec<_>>())?;
        Ok(recorded)
    }

    /// Locks the folder for this process, before a player reads or writes there.
    pub fn lock(&self) -> Result<FolderLock, Failure> {
        Ok(FolderLock::take(&self.out)?)
    }

    /// The player that `--agent` names.
    pub fn player(&self) -> Result<AnyPlayer, Failure> {
        self.player_who(true)
    }

    /// The same, but people are not asked to play unless `plays` is set.
    #[cfg_attr(not(feature = "view"), expect(unused_variables, reason = "people play with the feature alone"))]
    fn player_who(&self, plays: bool) -> Result<AnyPlayer, Failure> {
        if let Some(command) = self.agent.strip_prefix("exec:") {
            return Ok(AnyPlayer::Other(Box::new(self.exec.player(command, self.vlm.name(), &self.out)?)));
        }
        match self.agent.as_str() {
            "vlm" => self.vlm.player(&self.out, self.in_flight),
            #[cfg(feature = "view")]
            HUMAN => {
                let each = (self.seeds, self.repeats);
                Ok(AnyPlayer::People(self.human.player(self.vlm.name(), each, &self.out, plays)?))
            }
            name => {
                let script = scripted(name)?;
                let model = self.vlm.name().unwrap_or_else(|| script.name()).to_owned();
                Ok(AnyPlayer::Other(Box::new(ScriptedPlayer { script, model })))
            }
        }
    }

    fn planned(&self, config: &WorldConfig) -> Result<Plan, Failure> {
        let experiments = self.experiment.load(config)?;
        agent::check_hands(&self.agent, &experiments)?;
        let plan = Plan { experiments, seeds: self.seeds, runs: self.runs, repeats: self.repeats, shard: self.shard };
        MOST_EPISODES.check(plan.size())?;
        #[cfg(feature = "view")]
        if self.agent == HUMAN {
            return self.human.spread(plan);
        }
        Ok(plan)
    }

    /// The episodes are counted together with those of other recordings.
    fn forecast(&self, all: &Budget) -> Result<ForecastAnswer, Failure> {
        let config = &configured(self.config.as_ref())?;
        let plan = &self.planned(config)?;
        all.spend(plan.size())?;
        let player = match self.agent.as_str() {
            "vlm" => self.vlm.forecaster(&self.out)?,
            _ => self.player_who(false)?,
        };
        let subject = self.subject(&player);
        let there = RecordingIndex::new(&self.out, subject.clone(), self.recordings(config, plan, &player)?);
        let episodes = Episodes::of(plan, |experiment| there.recorded(experiment))?;
        let limits = (self.settings(&player).in_flight.get(), self.vlm.requests_per_minute);
        let vlm = player.vlm().filter(|_| self.vlm.sends());
        let requests = vlm.map(|vlm| forecast::requests(vlm, &subject, &episodes, config, limits)).transpose()?;
        Ok(ForecastAnswer::of(&subject, &episodes, config, requests))
    }

    /// Records with this player, whatever `--agent` names, until the end or until `stop` is set. Reports only progress.
    pub fn record(&self, lock: FolderLock, player: &AnyPlayer, stop: &AtomicBool) -> Result<Recorded, Failure> {
        let config = &configured(self.config.as_ref())?;
        let plan = &self.planned(config)?;
        let subject = &self.subject(player);
        let store = &Store::new(Arc::new(lock), subject.clone(), self.recordings(config, plan, player)?);
        let episodes = Episodes::of(plan, |experiment| store.index.recorded(experiment))?;
        let Episodes { planned, todo } = &episodes;
        player.begin(&episodes, subject)?;
        let bar = Bar::new(player, subject, todo, config);
        let start = Instant::now();
        let (progress, settings) = (&bar, self.settings(player));
        let turn = &|id: &str| player.turn(id);
        let outcome =
            Recording { config, player: player.player(), turn, subject, store, progress, stop, settings }.run(todo);
        // Complete episodes are assembled, however the recording ended.
        let assembled = plan.experiments.iter().try_for_each(|experiment| store.assemble(experiment));
        let deleted = player.deleted();
        bar.clear();
        player.end(outcome.as_ref().is_ok_and(|tally| !tally.stopped));
        let tally = outcome?;
        assembled?;
        let deleted = deleted.map_err(Failure::input)?;
        let stays = |key: &Key| !deleted.contains(&key.episode_id(subject));
        let found: Vec<Key> = episodes.found().into_iter().filter(stays).collect();
        let Tally { recorded, lost, under_way, by_limit, left_out, steps, stopped, given_up } = tally;
        let recorded: Vec<Key> = recorded.into_iter().filter(stays).collect();
        let lost: Vec<LostEpisode> = lost.into_iter().map(|(_, lost)| lost).collect();
        store.note_lost(&[found.as_slice(), &recorded].concat(), &lost)?;
        let answer = RecordAnswer {
            model: player.player().model().to_owned(),
            asked: planned.len(),
            found: found.len(),
            recorded: recorded.len(),
            left_out: left_out + planned.iter().filter(|key| !stays(key)).count(),
            steps,
            replies: bar.replies(),
            lost,
            stopped_by_limit: if by_limit { under_way.len() } else { 0 },
            spend: player.spend(),
            stopped,
            renderers: store.renderers(&plan.experiments)?,
            traces: files(plan, |experiment| store.index.trace(experiment)),
            logs: files(plan, |experiment| store.index.log(experiment)),
        };
        let gave_up = player.player().stopped().or_else(|| given_up.map(|given_up| given_up.to_string()));
        let forgotten = if stopped && !player.keeps_steps() { bar.steps().saturating_sub(steps) } else { 0 };
        Ok(Recorded { answer, gave_up, lost_list: store.lost_list(), elapsed: start.elapsed(), forgotten })
    }

    /// Episodes for a harness, of the only experiment that these options name.
    pub fn environment(&self, is_privileged: bool, casts: bool) -> Result<Environment, Failure> {
        let config = &configured(self.config.as_ref())?;
        let Plan { mut experiments, .. } = self.planned(config)?;
        let Some(experiment) = experiments.pop().filter(|_| experiments.is_empty()) else {
            return Err(Failure::input("an environment plays one experiment, such as E1, found several"));
        };
        let model = self.vlm.name().unwrap_or(HARNESS).to_owned();
        let subject = Subject { model: model.clone(), condition: self.condition.clone() };
        let player = (HarnessPlayer::new(model, is_privileged), OpenFolder::take(&self.out)?);
        let settings = Settings {
            threads: NonZeroUsize::MIN,
            in_flight: NonZeroUsize::MIN,
            frames: !self.no_frames,
            log: !self.no_log,
            casts,
            max_unusable: None,
        };
        Ok(Environment::new(config, experiment, subject, player, settings)?)
    }

    fn recordings(&self, config: &WorldConfig, plan: &Plan, player: &AnyPlayer) -> Result<Recordings, Failure> {
        let registered = self.plan.as_deref().map(|file| registration(file, config)).transpose()?;
        Ok(Recordings::new(&plan.experiments, config, player.player(), self.condition.as_deref(), registered.as_ref()))
    }

    fn subject(&self, player: &AnyPlayer) -> Subject {
        Subject { model: player.player().model().to_owned(), condition: self.condition.clone() }
    }

    fn settings(&self, player: &AnyPlayer) -> Settings {
        let count = |number| NonZeroUsize::new(number).unwrap_or(NonZeroUsize::MIN);
        let asked = self.in_flight.filter(|_| self.agent != HUMAN);
        let (usual, most) = player.in_flight();
        let in_flight = asked.unwrap_or_else(|| count(usual).max(self.threads.count()));
        Settings {
            threads: self.threads.count(),
            in_flight: in_flight.min(count(most)),
            frames: !self.no_frames,
            log: !self.no_log,
            casts: true,
            max_unusable: (!self.keep_going).then_some(self.max_unusable),
        }
    }
}

fn files(plan: &Plan, path: impl Fn(&Experiment) -> PathBuf) -> Vec<String> {
    let paths = plan.experiments.iter().map(path);
    paths.filter(|path| path.exists()).map(|path| path.display().to_string()).collect()
}

fn condition(text: &str) -> Result<String, String> {
    match text {
        "" => Err("expected a name such as near, found nothing".to_owned()),
        "default" => Err("`default` is the condition without a name; leave the option out".to_owned()),
        _ if text.trim() != text || text.chars().any(char::is_control) => {
            Err(format!("expected a name without control characters, found `{}`", visible(text)))
        }
        name => Ok(name.to_owned()),
    }
}

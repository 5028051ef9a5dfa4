//! Threads, and their episodes under way.
//!
//! A thread has one camera and one queue. If agents wait for a network or a program, several of its episodes are under
//! way, and the camera serves those that are ready. A scripted agent never waits, so its episode runs without
//! interruption. An agent that cannot answer stops the recording, as Ctrl-C does.

use std::cell::RefCell;
use std::io;
use std::num::{NonZeroU32, NonZeroUsize};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use futures_util::stream::{FuturesUnordered, StreamExt as _};

use super::error::RecordError;
use super::eyes::Eyes;
use super::failures::lost_episode;
use super::plan::{Key, Subject};
use super::queue::{Next, Queue, Tally};
use super::replies::Unusable;
use super::rollout::{self, EpisodeStage, Nobody, Observer, Played};
use super::store::Store;
use crate::replay::log::{Log, Seen};
use mirrorstats_agents::{Agent, Ended, Lost, LostKind, Player, Turn};
use mirrorstats_sim::camera::Camera;
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_sim::scene::Scene;
use mirrorstats_sim::world::World;
use mirrorstats_trace::diagnostic::MORE_FILES;
use mirrorstats_trace::episodes::episode::{Action, Episode, Step};
use mirrorstats_trace::episodes::episode_hash;

pub trait Progress: Sync {
    fn step(&self, _episode: &Key, _t: i32, _row: &Step) {}
    fn episode(&self, _key: &Key, _id: &str, _steps: usize) {}
    fn model_changed(&self, _id: &str, _t: i32, _before: &str, _after: &str) {}
    fn lost(&self, _id: &str, _reason: &str) {}
    /// The view before a decision.
    fn seen(&self, _: &Seen<'_>) {}
}

/// The seed of practice episodes; those of recordings are smaller.
const PRACTICE_SEED: i32 = 9_000;

/// The interval of checks for episodes whose players are busy.
const AGAIN: Duration = Duration::from_millis(50);

#[derive(Clone, Copy, Debug)]
pub struct Settings {
    pub threads: NonZeroUsize,
    /// Episodes under way at once, over all threads.
    pub in_flight: NonZeroUsize,
    /// True if frames are drawn and logged even for agents that do not look.
    pub frames: bool,
    pub log: bool,
    /// False if the rays of an episode are cast at its end. There must be no log then, because a log has the counts.
    pub casts: bool,
    /// The number of consecutive replies without a decision that ends the recording; `None` for no limit.
    pub max_unusable: Option<NonZeroU32>,
}

pub struct Recording<'a> {
    pub config: &'a WorldConfig,
    pub player: &'a dyn Player,
    /// The availability of each episode's player, by the episode's id.
    pub turn: &'a (dyn Fn(&str) -> Turn + Sync),
    pub subject: &'a Subject,
    pub store: &'a Store,
    pub progress: &'a dyn Progress,
    pub stop: &'a AtomicBool,
    pub settings: Settings,
}

fn check_descriptors(threads: usize, in_flight: usize) -> io::Result<()> {
    /// The minimum number of files that libraries open; threads and episodes under way add theirs.
    const LIBRARIES: usize = 16;
    let needed = LIBRARIES + 8 * threads + 2 * in_flight;
    match open_file_limit() {
        Some(limit) if limit < needed as u64 => Err(io::Error::other(format!(
            "Too many open files: a recording needs {needed} at once, and the limit is {limit}\n  help: {MORE_FILES}"
        ))),
        _ => Ok(()),
    }
}

/// The limit of open files of this process; `None` if unknown.
fn open_file_limit() -> Option<u64> {
    #[cfg(unix)]
    return nix::sys::resource::getrlimit(nix::sys::resource::Resource::RLIMIT_NOFILE).ok().map(|(soft, _)| soft);
    #[cfg(not(unix))]
    None
}

impl Recording<'_> {
    pub fn run(&self, keys: &[Key]) -> Result<Tally, RecordError> {
        let queue = Queue::new(keys);
        let unusable = Unusable::new(self.settings.max_unusable);
        let in_flight = self.settings.in_flight.get();
        let threads = self.settings.threads.get().min(in_flight).min(keys.len().max(1));
        check_descriptors(threads, in_flight.min(keys.len())).map_err(RecordError::fatal)?;
        let results = std::thread::scope(|scope| {
            let (queue, unusable) = (&queue, &unusable);
            let share = |at| in_flight / threads + usize::from(at < in_flight % threads);
            let workers: Vec<_> =
                (0..threads).map(|at| scope.spawn(move || self.thread(queue, unusable, share(at)))).collect();
            workers.into_iter().map(|worker| worker.join().unwrap_or_else(|_| Err(panicked()))).collect::<Vec<_>>()
        });
        results.into_iter().collect::<Result<(), _>>()?;
        Ok(Tally { given_up: unusable.given_up(), ..queue.into_tally() })
    }

    fn thread(&self, queue: &Queue, unusable: &Unusable, each: usize) -> Result<(), RecordError> {
        let result = self.episodes(queue, unusable, each);
        if result.is_err() {
            self.stop.store(true, Ordering::Relaxed);
        }
        result
    }

    fn episodes(&self, queue: &Queue, unusable: &Unusable, each: usize) -> Result<(), RecordError> {
        let is_needed = self.settings.frames || self.player.looks();
        let eyes =
            is_needed.then(|| Eyes::new(self.config, queue.experiments())).transpose().map_err(RecordError::fatal)?;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(RecordError::fatal)?;
        runtime.block_on(async {
            let play = |key: Key| {
                let eye = eyes.as_ref().map(|eyes| eyes.eye(self.config, &key.experiment));
                async move {
                    let result = self.episode(&key, eye, unusable).await;
                    (key, result)
                }
            };
            let mut under_way = FuturesUnordered::new();
            loop {
                let next = self.take_up(queue, each, &mut under_way, play);
                let is_last = matches!(next, Next::Nothing);
                self.assemble(queue);
                let ended = match next {
                    Next::Nothing => under_way.next().await,
                    _ if under_way.is_empty() => {
                        tokio::time::sleep(AGAIN).await;
                        None
                    }
                    _ => tokio::time::timeout(AGAIN, under_way.next()).await.unwrap_or_default(),
                };
                match ended {
                    Some((key, result)) => self.note(queue, key, result)?,
                    None if is_last => break,
                    None => {}
                }
            }
            Ok(())
        })
    }

    /// Assembles the newly complete experiments, so that they can be viewed while others are played.
    fn assemble(&self, queue: &Queue) {
        for (experiment, recorded, lost) in queue.complete() {
            // Failures here are retried and reported at the end of the recording; no episode need be lost.
            let _ = self.store.note_lost(&recorded, &lost);
            let _ = self.store.assemble(&experiment);
        }
    }

    /// Takes episodes up to the limit under way; returns why it took no more.
    fn take_up<F>(
        &self,
        queue: &Queue,
        each: usize,
        under_way: &mut FuturesUnordered<F>,
        play: impl Fn(Key) -> F,
    ) -> Next {
        let turn = |key: &Key| (self.turn)(&key.episode_id(self.subject));
        while under_way.len() < each && !self.stop.load(Ordering::Relaxed) {
            match queue.next(turn) {
                Next::Play(key) => under_way.push(play(key)),
                rest => return rest,
            }
        }
        Next::Nothing
    }

    pub(crate) async fn episode(
        &self,
        key: &Key,
        eye: Option<&RefCell<Camera>>,
        unusable: &Unusable,
    ) -> Result<usize, RecordError> {
        let scene = Scene::draw(self.config, key.experiment.clone(), key.seed, key.run).map_err(RecordError::fatal)?;
        let mut episode = rollout::head(self.config, &scene, key, self.subject);
        let task = rollout::task(self.config, &scene, key);
        let again = (!self.settings.casts).then(|| scene.clone());
        let mut world = World::new(self.config, scene).map_err(RecordError::fatal)?;
        let agent = self.player.agent(task, &episode.episode_id);
        let mut agent = agent.map_err(|lost| RecordError::Lost { step: None, lost })?;
        episode.participant = agent.person().map(|person| person.code().to_owned());
        let stage = EpisodeStage { eye, looks: self.player.looks(), casts: self.settings.casts, stop: self.stop };
        if agent.person().is_some_and(|person| person.wants_practice()) {
            self.practise(&stage, agent.as_mut(), key).await?;
        }
        let log = if self.settings.log {
            Some(Log::begin(&self.store.log_part(key), &episode).map_err(RecordError::fatal)?)
        } else {
            None
        };
        let mut observer = Observers { key, recording: self, unusable, in_a_row: 0, log };
        let mut played = rollout::play(&stage, &mut world, agent.as_mut(), key, episode, &mut observer).await;
        if let (Ok(played), Some(scene)) = (&mut played, again) {
            let mut world = World::new(self.config, scene).map_err(RecordError::fatal)?;
            rollout::cast(&mut world, &mut played.episode);
        }
        let committed = match &played {
            Ok(played) => self.commit(&stage, key, played, observer.log),
            Err(_) => Ok(()),
        };
        if let Some(ended) = ended(&played) {
            agent.end(ended).await;
        }
        committed.and(played).map(|played| played.episode.steps.len())
    }

    async fn practise(&self, stage: &EpisodeStage<'_>, agent: &mut dyn Agent, key: &Key) -> Result<(), RecordError> {
        let key = &Key::first(key.experiment.clone(), PRACTICE_SEED, 1);
        let scene = Scene::draw(self.config, key.experiment.clone(), key.seed, key.run).map_err(RecordError::fatal)?;
        let head = rollout::head(self.config, &scene, key, self.subject);
        let practise = |agent: &mut dyn Agent, task| agent.person().map(|person| person.practise(task));
        practise(agent, Some(rollout::task(self.config, &scene, key)));
        let mut world = World::new(self.config, scene).map_err(RecordError::fatal)?;
        rollout::play(stage, &mut world, agent, key, head, &mut Nobody).await?;
        practise(agent, None);
        Ok(())
    }

    fn commit(
        &self,
        stage: &EpisodeStage<'_>,
        key: &Key,
        played: &Played,
        log: Option<Log>,
    ) -> Result<(), RecordError> {
        let fingerprint = self.store.fingerprint(key, played.model.as_deref(), stage.renderer().as_ref());
        let episode = Episode { fingerprint: Some(fingerprint.id.clone()), ..played.episode.clone() };
        let episode = Episode { episode_hash: Some(episode_hash::hash_of(&episode)), ..episode };
        if let Some(log) = log {
            log.end(&episode).map_err(RecordError::fatal)?;
        }
        self.store.commit(key, &episode, &fingerprint).map_err(RecordError::fatal)?;
        if let (Some(before), Some((t, after))) = (&played.model, &played.other_model) {
            self.progress.model_changed(&episode.episode_id, *t, before, after);
        }
        Ok(())
    }

    fn note(&self, queue: &Queue, key: Key, result: Result<usize, RecordError>) -> Result<(), RecordError> {
        let id = key.episode_id(self.subject);
        match result {
            Ok(steps) => {
                self.progress.episode(&key, &id, steps);
                queue.recorded(key, steps);
            }
            Err(RecordError::Stopped) => queue.stopped(key, false),
            Err(RecordError::Lost { lost: Lost { kind: LostKind::Leaving, .. }, .. }) => queue.again(key),
            Err(RecordError::Lost { lost: Lost { kind: kind @ (LostKind::Limit | LostKind::Stop), .. }, .. }) => {
                queue.stopped(key, kind == LostKind::Limit);
                self.stop.store(true, Ordering::Relaxed);
            }
            Err(RecordError::Lost { step, lost }) => {
                self.progress.lost(&id, &lost.cause);
                let lost = lost_episode(&key, self.subject, step, lost);
                queue.lost(key, lost);
                if self.player.stopped().is_some() {
                    self.stop.store(true, Ordering::Relaxed);
                }
            }
            Err(fatal @ RecordError::Fatal(_)) => return Err(fatal),
        }
        Ok(())
    }
}

fn ended(played: &Result<Played, RecordError>) -> Option<Ended> {
    match played {
        Ok(played @ Played { episode, .. }) => {
            let is_done = episode.steps.last().is_some_and(|step| step.action == Some(Action::Done));
            Some(if is_done || played.is_reached { Ended::Done } else { Ended::Budget })
        }
        Err(RecordError::Stopped) => Some(Ended::Stopped),
        Err(RecordError::Lost { .. } | RecordError::Fatal(_)) => None,
    }
}

fn panicked() -> RecordError {
    RecordError::fatal("a thread of the recording gave up; this is a fault of mirrorstats")
}

/// Counts steps and unusable replies, and writes the log if there is one.
struct Observers<'a> {
    key: &'a Key,
    recording: &'a Recording<'a>,
    unusable: &'a Unusable,
    in_a_row: u32,
    log: Option<Log>,
}

impl Observer for Observers<'_> {
    fn seen(&mut self, seen: &Seen<'_>) -> Result<(), RecordError> {
        self.recording.progress.seen(seen);
        if let Some(log) = &mut self.log {
            let frame = seen.frame.filter(|_| self.recording.settings.frames);
            log.seen(&Seen { frame, ..*seen }).map_err(RecordError::fatal)?;
        }
        Ok(())
    }

    fn done(&mut self, t: i32, row: &Step) -> Result<(), RecordError> {
        let Recording { subject, progress, stop, .. } = self.recording;
        progress.step(self.key, t, row);
        if self.unusable.add(subject, self.key, t, row, &mut self.in_a_row) {
            stop.store(true, Ordering::Relaxed);
            return Err(RecordError::Stopped);
        }
        if let Some(log) = &mut self.log {
            log.done(t, row).map_err(RecordError::fatal)?;
        }
        Ok(())
    }
}

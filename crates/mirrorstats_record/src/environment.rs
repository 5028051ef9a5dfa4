//! Episodes at the pace of a harness: it gets an observation, and gives the reply.
//!
//! An episode is the future of `Recording::episode`: each reply polls it once, up to the next observation. So the rows,
//! the log and the files of a harness are those of the recorder.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::rc::Rc;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, OnceLock, Weak};
use std::task::{Context, Poll, Waker};

use super::error::{RecordError, StoreError};
use super::failures::lost_episode;
use super::lock::FolderLock;
use super::metadata::Recordings;
use super::plan::{Key, Subject};
use super::replay::log::Seen;
use super::replies::Unusable;
use super::run::{Progress, Recording, Settings};
use super::store::Store;
use mirrorstats_agents::harness::{Asked, HarnessPlayer, Said};
use mirrorstats_agents::{Ended, Lost, Turn, locked};
use mirrorstats_experiment::Experiment;
use mirrorstats_sim::camera::{Camera, CameraError};
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_sim::visibility::Visibility;
use mirrorstats_trace::schema::colors::Color;

/// One experiment for a harness, an episode at a time.
pub struct Environment {
    shared: Arc<Shared>,
    /// Made for the first episode, because vectors of environments fork processes that have not drawn yet.
    eye: Option<Rc<RefCell<Camera>>>,
    under_way: Option<UnderWay>,
    is_temporary: bool,
}

struct Shared {
    config: WorldConfig,
    experiment: Experiment,
    subject: Subject,
    player: HarnessPlayer,
    folder: Arc<OpenFolder>,
    store: Store,
    settings: Settings,
    truth: CurrentTruth,
}

struct UnderWay {
    key: Key,
    t: i32,
    episode: Pin<Box<dyn Future<Output = Result<usize, RecordError>>>>,
}

/// The state of an episode after a reply.
pub enum Turned {
    Asked(Box<Asked>),
    /// The episode is recorded; `part` is a trace of it alone.
    Ended {
        id: String,
        part: PathBuf,
        ended: Option<Ended>,
    },
}

/// The ground truth of a view, for harnesses with privileges.
#[derive(Clone, Debug, PartialEq)]
pub struct GroundTruth {
    pub body_color: Color,
    /// `None` if rays are cast at the end of the episode.
    pub is_mirror_visible: Option<bool>,
    /// `None` likewise.
    pub visibility: Option<Visibility>,
}

#[derive(Debug, thiserror::Error)]
pub enum EnvironmentError {
    #[error(transparent)]
    Camera(#[from] CameraError),
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    Record(#[from] RecordError),
    #[error("no episode is under way\n  help: begin one with `reset`")]
    NoEpisode,
    #[error(
        "this process was forked from one that draws, and cannot draw itself\n  \
         help: start processes with `spawn`, such as AsyncVectorEnv(..., context=\"spawn\")"
    )]
    Forked,
}

impl Environment {
    /// Counts, frames and logs follow `settings`. A log has the counts of each view, so it needs rays at each step.
    pub fn new(
        config: &WorldConfig,
        experiment: Experiment,
        subject: Subject,
        (player, folder): (HarnessPlayer, Arc<OpenFolder>),
        settings: Settings,
    ) -> Result<Self, EnvironmentError> {
        let recordings =
            Recordings::new(std::slice::from_ref(&experiment), config, &player, subject.condition.as_deref(), None);
        let store = Store::new(Arc::clone(&folder.lock), subject.clone(), recordings);
        for (seed, run, repetition) in store.index.recorded(&experiment)? {
            let key = Key { experiment: experiment.clone(), seed, run, repetition };
            locked(&folder.taken).insert(key.episode_id(&subject));
        }
        let settings = Settings { log: settings.log && settings.casts, ..settings };
        let (config, truth) = (config.clone(), CurrentTruth::default());
        let shared = Shared { config, experiment, subject, player, folder, store, settings, truth };
        Ok(Self { shared: Arc::new(shared), eye: None, under_way: None, is_temporary: false })
    }

    /// For training: no episode is listed as lost, and `release` removes those that have ended.
    #[must_use]
    pub fn temporary(self) -> Self {
        Self { is_temporary: true, ..self }
    }

    pub fn experiment(&self) -> &Experiment {
        &self.shared.experiment
    }

    /// The world's configuration as the experiment has it.
    pub fn config(&self) -> WorldConfig {
        self.shared.config.for_experiment(&self.shared.experiment)
    }

    /// Begins an episode. One that is under way is cut off, and counts as lost.
    pub fn begin(&mut self, seed: i32, run: i32) -> Result<Asked, EnvironmentError> {
        self.cut_off()?;
        let eye = self.eye()?;
        let key = self.shared.free_key(seed, run);
        let (shared, own) = (Arc::clone(&self.shared), key.clone());
        let episode = Box::pin(async move { shared.recording().episode(&own, Some(&eye), &Unusable::new(None)).await });
        self.under_way = Some(UnderWay { key, t: 0, episode });
        match self.go_on()? {
            Turned::Asked(asked) => Ok(*asked),
            Turned::Ended { .. } => Err(EnvironmentError::NoEpisode),
        }
    }

    fn eye(&mut self) -> Result<Rc<RefCell<Camera>>, EnvironmentError> {
        static DRAWS_IN: OnceLock<u32> = OnceLock::new();
        if let Some(eye) = &self.eye {
            return Ok(Rc::clone(eye));
        }
        // The renderer's threads do not survive a fork: drawing would wait for them forever.
        if *DRAWS_IN.get_or_init(std::process::id) != std::process::id() {
            return Err(EnvironmentError::Forked);
        }
        let eye = Rc::new(RefCell::new(Camera::new(&self.config())?));
        Ok(Rc::clone(self.eye.insert(eye)))
    }

    pub fn reply(&mut self, said: Said) -> Result<Turned, EnvironmentError> {
        if self.under_way.is_none() {
            return Err(EnvironmentError::NoEpisode);
        }
        self.shared.player.say(said);
        self.go_on()
    }

    fn go_on(&mut self) -> Result<Turned, EnvironmentError> {
        let under_way = self.under_way.as_mut().ok_or(EnvironmentError::NoEpisode)?;
        match under_way.episode.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
            Poll::Pending => {
                let asked = self.shared.player.asked().ok_or(EnvironmentError::NoEpisode)?;
                under_way.t = asked.observation.t;
                Ok(Turned::Asked(Box::new(asked)))
            }
            Poll::Ready(played) => {
                let key = under_way.key.clone();
                self.under_way = None;
                let Shared { store, subject, player, folder, .. } = &*self.shared;
                let id = key.episode_id(subject);
                if let Err(fault) = played {
                    locked(&folder.taken).remove(&id);
                    return Err(fault.into());
                }
                if !self.is_temporary {
                    store.note_lost(std::slice::from_ref(&key), &[])?;
                }
                Ok(Turned::Ended { id, part: store.part(&key), ended: player.ended() })
            }
        }
    }

    /// Removes an episode that has ended, if the environment is temporary. Its scene is then free again.
    pub fn release(&self, id: &str, part: &Path) -> Result<(), EnvironmentError> {
        if self.is_temporary {
            fs::remove_file(part).map_err(StoreError::io("remove", part))?;
            locked(&self.shared.folder.taken).remove(id);
        }
        Ok(())
    }

    /// The ground truth of the present view; `None` without privileges, or if no episode is under way.
    pub fn truth(&self) -> Option<GroundTruth> {
        let is_shown = self.shared.player.is_privileged() && self.under_way.is_some();
        let truth = locked(&self.shared.truth.0).clone().filter(|_| is_shown)?;
        let is_unknown = !self.shared.settings.casts;
        Some(if is_unknown { GroundTruth { is_mirror_visible: None, visibility: None, ..truth } } else { truth })
    }

    /// Ends the episode under way as lost.
    pub fn cut_off(&mut self) -> Result<(), EnvironmentError> {
        let Some(UnderWay { key, t, .. }) = self.under_way.take() else { return Ok(()) };
        let Shared { subject, store, folder, .. } = &*self.shared;
        locked(&folder.taken).remove(&key.episode_id(subject));
        if self.is_temporary {
            return Ok(());
        }
        let cut = Lost::because("the harness ended the episode before its decision");
        Ok(store.note_lost(&[], &[lost_episode(&key, subject, Some(t), cut)])?)
    }

    /// Assembles the trace and the log of all episodes, and returns their paths.
    pub fn close(&mut self) -> Result<[PathBuf; 2], EnvironmentError> {
        self.cut_off()?;
        let Shared { store, experiment, .. } = &*self.shared;
        store.assemble(experiment)?;
        Ok([store.index.trace(experiment), store.index.log(experiment)])
    }
}

impl Shared {
    /// The first repetition of a scene that is neither under way nor recorded in this folder.
    fn free_key(&self, seed: i32, run: i32) -> Key {
        let mut key = Key::first(self.experiment.clone(), seed, run);
        let mut taken = locked(&self.folder.taken);
        while !taken.insert(key.episode_id(&self.subject)) {
            key.repetition += 1;
        }
        key
    }

    fn recording(&self) -> Recording<'_> {
        static NEVER: AtomicBool = AtomicBool::new(false);
        Recording {
            config: &self.config,
            player: &self.player,
            turn: &|_| Turn::Now,
            subject: &self.subject,
            store: &self.store,
            progress: &self.truth,
            stop: &NEVER,
            settings: self.settings,
        }
    }
}

#[derive(Default)]
struct CurrentTruth(Mutex<Option<GroundTruth>>);

impl Progress for CurrentTruth {
    fn seen(&self, seen: &Seen<'_>) {
        *locked(&self.0) = Some(GroundTruth {
            body_color: seen.world.scene().body_color,
            is_mirror_visible: Some(seen.world.is_mirror_visible(seen.visibility)),
            visibility: Some(seen.visibility.clone()),
        });
    }
}

/// A folder that environments of this process record into, one lock for all of them.
#[derive(Debug)]
pub struct OpenFolder {
    lock: Arc<FolderLock>,
    /// The ids of episodes under way or recorded.
    taken: Mutex<BTreeSet<String>>,
}

impl OpenFolder {
    pub fn take(folder: &Path) -> Result<Arc<Self>, StoreError> {
        // A forked process does not own the locks of its parent.
        static OPEN: Mutex<BTreeMap<(u32, PathBuf), Weak<OpenFolder>>> = Mutex::new(BTreeMap::new());
        let path = (std::process::id(), std::path::absolute(folder).map_err(StoreError::io("find", folder))?);
        let mut open = locked(&OPEN);
        open.retain(|_, folder| folder.strong_count() > 0);
        if let Some(there) = open.get(&path).and_then(Weak::upgrade) {
            return Ok(there);
        }
        let taken = Arc::new(Self { lock: Arc::new(FolderLock::take(folder)?), taken: Mutex::default() });
        open.insert(path, Arc::downgrade(&taken));
        Ok(taken)
    }
}

//! What an episode's log is told: the world as shapes, the frame, the counts, the row.

use std::path::Path;
use std::sync::LazyLock;

use schemars::schema_for;
use serde_json::Value;

use super::plan::Key;
use super::play::{Broken, Seen};
use super::store::Store;
use crate::log::message::Decision;
use crate::log::write::{EpisodeLog, Form, Placed, Solid, View};
use crate::sim::census::Census;
use crate::sim::snapshot::{self, Shape};
use crate::trace::episode::{Episode, Step};

static CENSUS: LazyLock<Value> = LazyLock::new(|| schema_for!(Census).to_value());

/// The log of an episode under way.
pub struct Log {
    key: Key,
    log: EpisodeLog,
}

impl Log {
    /// Begins the log of an episode.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn begin(store: &Store, key: Key, episode: &Episode) -> Result<Self, Broken> {
        Self::begin_at(&store.log_part(key), key, episode)
    }

    /// Begins the log of an episode that will be at `path`.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn begin_at(path: &Path, key: Key, episode: &Episode) -> Result<Self, Broken> {
        let log = EpisodeLog::create(path, episode, &CENSUS, time(key, 0));
        Ok(Self { key, log: log.map_err(Broken::fatal)? })
    }

    /// Adds what is seen before a step.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn seen(&mut self, seen: &Seen<'_>) -> Result<(), Broken> {
        let png = seen.frame.map(|frame| frame.to_png()).transpose().map_err(Broken::fatal)?;
        let snapshot = seen.world.snapshot();
        let placed: Vec<Placed> = snapshot.frames.iter().map(placed).collect();
        let solids: Vec<Solid> = snapshot.solids.iter().map(solid).collect();
        let view = View { png, placed: &placed, solids: &solids, census: seen.census };
        self.log.seen(time(self.key, seen.t), &view).map_err(Broken::fatal)
    }

    /// Adds the row of a step.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn done(&mut self, t: i32, row: &Step) -> Result<(), Broken> {
        self.log.decided(time(self.key, t), &Decision::of(t, row)).map_err(Broken::fatal)
    }

    /// Ends the log.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn end(self, episode: &Episode) -> Result<(), Broken> {
        let steps = episode.steps.len();
        let last = i32::try_from(steps).unwrap_or(i32::MAX);
        self.log.end(time(self.key, last), &episode.episode_id, steps).map_err(Broken::fatal)
    }
}

/// The time of a step in the log, which never lies before 0.
fn time(key: Key, t: i32) -> u64 {
    u64::try_from(key.frame_time(t)).unwrap_or(0)
}

fn placed(placed: &snapshot::Placed) -> Placed {
    Placed { name: placed.name.clone(), position: placed.position, rotation: placed.rotation }
}

fn solid(solid: &snapshot::Solid) -> Solid {
    let form = match solid.shape {
        Shape::Plane([x, y]) => Form::Box([x, y, 0.0]),
        Shape::Sphere(radius) => Form::Sphere(radius),
        Shape::Capsule { radius, length } => Form::Capsule { radius, length },
        Shape::Box(edges) => Form::Box(edges),
    };
    Solid { name: solid.name.clone(), form, position: solid.position, rotation: solid.rotation, rgba: solid.rgba }
}

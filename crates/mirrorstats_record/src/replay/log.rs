//! The content of an episode's log, from a recording or a replay: the world as shapes, the frame, the counts, the row.

use std::path::Path;
use std::sync::{Arc, LazyLock};

use schemars::schema_for;
use serde_json::Value;

use mirrorstats_log::message::Decision;
use mirrorstats_log::write::{EpisodeLog, View};
use mirrorstats_sim::visibility::Visibility;
use mirrorstats_sim::world::World;
use mirrorstats_trace::episodes::episode::{Episode, Step};
use mirrorstats_trace::frame::Frame;

static CENSUS: LazyLock<Value> = LazyLock::new(|| schema_for!(Visibility).to_value());

pub struct Seen<'a> {
    pub t: i32,
    /// The world before the action.
    pub world: &'a World,
    pub frame: Option<&'a Arc<Frame>>,
    pub visibility: &'a Visibility,
}

pub(crate) type LogFault = Box<dyn std::error::Error + Send + Sync>;

pub struct Log {
    place: (i32, i32, i32),
    file: EpisodeLog,
}

impl Log {
    pub fn begin(path: &Path, episode: &Episode) -> Result<Self, LogFault> {
        let place = (episode.seed, episode.run, episode.repetition.unwrap_or(1));
        Ok(Self { place, file: EpisodeLog::create(path, episode, &CENSUS, time(place, 0))? })
    }

    /// Makes the log smaller, if it is not read before its end.
    #[must_use]
    pub fn in_large_chunks(self) -> Self {
        Self { file: self.file.in_large_chunks(), ..self }
    }

    pub fn seen(&mut self, seen: &Seen<'_>) -> Result<(), LogFault> {
        let png = seen.frame.map(|frame| frame.to_png()).transpose()?;
        let snapshot = seen.world.snapshot();
        let view = View { png, placed: &snapshot.frames, solids: &snapshot.solids, census: seen.visibility };
        Ok(self.file.seen(time(self.place, seen.t), &view)?)
    }

    pub fn done(&mut self, t: i32, row: &Step) -> Result<(), LogFault> {
        Ok(self.file.decided(time(self.place, t), &Decision::from_step(t, row))?)
    }

    pub fn end(self, episode: &Episode) -> Result<(), LogFault> {
        let last = i32::try_from(episode.steps.len()).unwrap_or(i32::MAX);
        Ok(self.file.end(time(self.place, last), episode)?)
    }
}

/// The time of a step's frame, ns: not a clock time, but a unique position on the log's time line. Repetitions of a
/// scene follow some thousandths of a second later.
pub fn frame_time(seed: i32, run: i32, repetition: i32, t: i32) -> i64 {
    const SECOND: i64 = 1_000_000_000;
    const MILLISECOND: i64 = 1_000_000;
    let episode = i64::from(seed) * 1_000 + i64::from(run);
    (episode * 1_000 + i64::from(t)) * SECOND + i64::from(repetition - 1) * MILLISECOND
}

fn time((seed, run, repetition): (i32, i32, i32), t: i32) -> u64 {
    u64::try_from(frame_time(seed, run, repetition, t)).unwrap_or(0)
}

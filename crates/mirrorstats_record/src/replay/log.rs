//! The content of an episode's log, from a recording or a replay: the world as shapes, the frame, the counts, the row.

use std::path::Path;
use std::sync::{Arc, LazyLock};

use schemars::schema_for;
use serde_json::Value;

use mirrorstats_log::message::Decision;
use mirrorstats_log::write::{EpisodeLog, View};
use mirrorstats_sim::rng::Rng;
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
/// scene follow some thousandths of a second later. Seeds and runs that only a harness can ask for have places after
/// the others, in no order.
pub fn frame_time(seed: i32, run: i32, repetition: i32, t: i32) -> i64 {
    const SECOND: i64 = 1_000_000_000;
    const MILLISECOND: i64 = 1_000_000;
    const OTHERS: i64 = 1 << 62;
    let is_near = (0..=4_000).contains(&seed) && (0..1_000).contains(&run) && repetition <= 1_000;
    if !is_near {
        let drawn = Rng::for_run(u64::from(repetition.unsigned_abs()), seed, run).number();
        // 46 bits for the episode and 16 for the step.
        return OTHERS | ((drawn >> 18).cast_signed() << 16) | i64::from(t);
    }
    let episode = i64::from(seed) * 1_000 + i64::from(run);
    (episode * 1_000 + i64::from(t)) * SECOND + i64::from(repetition - 1) * MILLISECOND
}

fn time((seed, run, repetition): (i32, i32, i32), t: i32) -> u64 {
    u64::try_from(frame_time(seed, run, repetition, t)).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::frame_time;

    #[test]
    fn every_step_that_a_harness_can_ask_for_has_its_own_time() {
        let numbers = [0, 1, 2, 999, 1_000, 1_001, 4_000, 4_001, 9_223, 9_224, i32::MAX];
        let mut times = BTreeSet::new();
        for (seed, run) in numbers.iter().flat_map(|seed| numbers.map(|run| (*seed, run))) {
            for repetition in [1, 2, 1_000, 1_001] {
                let steps = [1, 2, 999].map(|t| frame_time(seed, run, repetition, t));
                assert!(steps.is_sorted_by(|a, b| a < b) && steps[0] >= 0, "seed {seed}, run {run}: {steps:?}");
                times.extend(steps);
            }
        }
        assert_eq!(times.len(), numbers.len() * numbers.len() * 4 * 3);
    }
}

//! Frames of episodes without a log, rendered again by a replay in blocks of steps; recent blocks are kept.

use std::collections::BTreeMap;

use serde_json::Value;

use super::ViewError;
use super::recent::Recent;
use mirrorstats_record::replay::frames::frames;
use mirrorstats_trace::episodes::episode::Episode;

/// The number of steps rendered together from one world.
const TOGETHER: usize = 16;

/// The number of blocks in memory, a few megabytes.
const KEPT: usize = 16;

/// Blocks of frames as PNG by step, by episode and place of the block.
#[derive(Debug)]
pub(super) struct Rendered(Recent<(String, usize), BTreeMap<i32, Vec<u8>>>);

impl Default for Rendered {
    fn default() -> Self {
        Self(Recent::new(KEPT))
    }
}

impl Rendered {
    /// The frame of a step; `None` if the episode has no such step. Replays run one at a time: a concurrent caller
    /// waits, and often gets a frame of the same block.
    pub fn frame(&self, recording: Option<&Value>, episode: &Episode, t: usize) -> Result<Option<Vec<u8>>, ViewError> {
        let Some(block) = t.checked_sub(1).filter(|at| *at < episode.steps.len()).map(|at| at / TOGETHER) else {
            return Ok(None);
        };
        let step = |t: usize| i32::try_from(t).unwrap_or(i32::MAX);
        let steps = step(block * TOGETHER + 1)..=step((block + 1) * TOGETHER);
        let key = (episode.episode_id.clone(), block);
        let frames = self.0.get(key, || frames(recording, episode, &steps)).map_err(Box::new)?;
        Ok(frames.get(&step(t)).cloned())
    }
}

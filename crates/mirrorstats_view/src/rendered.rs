//! Frames of episodes without a log, rendered again by a replay in blocks of steps; recent blocks are kept.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use serde_json::Value;

use super::ViewError;
use mirrorstats_record::replay::frames::frames;
use mirrorstats_trace::episodes::episode::Episode;

/// The number of steps rendered together from one world.
const TOGETHER: usize = 16;

/// The number of blocks in memory, a few megabytes.
const KEPT: usize = 16;

type Block = BTreeMap<i32, Vec<u8>>;

#[derive(Debug, Default)]
pub(super) struct Rendered(Mutex<BTreeMap<(String, usize), Block>>);

impl Rendered {
    /// The frame of a step; `None` if the episode has no such step. Replays run one at a time: a concurrent caller
    /// waits, and often gets a frame of the same block.
    pub fn frame(&self, recording: Option<&Value>, episode: &Episode, t: usize) -> Result<Option<Vec<u8>>, ViewError> {
        let Some(block) = t.checked_sub(1).filter(|at| *at < episode.steps.len()).map(|at| at / TOGETHER) else {
            return Ok(None);
        };
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let key = (episode.episode_id.clone(), block);
        if !kept.contains_key(&key) {
            let first = i32::try_from(block * TOGETHER + 1).unwrap_or(i32::MAX);
            let last = i32::try_from((block + 1) * TOGETHER).unwrap_or(i32::MAX);
            let rendered = frames(recording, episode, &(first..=last)).map_err(Box::new)?;
            if kept.len() >= KEPT {
                kept.clear();
            }
            kept.insert(key.clone(), rendered);
        }
        let frames = kept.get(&key);
        Ok(i32::try_from(t).ok().and_then(|t| frames?.get(&t).cloned()))
    }
}

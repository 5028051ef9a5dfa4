//! Recordings in progress: whether there is new data, and the progress of the episodes under way.

use std::sync::{Arc, PoisonError};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::found::Found;
use crate::snapshot::Running;
use crate::{Snapshot, View, ViewError};
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::format::fixed;
use mirrorstats_trace::validate::replies::ReplyCounts;

const PAUSE: Duration = Duration::from_millis(400);
/// The time over which the rate of steps is measured.
const SPAN: Duration = Duration::from_secs(10);

/// The time and the findings of the last scan of the files.
#[derive(Debug, Default)]
pub(crate) struct Watch {
    last: Option<Instant>,
    counted: Vec<(Instant, u64)>,
    /// The reason why the newest state cannot be shown; the previous one is shown instead.
    fault: Option<String>,
}

impl View {
    pub(crate) fn live(&self) -> Value {
        // Concurrent callers get the previous findings.
        if let Ok(mut watch) = self.watch.try_lock()
            && watch.last.is_none_or(|last| last.elapsed() >= PAUSE)
        {
            self.look(&mut watch);
            watch.last = Some(Instant::now());
            let steps = self.newest().steps_under_way();
            watch.count(steps);
        }
        let snapshot = self.newest();
        let watch = self.watch.lock().unwrap_or_else(PoisonError::into_inner);
        let running: Vec<Value> = snapshot.running.iter().map(entry).collect();
        json!({
            "generation": snapshot.generation,
            "episodes": snapshot.episodes(),
            "running": running,
            "rate": watch.rate().map(|rate| fixed(Some(rate), 1)),
            "fault": watch.fault,
            "unreadable": snapshot.unreadable,
        })
    }

    pub(crate) fn refresh(&self) -> Result<(), ViewError> {
        let mut watch = self.watch.lock().unwrap_or_else(PoisonError::into_inner);
        self.look(&mut watch);
        watch.fault.clone().map_or(Ok(()), |fault| Err(ViewError::Absent(fault)))
    }

    fn look(&self, watch: &mut Watch) {
        watch.fault = match self.newer() {
            Ok(None) => None,
            Ok(Some(newer)) => {
                *self.newest.write().unwrap_or_else(PoisonError::into_inner) = Arc::new(newer);
                None
            }
            // A recording may be replacing a trace; the next scan follows soon.
            Err(error) => Some(error.words()),
        };
    }

    /// The state of the files, unless it is the one that is shown.
    fn newer(&self) -> Result<Option<Snapshot>, ViewError> {
        let (old, found) = (self.newest(), Found::of(&self.options.runs)?);
        let (is_same, has_labels) = (found.stamps() == old.stamps, found.label_stamps() == old.label_stamps);
        if is_same && has_labels && found.unfinished.is_empty() && old.running.is_empty() {
            return Ok(None);
        }
        Ok(Some(match (is_same, has_labels) {
            (true, true) => old.grown(&found, old.scored.clone()),
            (true, false) => old.relabelled(&found)?,
            (false, _) => Snapshot::open(&self.options, old.generation + 1)?,
        }))
    }
}

impl Watch {
    fn count(&mut self, steps: u64) {
        self.counted.retain(|(at, before)| at.elapsed() < SPAN && *before <= steps);
        self.counted.push((Instant::now(), steps));
    }

    /// Steps per second over the last seconds.
    fn rate(&self) -> Option<f64> {
        let ((from, before), (to, after)) = (self.counted.first()?, self.counted.last()?);
        let seconds = to.duration_since(*from).as_secs_f64();
        let steps = u32::try_from(after - before).ok()?;
        (seconds > 0.0 && steps > 0).then(|| f64::from(steps) / seconds)
    }
}

fn entry(Running { episode, .. }: &Running) -> Value {
    let last = episode.steps.last();
    let cost: f64 = episode.steps.iter().filter_map(|step| step.extra.cost_usd).sum();
    let statuses = episode.steps.iter().filter_map(|step| step.extra.reply_status.as_deref());
    let unreadable = statuses.filter(|status| !ReplyCounts::is_read(status)).count();
    json!({
        "id": episode.episode_id,
        "name": visible(&episode.episode_id),
        "model": visible(&episode.model),
        "experiment": visible(&episode.experiment),
        "steps": episode.steps.len(),
        "action": last.and_then(|step| step.action).map(|action| action.name().replace('_', " ")),
        "cost": (cost > 0.0).then(|| fixed(Some(cost), 4)),
        "unreadable": unreadable,
    })
}

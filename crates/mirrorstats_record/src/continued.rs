//! The check that an existing log belongs to the continued recording.
//!
//! Rule: the log of an experiment holds all or some episodes of its trace, recorded as the trace says. Any other log is
//! neither extended nor removed.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::{Value, json};

use super::error::StoreError;
use super::metadata::{Difference, difference};
use mirrorstats_log::LogError;
use mirrorstats_log::message::Decision;
use mirrorstats_log::recover::{Recovered, recover};
use mirrorstats_trace::episodes::episode::Episode;
use mirrorstats_trace::error::TraceError;
use mirrorstats_trace::read::episode_rows::EpisodeRows;
use mirrorstats_trace::write::OptionalColumns;
use mirrorstats_trace::write::merge;

/// Rejects an existing log at `log` unless it has these episodes, recorded in this way; `trace` is the path of their
/// trace, which need not exist.
pub(crate) fn check(log: &Path, trace: &Path, recording: &Value, episodes: &[EpisodeRows]) -> Result<(), StoreError> {
    if !log.exists() {
        return Ok(());
    }
    let found = recover(log)?;
    if let Some(fault) = found.losses.first() {
        return Err(LogError::Damaged { file: log.display().to_string(), fault }.into());
    }
    let Some(fault) = fault_of(&found, trace, recording, episodes)? else { return Ok(()) };
    let (own, place) = (log.display(), trace.display());
    let help = if trace.exists() || difference_of(&found, recording).is_some() {
        format!(
            "`mirrorstats trace recover {own} -o TRACE.parquet` makes a trace of it; move the log away to go on without it, or \
             record into another folder"
        )
    } else {
        format!(
            "`mirrorstats trace recover {own} -o {place}` makes its trace again, and the same command goes on from there; or \
             move the log away to record its episodes anew"
        )
    };
    Err(StoreError::ForeignLog { path: log.to_owned(), fault, help })
}

fn fault_of(
    found: &Recovered,
    trace: &Path,
    recording: &Value,
    episodes: &[EpisodeRows],
) -> Result<Option<String>, TraceError> {
    if let Some(difference) = difference_of(found, recording) {
        return Ok(Some(format!("it was recorded with another {difference}")));
    }
    let rows: BTreeMap<&str, &EpisodeRows> = episodes.iter().map(|rows| (rows.episode_id.as_str(), rows)).collect();
    let columns = OptionalColumns::recorded(recording);
    for logged in &found.episodes {
        let id = &logged.episode_id;
        let place = trace.display();
        let Some(own) = rows.get(id.as_str()) else {
            let nowhere = if trace.exists() { "which is not in" } else { "and there is no trace" };
            return Ok(Some(format!("it holds the episode `{id}`, {nowhere} `{place}`")));
        };
        // A trace may lack columns that the log has.
        let (own, logged) = (restored(own)?, restored(&merge::rows(logged, &columns)?)?);
        if let Some(parted) = parted(&own, &logged) {
            return Ok(Some(format!("its episode `{id}` is not that of `{place}`: {parted}")));
        }
    }
    Ok(None)
}

fn difference_of(found: &Recovered, recording: &Value) -> Option<Difference> {
    difference(recording, found.recording.as_ref().unwrap_or(&Value::Null))
}

fn restored(rows: &EpisodeRows) -> Result<Episode, TraceError> {
    let file = rows.episode_id.clone();
    let episode = rows.episode().map_err(|fault| TraceError::Part { file, source: fault.into() })?;
    Ok(Episode { episode_hash: None, ..episode })
}

fn parted(own: &Episode, logged: &Episode) -> Option<String> {
    if own == logged {
        return None;
    }
    if let Some(difference) = difference(&json!(own), &json!(logged)) {
        return Some(difference.to_string());
    }
    for (t, (own, logged)) in (1..).zip(own.steps.iter().zip(&logged.steps)) {
        if let Some(difference) =
            difference(&json!(Decision::from_step(t, own)), &json!(Decision::from_step(t, logged)))
        {
            return Some(format!("at t = {t}, {difference}"));
        }
    }
    Some(format!("expected {} steps, found {}", own.steps.len(), logged.steps.len()))
}

#[cfg(test)]
mod tests {
    use super::parted;
    use mirrorstats_trace::episodes::episode::{Action, Episode, Step};

    fn episode(steps: usize) -> Episode {
        Episode {
            episode_id: "E1/a/s1/r1".into(),
            model: "a".into(),
            experiment: "E1".into(),
            seed: 1,
            run: 1,
            body_color: "red".into(),
            distractors: Some(2),
            steps: vec![Step { action: Some(Action::TurnLeft), ..Step::default() }; steps],
            ..Episode::default()
        }
    }

    #[test]
    fn the_first_difference_is_named() {
        let own = episode(3);
        assert_eq!(parted(&own, &own.clone()), None);
        assert_eq!(parted(&own, &episode(2)).unwrap(), "expected 3 steps, found 2");
        let mut other = episode(3);
        other.steps[1].action = Some(Action::Done);
        other.steps[2].action = None;
        assert_eq!(parted(&own, &other).unwrap(), r#"at t = 2, action: expected "turn_left", found "done""#);
        other.body_color = "blue".into();
        assert_eq!(parted(&own, &other).unwrap(), r#"body_color: expected "red", found "blue""#);
    }
}

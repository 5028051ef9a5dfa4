//! Cut or damaged logs, and logs assembled from parts.

use std::io::Cursor;
use std::num::NonZeroUsize;
use std::path::Path;

use mirrorstats_exact::replace::folder_of;
use mirrorstats_log::assemble;
use mirrorstats_log::recover::{Recovered, recover_from};
use mirrorstats_trace::diagnostic::Severity;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::episode_rows::EpisodeRows;
use mirrorstats_trace::validate::validate;
use mirrorstats_trace::write::OptionalColumns;
use mirrorstats_trace::write::merge;
use serde_json::json;

use crate::depth::reached;
use crate::scratch;

fn recovered(data: &[u8]) -> Option<Recovered> {
    recover_from(Path::new("log.mcap"), Cursor::new(data)).ok()
}

/// The bytes as a log: the recovered episodes form a valid trace, or `recover` says which rule they break.
pub fn recover(data: &[u8]) {
    let Some(found) = recovered(data) else { return };
    reached("log");
    assert_eq!(recovered(data).as_ref(), Some(&found), "saved twice, and not the same");
    let columns = found.recording.as_ref().map_or_else(OptionalColumns::all, OptionalColumns::recorded);
    let rows = found.episodes.iter().map(|episode| merge::rows(episode, &columns));
    let Ok(rows) = rows.collect::<Result<Vec<_>, _>>() else { return };
    let steps: usize = found.episodes.iter().map(|episode| episode.steps.len()).sum();
    assert_eq!(rows.iter().map(EpisodeRows::len).sum::<usize>(), steps);
    let out = scratch::path("recovered.parquet");
    if rows.is_empty() || merge::write(&out, found.recording.as_ref(), &rows).is_err() {
        return;
    }
    let report = validate(&[Input::new(&out)], None, NonZeroUsize::MIN).expect("threads can be started");
    reached("trace");
    let broken: Vec<_> = report.findings.iter().filter(|finding| finding.severity == Severity::Error).collect();
    if broken.is_empty() {
        assert_eq!(report.files[0].steps, steps as u64);
    }
    if !found.losses.is_any() {
        assert!(found.recording.is_some(), "a log without its recording lost nothing");
    }
}

/// The bytes as one log of a folder: it is refused, or assembled into the whole log. Assembling loses nothing that was
/// not lost before, such as an episode whose rows do not match its hash.
pub fn assembled(data: &[u8]) {
    let (part, out) = (scratch::file("part.mcap", data), scratch::path("whole.mcap"));
    let _ = std::fs::remove_file(&out);
    let before = recovered(data);
    let lost_before = before.as_ref().is_some_and(|found| found.losses.is_any());
    let place = before.and_then(|found| found.episodes.first().map(assemble::place)).unwrap_or_default();
    let recording = json!({ "kind": "recording" });
    if assemble::assemble(&out, None, &[(place, part)], &recording, folder_of(&out)).is_err() {
        assert!(!out.exists(), "a refused log leaves a file");
        return;
    }
    reached("whole");
    let bytes = std::fs::read(&out).expect("a log that was written");
    if let Some(whole) = recovered(&bytes) {
        assert!(lost_before || !whole.losses.is_any(), "of what was put together is lost: {:?}", whole.losses);
    }
}

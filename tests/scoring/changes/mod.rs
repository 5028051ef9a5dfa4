//! `diff` and `rescore` at the process boundary: changed cells, flips, deciding steps, refusals.

mod diff;
mod rescore;
mod worked;

use mirrorstats_trace::episodes::episode::{Action, Episode, Step};
use mirrorstats_trace::write::write_episodes;

use crate::harness::program::run;
use crate::harness::traces;

/// Definitions of one metric: the number of timesteps from `from` on with the mirror in view.
fn gaze(from: i64) -> String {
    format!("[metric.GAZE]\nvalue = \"count(mirror_visible and t >= {from})\"\n")
}

/// An episode of three steps with the mirror in view as given, and then done.
fn episode(id: &str, run: i32, visible: [bool; 3]) -> Episode {
    let step = |(at, mirror_visible)| Step {
        action: Some(if at == 2 { Action::Done } else { Action::TurnLeft }),
        mirror_visible,
        ..Step::default()
    };
    let steps = visible.into_iter().enumerate().map(step).collect();
    Episode { model: "ant".into(), run, ..traces::episode(id, steps) }
}

/// A folder without foreign files beside it, because traces are searched there too.
fn secluded() -> tempfile::TempDir {
    tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap()
}

/// A folder with `a.parquet` (episodes e1, e2), `b.parquet` (e3) and the definitions `all.toml` and `late.toml`.
fn folder() -> tempfile::TempDir {
    let folder = secluded();
    let at = |name: &str| folder.path().join(name);
    let [e1, e2] = [episode("e1", 1, [true, true, false]), episode("e2", 2, [false, false, true])];
    write_episodes(&at("a.parquet"), None, &[e1, e2]).unwrap();
    write_episodes(&at("b.parquet"), None, &[episode("e3", 3, [false; 3])]).unwrap();
    std::fs::write(at("all.toml"), gaze(1)).unwrap();
    std::fs::write(at("late.toml"), gaze(2)).unwrap();
    folder
}

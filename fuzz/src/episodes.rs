//! A few episodes and their trace, for every target that needs some.

use mirrorstats_trace::episodes::episode::{Action, Episode, Extra, Step};
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::write::{OptionalColumns, TraceMetadata, TraceWriter};

use crate::scratch;

/// Episodes of every length from 1 to `count`.
pub fn episodes(count: usize) -> Vec<Episode> {
    let step = |t: usize| Step {
        action: Some(Action::ALL[t % 5]),
        self_color: (t > 2).then(|| if t.is_multiple_of(3) { "unknown".into() } else { "red".into() }),
        selected_cube: (t > 0).then(|| "none".into()),
        mirror_visible: t.is_multiple_of(2),
        extra: Extra {
            mirror_px: i32::try_from(t).ok(),
            pose_x: [Some(1.5), Some(f32::NAN), None, Some(-0.0)][t % 4],
            bumped: [Some(true), None, Some(false)][t % 3],
            reasoning: (t != 1).then(|| format!("maybe é {t}")),
            ..Extra::default()
        },
    };
    let episode = |at: usize| Episode {
        episode_id: format!("e{at}"),
        model: ["m", "it's `m`"][at % 2].into(),
        experiment: ["E1", "E2", "E5"][at % 3].into(),
        seed: 1,
        run: i32::try_from(at).unwrap_or(0),
        body_color: "red".into(),
        stated_color: (at == 1).then(|| "blue".into()),
        steps: (0..=at).map(step).collect(),
        ..Episode::default()
    };
    (0..count).map(episode).collect()
}

/// The trace of `count` episodes.
pub fn trace(count: usize) -> Vec<u8> {
    let episodes = episodes(count);
    let columns = OptionalColumns::used_by(&episodes);
    let mut encoder = TraceWriter::new(Vec::new(), &TraceMetadata { recording: None, columns }).expect("known columns");
    for episode in &episodes {
        encoder.write(episode).expect("a sound episode");
    }
    encoder.finish().expect("memory takes any bytes")
}

/// A trace of six episodes, open. Each thread has its own, because the files end with their thread.
pub fn open() -> &'static TraceSet {
    thread_local! {
        static OPEN: &'static TraceSet = {
            let path = scratch::path("episodes.parquet");
            std::fs::write(&path, trace(6)).expect("a folder for temporary files");
            Box::leak(Box::new(TraceSet::open(&[Input::new(path)]).expect("a sound trace")))
        };
    }
    OPEN.with(|open| *open)
}

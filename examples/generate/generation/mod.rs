//! Generates a study: its episodes, their order, and their files.
//!
//! Rule: an episode depends only on the seed and its number. The order, the number of files, the number of threads and
//! the optional columns change no value of a required column. Wild files have other values.

mod draw;
mod episodes;
mod extras;
mod order;
mod wild;

use std::error::Error;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use mirrorstats_trace::write::{OptionalColumns, TraceMetadata, TraceWriter};

pub use episodes::{Study, Values, Wild};
pub use order::Order;

/// The optional columns of a generated trace: those of a recording with a model, except its longest texts.
pub const OPTIONAL_COLUMNS: [&str; 18] = [
    "mirror_self_px",
    "mirror_other_px",
    "mirror_px",
    "direct_other_px",
    "pose_x",
    "pose_y",
    "pose_yaw",
    "bumped",
    "distractors",
    "stated_color",
    "cube_distance",
    "reply_status",
    "latency_ms",
    "prompt_tokens",
    "completion_tokens",
    "cost_usd",
    "reasoning",
    "frame_time",
];

/// An error while generating.
pub type Failure = Box<dyn Error + Send + Sync>;

/// The files of a study, and how it is divided among them.
pub struct Files {
    /// The folder of `steps-000.parquet`, ...; created if missing.
    pub folder: PathBuf,
    /// The number of files; all have about the same number of steps.
    pub count: usize,
    /// The number of files written at the same time.
    pub threads: usize,
}

/// Writes the files of a study.
///
/// Memory does not grow with the steps. It grows by the id and 4 bytes for each episode.
///
/// # Errors
/// If there are more than 2^32 episodes, or a file cannot be written.
pub fn write(study: &Study, order: Order, files: &Files) -> Result<(), Failure> {
    fs::create_dir_all(&files.folder)?;
    let numbers = order.numbers(study.seed, u32::try_from(study.episodes())?);
    let shares = shares(study, &numbers, files.count.max(1));
    let next = AtomicUsize::new(0);
    thread::scope(|scope| {
        let worker = || {
            loop {
                let file = next.fetch_add(1, Ordering::Relaxed);
                let Some(share) = shares.get(file) else { return Ok(()) };
                write_file(study, &numbers[share.clone()], &files.folder.join(format!("steps-{file:03}.parquet")))?;
            }
        };
        let workers: Vec<_> = (0..files.threads.max(1)).map(|_| scope.spawn(worker)).collect();
        workers.into_iter().try_for_each(|worker| worker.join().unwrap_or_else(|_| Err("a writer panicked".into())))
    })
}

/// Divides the episodes among files with about the same number of steps; returns each file's positions in `numbers`.
fn shares(study: &Study, numbers: &[u32], files: usize) -> Vec<Range<usize>> {
    let mut shares = Vec::with_capacity(files);
    let (mut end, mut steps) = (0, 0);
    for file in 1..=files as u64 {
        let start = end;
        while steps < study.steps * file / files as u64 {
            steps += study.length(numbers[end].into());
            end += 1;
        }
        if start < end {
            shares.push(start..end);
        }
    }
    shares
}

fn write_file(study: &Study, numbers: &[u32], path: &Path) -> Result<(), Failure> {
    let names: &[&str] = match study.values {
        Values::Wild(shape) => return wild::write_file(study, shape, numbers, path),
        Values::Optional => &OPTIONAL_COLUMNS,
        Values::Required => &[],
    };
    let columns = OptionalColumns::named(names).ok_or("a column that the schema does not have")?;
    let mut writer = TraceWriter::create(path, &TraceMetadata { recording: None, columns })?;
    for number in numbers {
        writer.write(&study.episode((*number).into()))?;
    }
    Ok(writer.commit()?)
}

//! Generates traces of any size for benchmarks: `cargo run --release --example generate -- --steps 14000000 --out DIR`.
//!
//! Rule: an episode is a function of the seed and of its number alone. So the same steps come out in one file or in
//! forty, on any number of threads, and a file needs little memory however large it is. The last episode is cut short
//! where the number of steps asks for it.
//!
//! Lengths and runs are like those of recorded episodes (`episodes`): 1 to 100 steps, a third of the episodes at the
//! limit; colours and what the mirror shows stay for many steps, actions for a few.

mod draw;
mod episodes;

use std::error::Error;
use std::fs;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use clap::Parser;
use mirrorstats::trace::write::{OptionalColumns, TraceMetadata, TraceWriter};

use episodes::Study;

/// Generate traces for benchmarks
#[derive(Debug, Parser)]
struct Arguments {
    /// Steps in all files together.
    #[arg(long, default_value_t = 14_000_000)]
    steps: u64,
    /// Files that they are divided among, at episodes.
    #[arg(long, default_value_t = 4)]
    files: usize,
    /// Another seed gives other episodes.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Files that are written at the same time.
    #[arg(long, default_value_t = 2)]
    threads: usize,
    /// The folder for `steps-000.parquet`, ...; made if it is not there.
    #[arg(long)]
    out: PathBuf,
}

/// The optional columns of a generated trace: what a recording with a model behind it has, but for texts.
const COLUMNS: [&str; 16] = [
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
    "frame_time",
];

type Failure = Box<dyn Error + Send + Sync>;

fn main() -> Result<(), Failure> {
    let arguments = Arguments::parse();
    fs::create_dir_all(&arguments.out)?;
    let study = Study { seed: arguments.seed, steps: arguments.steps };
    let shares = shares(&study, arguments.files.max(1));
    let next = AtomicUsize::new(0);
    thread::scope(|scope| {
        let worker = || {
            while let Some(share) = shares.get(next.fetch_add(1, Ordering::Relaxed)) {
                share.write(&study, &arguments.out)?;
            }
            Ok::<_, Failure>(())
        };
        let workers: Vec<_> = (0..arguments.threads.max(1)).map(|_| scope.spawn(worker)).collect();
        workers.into_iter().try_for_each(|worker| worker.join().unwrap_or_else(|_| Err("a writer panicked".into())))
    })
}

/// The episodes of one file.
struct Share {
    file: usize,
    episodes: Range<u64>,
    /// Steps in the files before it.
    steps_before: u64,
}

/// Divides the episodes so that files have about the same number of steps.
fn shares(study: &Study, files: usize) -> Vec<Share> {
    let mut shares = Vec::with_capacity(files);
    let (mut episode, mut steps) = (0, 0);
    for file in 0..files {
        let (first, steps_before) = (episode, steps);
        let until = study.steps * (file as u64 + 1) / files as u64;
        while steps < until {
            steps += study.length(episode).min(study.steps - steps);
            episode += 1;
        }
        if first < episode {
            shares.push(Share { file, episodes: first..episode, steps_before });
        }
    }
    shares
}

impl Share {
    fn write(&self, study: &Study, folder: &std::path::Path) -> Result<(), Failure> {
        let columns = OptionalColumns::named(&COLUMNS).ok_or("a column that the schema does not have")?;
        let metadata = TraceMetadata { recording: None, columns };
        let mut writer = TraceWriter::create(&folder.join(format!("steps-{:03}.parquet", self.file)), &metadata)?;
        let mut left = study.steps - self.steps_before;
        for number in self.episodes.clone() {
            let mut episode = study.episode(number);
            episode.steps.truncate(usize::try_from(left)?);
            left -= episode.steps.len() as u64;
            writer.write(&episode)?;
        }
        Ok(writer.finish()?)
    }
}

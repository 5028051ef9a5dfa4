//! Generates traces of any size for benchmarks, in the order of a study or shuffled.
//!
//! `cargo run --release --example generate -- --order shuffled --out DIR`. Lengths are like those of recorded episodes:
//! 1 to 100 steps, and slightly more than 41 % of the episodes reach the limit. Colours and the mirror's contents stay
//! the same for many steps, actions for a few.

mod generation;

use std::path::PathBuf;

use clap::Parser;

use generation::{Failure, Files, Order, Study, Values, Wild};

/// Generate traces for benchmarks
#[derive(Debug, Parser)]
struct Arguments {
    /// Steps in all files together; the last episode of the study is cut to give this number.
    #[arg(long, default_value_t = 14_150_000, value_parser = clap::value_parser!(u64).range(1..))]
    steps: u64,
    /// The order of the episodes, over all files.
    #[arg(long, value_enum, default_value_t = Order::Study)]
    order: Order,
    /// Another seed gives other episodes and another shuffled order.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Write optional columns too, with values that hardly repeat: poses, pixels, tokens, costs, times, reasons.
    #[arg(long)]
    optional: bool,
    /// Write files as pyarrow does, without our checksums: drawn keys that many episodes share, and poses, costs and texts
    /// that hardly repeat.
    #[arg(long, conflicts_with = "optional")]
    wild: bool,
    #[command(flatten)]
    shape: Wild,
    /// Files, divided at episodes.
    #[arg(long, default_value_t = 4)]
    files: usize,
    /// Files that are written at the same time.
    #[arg(long, default_value_t = 2)]
    threads: usize,
    /// The folder for `steps-000.parquet`, ...; made if it is not there.
    #[arg(long)]
    out: PathBuf,
}

fn main() -> Result<(), Failure> {
    let Arguments { steps, order, seed, optional, wild, shape, files, threads, out } = Arguments::parse();
    let values = match (wild, optional) {
        (true, _) => Values::Wild(shape),
        (false, true) => Values::Optional,
        (false, false) => Values::Required,
    };
    let study = Study::new(seed, steps, values);
    generation::write(&study, order, &Files { folder: out, count: files, threads })
}

//! `mirrorstats trace recover`: makes a trace from a log, even a truncated one.

use std::path::PathBuf;

use crate::cli::{Failure, Outcome, output};
use mirrorstats_log::to_trace::recover_to_trace;

/// Make a trace from a log, even a truncated or damaged one
///
/// The trace gets every episode that ends in the log, and is checked against every rule. An existing trace is replaced
/// if it belongs to the same recording and the log has all its episodes with the same rows. Exits with 3 if any part of
/// the log is lost, even only the index at its end.
#[derive(Clone, Debug, clap::Args)]
pub struct RecoverArgs {
    /// The log
    #[arg(value_name = "LOG.mcap")]
    log: PathBuf,
    /// The trace to write
    #[arg(short, long, value_name = "TRACE.parquet")]
    out: PathBuf,
    /// Answer as JSON
    #[arg(long)]
    json: bool,
}

impl RecoverArgs {
    pub fn run(&self) -> Result<Outcome, Failure> {
        output::check_target(&self.out, [&self.log])?;
        let answer = recover_to_trace(&self.log, &self.out)?;
        output::print(&answer, self.json)?;
        Ok(if answer.losses.is_any() { Outcome::Lossy } else { Outcome::Done })
    }
}

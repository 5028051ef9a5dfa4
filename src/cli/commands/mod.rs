//! The verbs: one file each.

pub mod stats;

use super::outcome::{Failure, Outcome};

/// What to do.
#[derive(Debug, clap::Subcommand)]
pub enum Command {}

impl Command {
    /// Does it.
    ///
    /// # Errors
    /// Whatever keeps the command from running to its end.
    pub fn run(self) -> Result<Outcome, Failure> {
        match self {}
    }
}

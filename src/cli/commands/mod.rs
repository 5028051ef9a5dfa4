//! The verbs: one file each.

pub mod info;
pub mod schema;
pub mod validate;

use super::outcome::{Failure, Outcome};

/// What to do.
#[derive(Debug, clap::Subcommand)]
pub enum Command {
    /// Summarise traces.
    Info(info::InfoCommand),
    /// Print what a trace is.
    Schema(schema::SchemaCommand),
    /// Check traces.
    Validate(validate::ValidateCommand),
}

impl Command {
    /// Does it.
    ///
    /// # Errors
    /// Whatever keeps the command from running to its end.
    pub fn run(self) -> Result<Outcome, Failure> {
        match self {
            Self::Info(command) => command.run(),
            Self::Schema(command) => command.run(),
            Self::Validate(command) => command.run(None),
        }
    }
}

//! `setup`: settings, completions and manual pages of this program.

pub mod completions;
pub mod config;
pub mod man;

use crate::cli::outcome::{Failure, Outcome};

/// Show settings, write completions of a shell and manual pages
#[derive(Debug, clap::Subcommand)]
pub enum SetupCommand {
    Config(config::ConfigArgs),
    Completions(completions::CompletionsArgs),
    Man(man::ManArgs),
}

impl SetupCommand {
    pub fn run(self) -> Result<Outcome, Failure> {
        match self {
            Self::Config(args) => args.run(),
            Self::Completions(args) => args.run(),
            Self::Man(args) => args.run(),
        }
    }
}

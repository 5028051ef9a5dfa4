//! `mirrorstats setup completions`: completions of command lines for shells.

use std::io::{self, Write as _};

use clap::CommandFactory as _;
use clap_complete::Shell;

use crate::cli::outcome::{Failure, Outcome};
use crate::cli::{Cli, NAME};

/// Print completions of command lines for a shell
#[derive(Clone, Debug, clap::Args)]
pub struct CompletionsArgs {
    /// The shell
    shell: Shell,
}

impl CompletionsArgs {
    pub fn run(self) -> Result<Outcome, Failure> {
        let mut text = Vec::new();
        clap_complete::generate(self.shell, &mut Cli::command(), NAME, &mut text);
        io::stdout().lock().write_all(&text)?;
        Ok(Outcome::Done)
    }
}

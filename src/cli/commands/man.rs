//! `mirrorstats man`: manual pages, one per command.

use std::path::PathBuf;

use clap::CommandFactory as _;

use crate::cli::outcome::{Failure, Outcome};
use crate::cli::{Cli, help, output};

/// Write manual pages into a folder, one per command
#[derive(Clone, Debug, clap::Args)]
pub struct ManArgs {
    /// The folder, which is made where there is none
    folder: PathBuf,
}

impl ManArgs {
    /// Writes them.
    ///
    /// # Errors
    /// When the folder or a page cannot be written.
    pub fn run(self) -> Result<Outcome, Failure> {
        let mut command = help::with_examples_alone(Cli::command());
        command.build();
        std::fs::create_dir_all(&self.folder)
            .map_err(|error| Failure::input(format!("cannot make the folder `{}`: {error}", self.folder.display())))?;
        pages(&command, &self.folder)?;
        output::say(&format!("the pages are in {}", self.folder.display()));
        Ok(Outcome::Done)
    }
}

fn pages(command: &clap::Command, folder: &std::path::Path) -> Result<(), Failure> {
    let name = command.get_display_name().unwrap_or_else(|| command.get_name()).to_owned();
    let mut page = Vec::new();
    clap_mangen::Man::new(command.clone()).date("").render(&mut page)?;
    output::write_file(&folder.join(format!("{name}.1")), &page)?;
    command.get_subcommands().filter(|inner| inner.get_name() != "help").try_for_each(|inner| pages(inner, folder))
}

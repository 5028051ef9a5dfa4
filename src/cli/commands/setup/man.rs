//! `mirrorstats setup man`: manual pages, one per command.

use std::path::{Path, PathBuf};

use clap::CommandFactory as _;

use crate::cli::outcome::{Failure, Outcome};
use crate::cli::{Cli, help, output};
use exact::replace::Content;

/// Write manual pages into a folder, one per command
#[derive(Clone, Debug, clap::Args)]
pub struct ManArgs {
    /// The folder; it is created if it does not exist
    folder: PathBuf,
}

impl ManArgs {
    pub fn run(self) -> Result<Outcome, Failure> {
        let mut command = help::with_examples_alone(Cli::command());
        command.build();
        let mut made = Vec::new();
        pages(&command, &mut made)?;
        let files: Vec<_> = made.iter().map(|(name, page)| (Path::new(name), Content::Bytes(page))).collect();
        output::write_folder(&self.folder, &files)?;
        output::say(&format!("the pages are in {}", self.folder.display()));
        Ok(Outcome::Done)
    }
}

fn pages(command: &clap::Command, made: &mut Vec<(String, Vec<u8>)>) -> Result<(), Failure> {
    let name = command.get_display_name().unwrap_or_else(|| command.get_name()).to_owned();
    let mut page = Vec::new();
    clap_mangen::Man::new(command.clone()).date("").render(&mut page)?;
    made.push((format!("{name}.1"), page));
    command.get_subcommands().filter(|inner| inner.get_name() != "help").try_for_each(|inner| pages(inner, made))
}

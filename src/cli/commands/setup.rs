//! `setup`: completions and manual pages of this program.

use std::path::{Path, PathBuf};

use clap::{Command, CommandFactory as _};
use clap_complete::Shell;

use crate::cli::{Cli, Failure, NAME, Outcome, help, output};
use mirrorstats_exact::replace::Content;

/// Write completions of a shell and manual pages
#[derive(Debug, clap::Subcommand)]
pub enum SetupCommand {
    /// Print completions of command lines for a shell
    Completions {
        /// The shell
        shell: Shell,
    },
    /// Write manual pages into a folder, one per command
    Man {
        /// The folder; it is created if it does not exist
        folder: PathBuf,
    },
}

impl SetupCommand {
    pub fn run(self) -> Result<Outcome, Failure> {
        match self {
            Self::Completions { shell } => {
                let mut text = Vec::new();
                clap_complete::generate(shell, &mut Cli::command(), NAME, &mut text);
                output::plain(text)
            }
            Self::Man { folder } => {
                let mut command = help::with_examples_alone(Cli::command());
                command.build();
                let mut made = Vec::new();
                pages(&command, &mut made)?;
                let files: Vec<_> = made.iter().map(|(name, page)| (Path::new(name), Content::Bytes(page))).collect();
                output::write_folder(&folder, &files)?;
                output::say(&format!("the pages are in {}", folder.display()));
                Ok(Outcome::Done)
            }
        }
    }
}

fn pages(command: &Command, made: &mut Vec<(String, Vec<u8>)>) -> Result<(), Failure> {
    let name = command.get_display_name().unwrap_or_else(|| command.get_name()).to_owned();
    let mut page = Vec::new();
    clap_mangen::Man::new(command.clone()).date("").render(&mut page)?;
    made.push((format!("{name}.1"), page));
    command.get_subcommands().filter(|inner| inner.get_name() != "help").try_for_each(|inner| pages(inner, made))
}

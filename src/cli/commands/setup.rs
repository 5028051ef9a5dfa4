//! `setup`: settings, completions and manual pages of this program.

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use clap::CommandFactory as _;
use clap_complete::Shell;
use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::config::{self, Setting};
use crate::cli::{Cli, Failure, NAME, Outcome, help, output};
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::replace::Content;
use mirrorstats_tables::Table;

/// Show settings, write completions of a shell and manual pages
#[derive(Debug, clap::Subcommand)]
pub enum SetupCommand {
    Config(ConfigArgs),
    Completions(CompletionsArgs),
    Man(ManArgs),
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

/// Show the defaults that hold here, and where they come from
///
/// Any option can have a default in `mirrorstats.toml`, in this folder or above it: `threads = 2` holds for every command
/// that has `--threads`, `out = "runs"` below `[record]` for `record` alone. `MIRRORSTATS_CONFIG_FILE` names another file, or none
/// where it is empty. In the environment the same are `MIRRORSTATS_THREADS` and `MIRRORSTATS_RECORD_OUT`. What is typed comes
/// first, then the environment, then the file. `MIRRORSTATS_ERRORS=json` is `--errors json`.
#[derive(Clone, Debug, clap::Args)]
pub struct ConfigArgs {
    /// Print the settings as JSON
    #[arg(long)]
    json: bool,
}

/// The answer of `config --json`.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ConfigAnswer {
    /// The configuration file that was read, if there is one.
    pub file: Option<String>,
    /// Every default that it or the environment sets.
    pub settings: Vec<Setting>,
    /// Variables that begin with `MIRRORSTATS_` and set nothing, as misspelt ones do.
    pub unknown_variables: Vec<String>,
}

impl ConfigArgs {
    pub fn run(self) -> Result<Outcome, Failure> {
        let command = Cli::command();
        let config::Settings { file, all } = config::load(&command)?;
        let unknown = config::unknown_variables(&command);
        if self.json {
            return output::print_json(&ConfigAnswer {
                file,
                settings: all,
                unknown_variables: unknown.into_iter().map(|(name, _)| name).collect(),
            });
        }
        for (name, near) in unknown {
            let hint = near.map_or_else(String::new, |near| format!("; did you mean {near}?"));
            output::note(&format!("the variable {name} sets nothing: no command has such an option{hint}"));
        }
        let mut out = io::stdout().lock();
        match &file {
            Some(file) => writeln!(out, "configuration file: {}", visible(file))?,
            None => writeln!(out, "no configuration file: mirrorstats.toml, in this folder or above it, would be one")?,
        }
        if all.is_empty() {
            writeln!(out, "no option has another default than the one that its --help tells")?;
            return Ok(Outcome::Done);
        }
        let mut table = Table::of_texts(["command", "option", "default", "from"]);
        for setting in &all {
            table.push([
                setting.command.clone().unwrap_or_else(|| "all that have it".to_owned()),
                format!("--{}", setting.option),
                setting.values.join(","),
                setting.origin.to_string(),
            ]);
        }
        write!(out, "{}", table.within(None))?;
        Ok(Outcome::Done)
    }
}

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
        output::plain(text)
    }
}

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

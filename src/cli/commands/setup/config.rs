//! `mirrorstats setup config`: the defaults in effect.

use std::io::{self, Write as _};

use clap::CommandFactory as _;
use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::config::{self, Setting};
use crate::cli::outcome::{Failure, Outcome};
use crate::cli::{Cli, output};
use exact::escape::visible;
use report::tables::Table;

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

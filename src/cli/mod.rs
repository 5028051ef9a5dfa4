//! The command line: the only room with clap, standard output and exit codes.
//!
//! `args` is what was typed and what several verbs share; `commands/<verb>.rs` is one thin file per verb;
//! `outcome` maps what happened to an exit code, in one place.

pub mod args;
pub mod commands;
#[cfg(feature = "sim")]
pub mod dry_run;
#[cfg(feature = "sim")]
pub mod exec;
mod experiments;
pub mod outcome;
pub mod output;
pub mod quality;
#[cfg(feature = "sim")]
pub mod recording;
#[cfg(feature = "sim")]
mod registration;
pub mod scoring;
pub mod spark;
mod terminal;
mod text_table;
#[cfg(feature = "sim")]
pub mod vlm;

use std::ffi::OsString;
use std::io::{self, Write as _};
use std::process::ExitCode;

use clap::Parser;

use crate::base::budget;
use commands::Command;
use outcome::{Failure, Outcome};

/// Score mirror self-recognition episodes: step traces in, exact metrics, tables and reports out.
#[derive(Debug, Parser)]
#[command(name = "mirrorstats", version, propagate_version = true, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

/// Runs the program with these arguments, the program's name first.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    match Cli::try_parse_from(arguments) {
        Ok(cli) => outcome::exit_code(budget_setting().and_then(|()| cli.command.run()).and_then(flushed)),
        Err(usage) => {
            // Help and version arrive here too; clap knows which stream and code each one takes.
            outcome::exit_code(match usage.print() {
                Err(error) => Err(Failure::Output(error)),
                Ok(()) if usage.exit_code() == 0 => flushed(Outcome::Done),
                Ok(()) => Err(Failure::Usage),
            })
        }
    }
}

/// Refuses a factor of all budgets that is none before anything is read.
fn budget_setting() -> Result<(), Failure> {
    budget::setting().map(drop).map_err(Failure::input)
}

/// The outcome, once all of standard output is out: what is left in its buffer at the end is written without a word
/// about a full disk.
fn flushed(outcome: Outcome) -> Result<Outcome, Failure> {
    io::stdout().flush()?;
    Ok(outcome)
}

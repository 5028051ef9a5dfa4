//! The command line: the only module with clap, standard output and exit codes.
//!
//! `typed` holds the arguments, including those shared by several commands. `commands` has one thin file per command.
//! `outcome` maps results to exit codes, in one place.

mod answers;
pub mod commands;
mod config;
mod features;
mod help;
mod outcome;
mod output;
#[cfg(feature = "sim")]
mod recording;
mod terminal;
mod typed;
mod usage;

use std::ffi::OsString;
use std::io::{self, Write as _};
use std::process::ExitCode;

use clap::{CommandFactory as _, FromArgMatches as _, Parser};

use commands::Command;
use mirrorstats_exact::budget;
use mirrorstats_exact::escape::visible;
use mirrorstats_trace::catch_panic::caught;
use outcome::{ErrorFormat, Outcome};

pub use answers::{printed_schema, schemas};
pub use outcome::{ErrorAnswer, Failure};
#[cfg(all(feature = "sim", feature = "view"))]
use recording::human;
#[cfg(feature = "sim")]
use recording::{dry_run, exec, registration, vlm};
#[cfg(feature = "sim")]
pub use typed::options::{Options, option_names, options_of};
use typed::{args, experiments, scoring};

pub(crate) const NAME: &str = "mirrorstats";

/// Score mirror self-recognition episodes: traces in, exact metrics and reports out.
#[derive(Debug, Parser)]
#[command(name = NAME, version, long_version = long_version(), propagate_version = true, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// The form of errors: `text`, in words, or `json`, one object
    #[arg(
        long,
        global = true,
        value_name = "FORMAT",
        default_value = "text",
        hide_possible_values = true,
        help_heading = "Options of all commands"
    )]
    errors: ErrorFormat,
}

fn long_version() -> String {
    format!("{}\nfeatures: {}", env!("CARGO_PKG_VERSION"), features::present())
}

/// Runs the program with these arguments, which start with the program's name.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    let _ = fail_at_file_size_limit();
    ExitCode::from(run_to_code(arguments))
}

/// Makes a write beyond the file size limit fail with an error, instead of ending the process.
#[cfg(unix)]
fn fail_at_file_size_limit() -> io::Result<()> {
    use signal_hook::consts::SIGXFSZ;
    signal_hook::flag::register(SIGXFSZ, std::sync::Arc::default()).map(drop)
}

#[cfg(not(unix))]
fn fail_at_file_size_limit() -> io::Result<()> {
    Ok(())
}

/// Like [`run`], but returns the code as a number, for a process that belongs to a caller.
pub fn run_to_code(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    let format = ErrorFormat::asked_for(&arguments);
    let answer = caught(|| execute(arguments.clone())).unwrap_or_else(|fault| Err(Failure::Panic(fault)));
    let answer = answer.map_err(|failure| scoring::with_commands(failure, &arguments));
    let code = outcome::exit_code(answer.and_then(flushed), format);
    // Show what was printed before a failure.
    let _ = io::stdout().flush();
    code
}

fn execute(arguments: Vec<OsString>) -> Result<Outcome, Failure> {
    let command = help::with_help(Cli::command());
    let settings = config::load(&command);
    let command = config::with_defaults(command, "", settings.as_deref().unwrap_or_default());
    let parse = |arguments: Vec<OsString>| {
        let matches = command.clone().try_get_matches_from(arguments)?;
        Cli::from_arg_matches(&matches)
    };
    let spelled: Vec<OsString> = arguments.iter().map(|typed| visible(&typed.to_string_lossy()).into()).collect();
    let parsed = match parse(arguments) {
        // A message repeats the typed text, which must not act on the terminal.
        Err(error) if error.exit_code() != 0 => Err(parse(spelled).err().unwrap_or(error)),
        parsed => parsed,
    };
    match parsed {
        Ok(cli) if cli.command.needs_no_settings() => cli.command.run(),
        Ok(cli) => settings.and_then(|_| budget_setting()).and_then(|()| cli.command.run()),
        // Help and version come here too; clap knows the stream and exit code of each.
        Err(answer) if answer.exit_code() == 0 => answer.print().map(|()| Outcome::Done).map_err(Failure::Output),
        Err(error) => Err(Failure::Usage(Box::new(usage::with_tips(error, &command)))),
    }
}

fn budget_setting() -> Result<(), Failure> {
    budget::setting().map(drop).map_err(Failure::input)
}

/// The outcome, after flushing standard output: otherwise an error such as a full disk would go unnoticed at the end.
fn flushed(outcome: Outcome) -> Result<Outcome, Failure> {
    io::stdout().flush()?;
    Ok(outcome)
}

//! The command line: the only module with clap, standard output and exit codes.
//!
//! `commands` has one file per command, which parses, calls the library once and prints. `args` has the arguments that
//! several commands share. `outcome` maps results to exit codes, in one place.

mod answers;
mod args;
pub mod commands;
mod config;
mod help;
#[cfg(feature = "sim")]
mod options;
mod outcome;
mod output;
mod own_definitions;
mod registered;
mod terminal;
mod usage;

use std::ffi::OsString;
use std::io::{self, Write as _};

use clap::{CommandFactory as _, FromArgMatches as _, Parser};

use commands::Command;
use mirrorstats_exact::budget;
use mirrorstats_exact::escape::visible;
use mirrorstats_trace::catch_panic;
use outcome::ErrorFormat;

pub use answers::{printed_schema, schemas};
#[cfg(feature = "sim")]
pub use options::{Options, option_names, options_of};
pub use outcome::{ErrorAnswer, Failure, Outcome};

pub(crate) const NAME: &str = "mirrorstats";

/// Score mirror self-recognition episodes: traces in, exact metrics and reports out.
#[derive(Debug, Parser)]
#[command(name = NAME, version, long_version = usage::long_version(), propagate_version = true, max_term_width = 100)]
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

/// A command line as typed. The first argument is the program's name.
#[derive(Clone, Debug)]
pub struct CommandLine {
    arguments: Vec<OsString>,
    errors: ErrorFormat,
}

impl CommandLine {
    pub fn new(arguments: impl IntoIterator<Item = OsString>) -> Self {
        let arguments: Vec<OsString> = arguments.into_iter().collect();
        let errors = ErrorFormat::asked_for(&arguments);
        Self { arguments, errors }
    }

    /// Parses the arguments with the defaults of the settings file. Help and version are failures without an error.
    pub fn parse(&self) -> Result<Command, Failure> {
        let command = help::with_help(Cli::command());
        let settings = config::load(&command);
        let command = config::with_defaults(command, "", settings.as_deref().unwrap_or_default());
        let parse = |arguments: &[OsString]| {
            let matches = command.clone().try_get_matches_from(arguments)?;
            Cli::from_arg_matches(&matches)
        };
        let parsed = parse(&self.arguments).map_err(|error| {
            if error.exit_code() == 0 {
                return error;
            }
            // A message repeats the typed text, which must not act on the terminal.
            let spelled: Vec<_> = self.arguments.iter().map(|typed| visible(&typed.to_string_lossy()).into()).collect();
            usage::with_tips(parse(&spelled).err().unwrap_or(error), &command)
        });
        let cli = parsed.map_err(|error| Failure::Usage(Box::new(error)))?;
        if !cli.command.needs_no_settings() {
            settings?;
            budget::setting().map_err(Failure::input)?;
        }
        Ok(cli.command)
    }

    /// Prints a failure and returns the exit code.
    pub fn exit_code(&self, outcome: Result<Outcome, Failure>) -> u8 {
        // Otherwise an error such as a full disk would go unnoticed at the end.
        let flushed = |outcome| io::stdout().flush().map(|()| outcome).map_err(Failure::Output);
        let outcome =
            outcome.and_then(flushed).map_err(|failure| own_definitions::with_commands(failure, &self.arguments));
        let code = outcome::exit_code(outcome, self.errors);
        // Show what was printed before a failure.
        let _ = io::stdout().flush();
        code
    }
}

/// Runs a command; a panic becomes a failure.
pub fn caught(run: impl FnOnce() -> Result<Outcome, Failure>) -> Result<Outcome, Failure> {
    catch_panic::caught(run).unwrap_or_else(|fault| Err(Failure::Panic(fault)))
}

/// Makes a write beyond the file size limit fail with an error, instead of ending the process.
pub fn fail_at_file_size_limit() {
    #[cfg(unix)]
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, std::sync::Arc::default());
}

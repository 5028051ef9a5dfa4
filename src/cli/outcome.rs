//! The outcomes of a command and their exit codes; `docs/reference/environment.md` lists them.

use std::error::Error;
use std::ffi::OsString;
use std::fmt::{self, Write as _};
use std::io::{self, Write as _};

use schemars::JsonSchema;
use serde::Serialize;

use mirrorstats_exact::escape::visible_lines;
use mirrorstats_study::StudyError;
use mirrorstats_toml_spec::{FaultRecord, Faults};
use mirrorstats_trace::diagnostic::{MORE_FILES, is_short_of_files};
#[cfg(feature = "view")]
use mirrorstats_view::ViewError;

/// The form of errors if no option sets it; read before anything is parsed.
pub const ERRORS_VARIABLE: &str = "MIRRORSTATS_ERRORS";
const BAD_INPUT: u8 = 2;
/// As Rust's own after a panic.
const PANIC: u8 = 101;

/// The outcome of a command that ran to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The command did everything requested.
    Done,
    /// The requested check failed; the failures are on standard output.
    CheckFailed,
    /// Part of the input is lost; the rest was saved.
    Lossy,
    /// There are too few episodes for a requested verdict.
    CannotSay,
    /// The episodes to compare were recorded differently.
    NotComparable,
    /// Ctrl-C ended it; finished work stays, and the same command continues.
    Interrupted,
}

/// The error of a command that could not run to its end.
#[derive(Debug)]
pub enum Failure {
    Usage(Box<clap::Error>),
    Output(io::Error),
    Input(Box<dyn Error + Send + Sync>),
    Panic(String),
    Faults(Faults),
}

impl Failure {
    pub fn input(error: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::Input(error.into())
    }

    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::Output(error) => Some(error),
            Self::Input(error) => error.source(),
            Self::Usage(_) | Self::Panic(_) | Self::Faults(_) => None,
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Usage(_) => f.write_str("bad usage"),
            Self::Output(_) => f.write_str("cannot write the output"),
            Self::Input(error) => error.fmt(f),
            Self::Panic(fault) => {
                let help = "is there enough memory? If so, report the command and this message";
                write!(f, "internal error: {fault}\n  help: {help}")
            }
            Self::Faults(faults) => faults.fmt(f),
        }
    }
}

/// The only place that says what an error of the library is on the command line.
impl<E: Error + Send + Sync + 'static> From<E> for Failure {
    fn from(error: E) -> Self {
        if let Some(faults) = Faults::of(&error) {
            return Self::Faults(faults.clone());
        }
        let error: Box<dyn Error + Send + Sync> = Box::new(error);
        #[cfg(feature = "view")]
        let error: Box<dyn Error + Send + Sync> = match error.downcast::<ViewError>().map(|error| *error) {
            Ok(ViewError::Study(error)) => error,
            Ok(error) => Box::new(error),
            Err(error) => error,
        };
        match error.downcast::<StudyError>() {
            Ok(error) => error.into_io().map_or_else(Self::input, Self::Output),
            Err(error) => error.downcast::<io::Error>().map_or_else(Self::Input, |error| Self::Output(*error)),
        }
    }
}

/// The form of errors: in words for people, or for programs as one object on one line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum ErrorFormat {
    #[default]
    Text,
    Json,
}

impl ErrorFormat {
    /// The requested form, found without parsing: the arguments may be invalid.
    pub fn asked_for(arguments: &[OsString]) -> Self {
        let typed = arguments.windows(2).any(|pair| pair[0] == "--errors" && pair[1] == "json");
        let is_json = typed || arguments.iter().any(|argument| argument == "--errors=json");
        let is_text = arguments.windows(2).any(|pair| pair[0] == "--errors" && pair[1] == "text");
        let in_environment = std::env::var_os(ERRORS_VARIABLE).is_some_and(|value| value == "json");
        if is_json || (in_environment && !is_text) { Self::Json } else { Self::Text }
    }
}

/// An error as a program reads it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ErrorAnswer {
    /// Problem, location, expected, found, remedy; may have several lines.
    pub error: String,
    /// The exit code.
    pub code: u8,
    /// Each fault of a text, with its place.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub faults: Vec<FaultRecord>,
}

impl ErrorAnswer {
    pub fn of(failure: &Failure) -> Self {
        let faults = if let Failure::Faults(faults) = failure { faults.records() } else { Vec::new() };
        let text = words(failure, false);
        Self { error: text.trim_end().trim_start_matches("error: ").to_owned(), code: failure_code(failure), faults }
    }
}

const fn failure_code(failure: &Failure) -> u8 {
    if matches!(failure, Failure::Panic(_)) { PANIC } else { BAD_INPUT }
}

/// Prints a failure on standard error and returns the exit code.
pub fn exit_code(result: Result<Outcome, Failure>, format: ErrorFormat) -> u8 {
    match result {
        Ok(Outcome::Done) => 0,
        Ok(Outcome::CheckFailed) => 1,
        Ok(Outcome::Lossy) => 3,
        Ok(Outcome::CannotSay) => 4,
        Ok(Outcome::NotComparable) => 5,
        Ok(Outcome::Interrupted) => 130,
        // Help and version come here too; clap knows the stream of each.
        Err(Failure::Usage(help)) if help.exit_code() == 0 => {
            exit_code(help.print().map(|()| Outcome::Done).map_err(Failure::Output), format)
        }
        // The reader of a pipe may stop early (`| head`): not an error.
        Err(Failure::Output(error)) if error.kind() == io::ErrorKind::BrokenPipe => 0,
        Err(failure) => {
            say(&failure, format);
            failure_code(&failure)
        }
    }
}

fn say(failure: &Failure, format: ErrorFormat) {
    // If standard error is closed, the message cannot be shown.
    let _ = match (failure, format) {
        (Failure::Usage(error), ErrorFormat::Text) if colored() => write!(io::stderr(), "{}", error.render().ansi()),
        (failure, ErrorFormat::Text) => writeln!(io::stderr(), "{}", words(failure, colored()).trim_end()),
        (failure, ErrorFormat::Json) => {
            let answer = ErrorAnswer::of(failure);
            serde_json::to_string(&answer).map_err(io::Error::from).and_then(|line| writeln!(io::stderr(), "{line}"))
        }
    };
}

fn words(failure: &Failure, colored: bool) -> String {
    let mut text = match failure {
        Failure::Usage(error) => visible_lines(&error.to_string()),
        Failure::Faults(faults) => faults.render(colored),
        other => visible_lines(&format!("error: {other}")),
    };
    let mut cause = failure.source();
    while let Some(error) = cause {
        let words = visible_lines(&error.to_string());
        // Some messages include their cause.
        if !text.contains(&words) {
            let _ = write!(text, "\n  caused by: {words}");
        }
        cause = error.source();
    }
    if is_short_of_files(&text) && !text.contains(MORE_FILES) {
        let _ = write!(text, "\n  help: {MORE_FILES}");
    }
    text
}

fn colored() -> bool {
    io::IsTerminal::is_terminal(&io::stderr()) && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}

//! How a command ends, and the exit code for it.
//!
//! | code | meaning |
//! |---|---|
//! | 0 | done |
//! | 1 | a check that was asked for did not hold (`validate`, `compare`, `audit`, `verify`) |
//! | 2 | bad usage, input or definition |
//! | 3 | something of the input is lost (`recover`); the rest was saved |
//! | 130 | interrupted (`record`); what was done stays |

use std::error::Error;
use std::fmt::Write as _;
use std::io::{self, Write as _};
use std::process::ExitCode;

use crate::base::escape::visible_lines;

/// A command that ran to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Everything asked for was done.
    Done,
    /// The check that was asked for did not hold; what did not is on standard output.
    CheckFailed,
    /// Something of the input is lost; the rest was saved.
    Lossy,
    /// Ctrl-C ended it; what was done until then stays, and the same command continues.
    Interrupted,
}

/// A command that could not run to its end.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The command line itself; clap has said what is wrong.
    #[error("bad usage")]
    Usage,
    /// Output could not be written.
    #[error("cannot write the output")]
    Output(#[from] io::Error),
    /// Input or definitions are not as they must be. The message is complete: what, where, expected, found, remedy.
    #[error(transparent)]
    Input(Box<dyn Error + Send + Sync>),
    /// A message that already has its own layout.
    #[error("{0}")]
    Rendered(String),
    /// Faults of definitions, underlined, with colours where standard error shows them.
    #[error("{0}")]
    Faults(String),
}

impl Failure {
    /// Input that is not as it must be.
    pub fn input(error: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::Input(error.into())
    }
}

/// Says what went wrong on standard error and gives the code to leave with.
pub fn exit_code(result: Result<Outcome, Failure>) -> ExitCode {
    match result {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::CheckFailed) => ExitCode::from(1),
        Ok(Outcome::Lossy) => ExitCode::from(3),
        Ok(Outcome::Interrupted) => ExitCode::from(130),
        // The reader of a pipe has seen enough (`| head`): not an error.
        Err(Failure::Output(error)) if error.kind() == io::ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        Err(Failure::Usage) => ExitCode::from(2),
        Err(failure) => {
            say(&failure);
            ExitCode::from(2)
        }
    }
}

fn say(failure: &Failure) {
    let mut text = match failure {
        Failure::Faults(text) => text.clone(),
        Failure::Rendered(text) => visible_lines(text),
        other => visible_lines(&format!("error: {other}")),
    };
    let mut cause = failure.source();
    while let Some(error) = cause {
        let words = visible_lines(&error.to_string());
        // Some messages tell their cause themselves.
        if !text.contains(&words) {
            let _ = write!(text, "\n  caused by: {words}");
        }
        cause = error.source();
    }
    // With standard error closed there is nobody left to tell.
    let _ = writeln!(io::stderr(), "{}", text.trim_end());
}

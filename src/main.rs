//! The `mirrorstats` program: a command line becomes a command, the command an outcome, the outcome an exit code.

use std::process::ExitCode;

use mirrorstats::cli::{self, CommandLine};

fn main() -> ExitCode {
    cli::fail_at_file_size_limit();
    let line = CommandLine::new(std::env::args_os());
    let outcome = cli::caught(|| line.parse()?.run());
    ExitCode::from(line.exit_code(outcome))
}

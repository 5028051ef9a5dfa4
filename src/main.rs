//! The `mirrorstats` program: parse, call, exit.

use std::process::ExitCode;

fn main() -> ExitCode {
    mirrorstats::cli::run(std::env::args_os())
}

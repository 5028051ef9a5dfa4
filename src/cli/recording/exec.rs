//! A program as an agent: its arguments and its player.

use std::path::Path;
use std::time::Duration;

use crate::cli::Failure;
use mirrorstats_agents::exec::{Exec, ExecSettings, Images};
use mirrorstats_record::lock::parts_of;

/// The folder inside a recording's folder for the standard error of programs.
const STANDARD_ERROR: &str = "stderr";

/// The arguments for a program of one's own.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "With --agent exec:'CMD'")]
pub struct ExecArgs {
    /// How the program gets frames
    #[arg(long, value_enum, default_value_t)]
    exec_images: ExecImages,
    /// Seconds for one reply; the first includes the program's start
    #[arg(long, value_name = "SECONDS", default_value_t = 180, value_parser = clap::value_parser!(u64).range(1..=86_400))]
    exec_timeout: u64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
enum ExecImages {
    /// A PNG file, kept until the episode ends
    #[default]
    Path,
    /// PNG in base64, in the line
    Base64,
}

impl ExecArgs {
    /// The player that runs a command; its name in tables is `model`. Recordings go into `out`.
    pub fn player(&self, command: &str, model: Option<&str>, out: &Path) -> Result<Exec, Failure> {
        if command.trim().is_empty() {
            return Err(Failure::input("--agent exec: needs a command, such as --agent exec:'python3 agent.py'"));
        }
        let images = match self.exec_images {
            ExecImages::Path => Images::Path,
            ExecImages::Base64 => Images::Base64,
        };
        Exec::new(ExecSettings {
            model: model.unwrap_or("exec").to_owned(),
            command: command.to_owned(),
            images,
            timeout: Duration::from_secs(self.exec_timeout),
            scratch: parts_of(out),
            standard_error: out.join(STANDARD_ERROR),
        })
        .map_err(Failure::input)
    }
}

//! `mirrorstats table verify`: checks a report's files against its manifest.

use std::path::PathBuf;

use crate::cli::outcome::{Failure, Outcome};
use crate::cli::output;
use study::verify::verify;

/// Hold the files of a report against the hashes in its manifest
///
/// Names every file that was changed, is missing, or is there though the manifest does not list it, and exits with 1 then.
/// The manifest itself is taken at its word.
#[derive(Clone, Debug, clap::Args)]
pub struct VerifyArgs {
    /// The folder of a report
    #[arg(value_name = "REPORT")]
    report: PathBuf,
    /// Answer as JSON
    #[arg(long)]
    json: bool,
}

impl VerifyArgs {
    pub fn run(&self) -> Result<Outcome, Failure> {
        let found = verify(&self.report).map_err(Failure::input)?;
        output::print(&found, self.json)?;
        Ok(if found.holds() { Outcome::Done } else { Outcome::CheckFailed })
    }
}

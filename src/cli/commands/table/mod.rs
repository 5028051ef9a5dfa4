//! `table`: published tables, and the folders of reports.

pub mod audit;
pub mod compare;
pub mod rescore;

use std::path::PathBuf;

use crate::cli::{Failure, Outcome, output};
use mirrorstats_study::verify::verify;

/// Compare and audit published tables; verify and rescore reports
#[derive(Debug, clap::Subcommand)]
pub enum TableCommand {
    Compare(compare::CompareArgs),
    Audit(audit::AuditArgs),
    /// Hold the files of a report against the hashes in its manifest
    ///
    /// Names every file that was changed, is missing, or is there though the manifest does not list it, and exits with 1
    /// then. The manifest itself is taken at its word.
    Verify {
        /// The folder of a report
        #[arg(value_name = "REPORT")]
        report: PathBuf,
        /// Answer as JSON
        #[arg(long)]
        json: bool,
    },
    Rescore(rescore::RescoreArgs),
}

impl TableCommand {
    pub fn run(self) -> Result<Outcome, Failure> {
        match self {
            Self::Compare(args) => args.run(),
            Self::Audit(args) => args.run(),
            Self::Verify { report, json } => {
                let found = verify(&report)?;
                output::print(&found, json)?;
                Ok(if found.holds() { Outcome::Done } else { Outcome::CheckFailed })
            }
            Self::Rescore(args) => args.run(),
        }
    }
}

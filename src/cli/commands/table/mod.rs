//! `table`: published tables, and the folders of reports.

pub mod audit;
pub mod compare;
pub mod rescore;
pub mod verify;

use crate::cli::outcome::{Failure, Outcome};

/// Compare and audit published tables; verify and rescore reports
#[derive(Debug, clap::Subcommand)]
pub enum TableCommand {
    Compare(compare::CompareArgs),
    Audit(audit::AuditArgs),
    Verify(verify::VerifyArgs),
    Rescore(rescore::RescoreArgs),
}

impl TableCommand {
    pub fn run(self) -> Result<Outcome, Failure> {
        match self {
            Self::Compare(args) => args.run(),
            Self::Audit(args) => args.run(),
            Self::Verify(args) => args.run(),
            Self::Rescore(args) => args.run(),
        }
    }
}

//! `table`: published tables, and reports made again.

pub mod audit;
pub mod compare;
pub mod rescore;

use crate::cli::{Failure, Outcome};

/// Compare and audit published tables; rescore reports
#[derive(Debug, clap::Subcommand)]
pub enum TableCommand {
    Compare(compare::CompareArgs),
    Audit(audit::AuditArgs),
    Rescore(rescore::RescoreArgs),
}

impl TableCommand {
    pub fn run(self) -> Result<Outcome, Failure> {
        match self {
            Self::Compare(args) => args.run(),
            Self::Audit(args) => args.run(),
            Self::Rescore(args) => args.run(),
        }
    }
}

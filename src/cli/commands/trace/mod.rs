//! `trace`: inspects, checks and rewrites traces, and lists the labels of coders; `import` makes a trace.

pub mod check;
pub mod import;
pub mod info;
pub mod labels;
pub mod recover;
pub mod schema;
pub mod seal;
pub mod validate;

use crate::cli::{Failure, Outcome};

/// Inspect, check and rewrite traces; their schema
#[derive(Debug, clap::Subcommand)]
pub enum TraceCommand {
    Info(info::InfoCommand),
    Labels(labels::LabelsArgs),
    Validate(validate::ValidateCommand),
    Check(check::CheckArgs),
    Recover(recover::RecoverArgs),
    Schema(schema::SchemaCommand),
    Seal(seal::SealArgs),
}

impl TraceCommand {
    pub fn run(self) -> Result<Outcome, Failure> {
        match self {
            Self::Info(args) => args.run(),
            Self::Labels(args) => args.run(),
            Self::Validate(args) => args.run(),
            Self::Check(args) => args.run(),
            Self::Recover(args) => args.run(),
            Self::Schema(args) => args.run(),
            Self::Seal(args) => args.run(),
        }
    }
}

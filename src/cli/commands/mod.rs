//! The verbs: one file each.

pub mod compare;
pub mod definitions;
pub mod report;
pub mod score;

use super::args::ScoringArgs;
use super::outcome::{Failure, Outcome};
use super::scoring;

/// What to do.
#[derive(Debug, clap::Subcommand)]
#[expect(missing_docs, reason = "the words of each verb stand with its arguments")]
pub enum Command {
    Report(report::ReportArgs),
    Score(score::ScoreArgs),
    Compare(compare::CompareArgs),
    Definitions(definitions::DefinitionsArgs),
}

impl Command {
    /// Does it.
    ///
    /// # Errors
    /// Whatever keeps the command from running to its end.
    pub fn run(self) -> Result<Outcome, Failure> {
        match self {
            Self::Report(args) => args.run(),
            Self::Score(args) => args.run(),
            Self::Compare(args) => args.run(|traces| {
                scoring::table(&scoring::resolve(traces)?, &ScoringArgs::default(), &[], traces.threads.count())
            }),
            Self::Definitions(args) => args.run(),
        }
    }
}

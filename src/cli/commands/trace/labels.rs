//! `mirrorstats trace labels`: the labels of coders, and their agreement.

use crate::cli::args::{GroupingArgs, ScoringArgs, TraceArgs};
use crate::cli::{Failure, Outcome, output, terminal};
use mirrorstats_study::agreement::agreement;

const CONFIDENCE: f64 = 0.95;

/// List the labels of coders, and the agreement of two coders: Cohen's kappa
///
/// Labels are in `labels.jsonl` beside the traces; `mirrorstats view --label NAME` writes them.
#[derive(Clone, Debug, clap::Args)]
pub struct LabelsArgs {
    #[command(flatten)]
    input: TraceArgs,
    /// Only episodes where this holds, in the language of definitions
    #[arg(long = "where", value_name = "EXPR")]
    condition: Option<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl LabelsArgs {
    pub fn run(self) -> Result<Outcome, Failure> {
        let scoring = ScoringArgs { condition: self.condition, ..ScoringArgs::default() };
        let study = self.input.study(&scoring, &GroupingArgs::default())?;
        let found = agreement(&study, CONFIDENCE)?;
        output::print_rendered(&found, self.json, |found| found.render(terminal::width()))
    }
}

//! `mirrorstats trace labels`: the labels of coders, and their agreement.

use crate::cli::args::{GroupingArgs, ScoringArgs, TraceArgs};
use crate::cli::{Failure, Outcome, output, terminal};
use mirrorstats_exact::format::{counted, fixed};
use mirrorstats_study::agreement::{LabelAgreement, PairAgreement, agreement};
use mirrorstats_tables::Table;

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
        output::print_rendered(&found, self.json, |found| text(found, terminal::width()))
    }
}

fn text(found: &LabelAgreement, width: Option<usize>) -> String {
    let mut parts = vec![format!("{} of {} coded\n", found.coded, counted(found.episodes, "episode"))];
    if found.elsewhere > 0 {
        let elsewhere = counted(found.elsewhere, "episode");
        parts.push(format!("{elsewhere} more coded, which the traces lack or --where leaves out\n"));
    }
    let coders = found.coders.iter().map(|coder| [coder.coder.clone(), coder.episodes.to_string()]);
    let labels = found.labels.iter().map(|label| [label.label.clone(), label.episodes.to_string()]);
    for (title, table) in [
        ("", Table::of_texts(["coder", "episodes"]).aligned_right([1]).with(coders)),
        ("", Table::of_texts(["label", "episodes"]).aligned_right([1]).with(labels)),
        ("agreement of two coders\n", pairs(&found.agreement)),
    ] {
        if !table.is_empty() {
            parts.push(format!("\n{title}{}", table.within(width)));
        }
    }
    if found.coders.len() == 1 {
        parts.push("\nOne coder: agreement needs a second one on the same episodes.\n".to_owned());
    }
    parts.concat()
}

fn pairs(pairs: &[PairAgreement]) -> Table {
    let header =
        ["label", "coders", "n", "both", "first only", "second only", "neither", "agree", "kappa", "95 % interval"];
    let rows = pairs.iter().map(|pair| {
        let counts = pair.counts;
        let shown = pair
            .interval
            .map(|interval| format!("[{}, {}]", fixed(Some(interval.low), 2), fixed(Some(interval.high), 2)));
        let why = pair.cannot_say.as_ref().map(|why| format!("cannot say: {why}"));
        [
            pair.label.clone(),
            pair.coders.join(", "),
            pair.n.to_string(),
            counts.both.to_string(),
            counts.first_only.to_string(),
            counts.second_only.to_string(),
            counts.neither.to_string(),
            fixed(pair.agreement, 2),
            fixed(pair.kappa, 2),
            shown.or(why).unwrap_or_default(),
        ]
    });
    Table::of_texts(header).aligned_right(2..=8).with(rows)
}

//! `mirrorstats gate`: compares new episodes with old ones; each verdict has an exit code.

use std::ffi::OsString;

use crate::cli::args::{Described, GroupingArgs, ScoringArgs, ThreadArgs, TraceArgs, described, number};
use crate::cli::{Failure, Outcome, output, terminal};
use mirrorstats_analysis::gate::{GateFormat, GateOptions, GateVerdict};
use mirrorstats_study::gate::{gate, leading_metric};
use mirrorstats_study::pairs::claimed;

/// Compare new episodes with old ones: improved, held, regressed, cannot say
///
/// Each experiment and model gets one verdict. It is `held` if a loss of the margin or more is excluded, and `regressed` if the
/// new episodes are worse and a loss of the margin is not excluded. If each side has one model, the model may change its name.
///
/// Exit codes: 0 all improved or held; 1 a regression; 5 not comparable; 4 cannot say; 2 bad usage or input. A regression comes
/// before not comparable, which comes before cannot say.
#[derive(Clone, Debug, clap::Args)]
pub struct GateArgs {
    /// The old episodes: a trace, a folder, a quoted glob or a file of scores
    #[arg(value_name = "BASE")]
    pub base: OsString,
    /// The new episodes
    #[arg(value_name = "NEW")]
    pub new: OsString,
    /// The metric to compare [default: the first metric of the definitions with a better direction]
    #[arg(long, value_name = "METRIC")]
    pub metric: Option<String>,
    /// The largest acceptable loss, in the unit of the metric
    #[arg(long, value_name = "LOSS", default_value_t = 0.1, value_parser = margin)]
    pub margin: f64,
    /// The confidence of all verdicts together
    #[arg(long, value_name = "LEVEL", default_value = "0.95", value_parser = super::stats::confidence)]
    pub confidence: f64,
    /// Definitions: `paper`, `extended`, or a TOML file [default: those that the traces name, else paper]
    #[arg(long, value_name = "NAME|FILE")]
    pub definitions: Option<std::path::PathBuf>,
    /// Only episodes where this holds, in the language of definitions
    #[arg(long = "where", value_name = "EXPR")]
    pub condition: Option<String>,
    /// Compare episodes even if their settings differ, such as the world or the prompts
    #[arg(long)]
    pub pool: bool,
    /// Output format
    #[arg(long, value_parser = described(&FORMATS), default_value = FORMATS[0].1)]
    pub format: Format,
    #[command(flatten)]
    pub threads: ThreadArgs,
}

/// The form of the answer; JSON if `None`.
type Format = Option<GateFormat>;

const FORMATS: [Described<Format>; 5] = [
    (Some(GateFormat::Text(None)), "text", "A table, then the flipped episodes"),
    (Some(GateFormat::Markdown), "md", "Markdown"),
    (Some(GateFormat::Github), "github", "Workflow commands of GitHub Actions"),
    (Some(GateFormat::Junit), "junit", "`JUnit` XML"),
    (None, "json", "JSON: schemas/gate.schema.json"),
];

impl GateArgs {
    pub fn run(self) -> Result<Outcome, Failure> {
        let side = |name: &OsString| TraceArgs { traces: vec![name.clone()], threads: self.threads };
        let scoring =
            ScoringArgs { definitions: self.definitions.clone(), metrics: None, condition: self.condition.clone() };
        let grouping = GroupingArgs { pool: self.pool, ..GroupingArgs::default() };
        let open = |name| side(name).study(&scoring, &grouping);
        let (base, new) = (open(&self.base)?, open(&self.new)?);
        output::notes(claimed(&base).or_else(|| claimed(&new)).as_slice());
        let metric = match self.metric {
            Some(metric) => metric,
            None => leading_metric(&new)?,
        };
        let Self { margin, confidence, pool, .. } = self;
        let gate = gate(&base, &new, &GateOptions { metric, margin, confidence, pool })?;
        match self.format {
            None => output::print_json(&gate)?,
            Some(GateFormat::Text(_)) => output::plain(gate.render(GateFormat::Text(terminal::width())))?,
            Some(format) => output::plain(gate.render(format))?,
        };
        Ok(match gate.verdict {
            GateVerdict::Improved | GateVerdict::Held => Outcome::Done,
            GateVerdict::Regressed => Outcome::CheckFailed,
            GateVerdict::CannotSay => Outcome::CannotSay,
            GateVerdict::NotComparable => Outcome::NotComparable,
        })
    }
}

pub fn margin(text: &str) -> Result<f64, String> {
    number(text, "a number above 0 such as 0.1", |value| value > 0.0 && value.is_finite())
}

//! `mirrorstats gate`: later episodes against earlier ones, with an exit code for each verdict.

use std::ffi::OsString;
use std::io::{self, Write as _};

use crate::cli::args::{GroupingArgs, ScoringArgs, ThreadArgs, TraceArgs};
use crate::cli::outcome::{Failure, Outcome};
use crate::cli::{output, terminal};
use report::statistics::{GateFormat, GateOptions, GateVerdict};

/// Hold new episodes against old ones: improved, held, regressed, cannot say
///
/// A cell is an experiment and a model. A cell has held if a loss of the margin or more is excluded; it has regressed if it is
/// shown to be worse and has not held. A model whose name changed is compared if each side has one model.
///
/// Exit codes: 0 all improved or held; 1 some regressed; 5 some not comparable; 4 cannot say for some; 2 bad usage or input.
#[derive(Clone, Debug, clap::Args)]
pub struct GateArgs {
    /// The episodes before: a trace, a folder, a quoted glob or a file of scores
    #[arg(value_name = "BASE")]
    pub base: OsString,
    /// The episodes after
    #[arg(value_name = "NEW")]
    pub new: OsString,
    /// The metric [default: the first one of the definitions with a better direction]
    #[arg(long, value_name = "METRIC")]
    pub metric: Option<String>,
    /// The largest loss that is accepted, in the unit of the metric
    #[arg(long, value_name = "LOSS", default_value_t = 0.1, value_parser = margin)]
    pub margin: f64,
    /// One minus the level of every verdict, over all cells
    #[arg(long, value_name = "LEVEL", default_value = "0.95", value_parser = super::stats::confidence)]
    pub confidence: f64,
    /// Definitions: `paper`, `extended`, or a TOML file [default: those that the traces name, else paper]
    #[arg(long, value_name = "NAME|FILE")]
    pub definitions: Option<std::path::PathBuf>,
    /// Only episodes where this holds, in the language of definitions
    #[arg(long = "where", value_name = "EXPR")]
    pub condition: Option<String>,
    /// Compare episodes that were recorded differently: in another world, with other prompts
    #[arg(long)]
    pub pool: bool,
    /// How verdicts are printed
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
    #[command(flatten)]
    pub threads: ThreadArgs,
}

/// The formats by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// A table, and the flipped episodes
    #[default]
    Text,
    /// Markdown
    Md,
    /// Workflow commands of GitHub Actions
    Github,
    /// `JUnit` XML
    Junit,
    /// JSON: schemas/gate.schema.json
    Json,
}

impl GateArgs {
    pub fn run(self) -> Result<Outcome, Failure> {
        let side = |name: &OsString| TraceArgs { traces: vec![name.clone()], threads: self.threads };
        let scoring =
            ScoringArgs { definitions: self.definitions.clone(), metrics: None, condition: self.condition.clone() };
        let grouping = GroupingArgs { pool: self.pool, ..GroupingArgs::default() };
        let open = |name| side(name).study(&scoring, &grouping);
        let (base, new) = (open(&self.base)?, open(&self.new)?);
        let metric = match self.metric {
            Some(metric) => metric,
            None => new.leading_metric()?,
        };
        let Self { margin, confidence, pool, .. } = self;
        let gate = new.gate(&base, &GateOptions { metric, margin, confidence, pool })?;
        let format = match self.format {
            Format::Text => Some(GateFormat::Text(terminal::width())),
            Format::Md => Some(GateFormat::Markdown),
            Format::Github => Some(GateFormat::Github),
            Format::Junit => Some(GateFormat::Junit),
            Format::Json => None,
        };
        match format {
            Some(format) => io::stdout().lock().write_all(gate.render(format).as_bytes())?,
            None => drop(output::print_json(&gate)?),
        }
        Ok(match gate.verdict {
            GateVerdict::Improved | GateVerdict::Held => Outcome::Done,
            GateVerdict::Regressed => Outcome::CheckFailed,
            GateVerdict::CannotSay => Outcome::CannotSay,
            GateVerdict::NotComparable => Outcome::NotComparable,
        })
    }
}

fn margin(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|value: &f64| *value > 0.0 && value.is_finite());
    value.ok_or_else(|| format!("expected a number above 0 such as 0.1, found `{text}`"))
}

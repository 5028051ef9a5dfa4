//! `mirrorstats stats`: the conclusions that this n allows.

use std::path::PathBuf;

use crate::cli::args::{GroupingArgs, ScoringArgs, TraceArgs, number};
use crate::cli::registered::with_plan;
use crate::cli::{Failure, Outcome, output, terminal};
use mirrorstats_analysis::statistics::text::Length;
use mirrorstats_analysis::statistics::{Options, Sequential, Statistics};
use mirrorstats_exact::suggest::hint;
use mirrorstats_study::pairs::claimed;
use mirrorstats_study::statistics::{sequential, statistics};

const ALL: &str = "all";

/// Intervals, tests and comparisons that hold at small n
#[derive(Clone, Debug, clap::Args)]
#[expect(clippy::struct_excessive_bools, reason = "each is an option of the command line")]
pub struct StatsArgs {
    #[command(flatten)]
    pub traces: TraceArgs,
    /// Definitions: `paper`, `extended`, or a TOML file [default: those that the traces name, else paper]
    #[arg(long, value_name = "NAME|FILE")]
    pub definitions: Option<PathBuf>,
    /// Only episodes where this holds, in the language of definitions
    #[arg(long = "where", value_name = "EXPR")]
    pub condition: Option<String>,
    #[command(flatten)]
    pub grouping: GroupingArgs,
    /// Confidence of every interval; tests are at one minus it
    #[arg(long, value_name = "LEVEL", default_value = "0.95", value_parser = confidence)]
    pub confidence: f64,
    /// The largest difference that counts as none; answers name what is shown to be within it: of rates below 1, of durations
    /// from 1 on
    #[arg(long, value_name = "DIFFERENCE", value_parser = super::gate::margin)]
    pub margin: Option<f64>,
    /// Metrics to print the tables of, or `all` [default: those with a chance level, and time to decision]
    #[arg(long = "metric", value_name = "NAME")]
    pub metrics: Vec<String>,
    /// Print the numbers behind the answers; `--metric` and `--by` do so too
    #[arg(long)]
    pub tables: bool,
    /// Print every row and interval, plain means, clusters, and the differences that the data could have shown
    #[arg(long)]
    pub full: bool,
    /// Intervals and tests of rates that stay valid if you look after every episode of a running study
    #[arg(long, conflicts_with_all = ["by", "margin", "tables", "full"])]
    pub sequential: bool,
    /// A registered plan: each departure of the analysis from it is listed
    #[arg(long, value_name = "FILE")]
    pub plan: Option<PathBuf>,
    /// Print everything as JSON, for every metric
    #[arg(long)]
    pub json: bool,
}

impl StatsArgs {
    pub fn run(self) -> Result<Outcome, Failure> {
        let scoring =
            ScoringArgs { definitions: self.definitions.clone(), metrics: None, condition: self.condition.clone() };
        let study = with_plan(self.traces.study(&scoring, &self.grouping)?, self.plan.as_deref())?;
        output::notes(claimed(&study).as_slice());
        let (confidence, margin, improvements) = (self.confidence, self.margin, self.full || self.json);
        let options = Options { confidence, margin, improvements, ..Options::default() };
        if self.sequential {
            self.print_sequential(&sequential(&study, &options)?)
        } else {
            self.print(&statistics(&study.grouped()?, &options)?)
        }
    }

    fn print(&self, statistics: &Statistics) -> Result<Outcome, Failure> {
        if self.json {
            return output::print_json(statistics);
        }
        let metrics = statistics.cells.iter().map(|cell| cell.metric.as_str());
        let chosen = self.chosen("metric", metrics, &statistics.headline)?;
        let length = match self {
            Self { full: true, .. } => Length::Full,
            _ if self.tables || self.grouping.by.is_some() || !self.metrics.is_empty() => Length::Tables,
            _ => Length::Screen,
        };
        output::plain(statistics.render(&chosen, length, terminal::width()))
    }

    fn print_sequential(&self, sequential: &Sequential) -> Result<Outcome, Failure> {
        if self.json {
            return output::print_json(sequential);
        }
        let rates = sequential.rates.iter().map(|rate| rate.metric.as_str());
        let chosen = self.chosen("rate", rates, &sequential.headline)?;
        output::plain(sequential.render(&chosen, terminal::width()))
    }

    /// The metrics to print: the requested ones if they are in `all`; the headline ones if none is requested.
    fn chosen<'a>(
        &self,
        kind: &'static str,
        all: impl Iterator<Item = &'a str>,
        headline: &[String],
    ) -> Result<Vec<String>, Failure> {
        if self.metrics.is_empty() {
            return Ok(headline.to_vec());
        }
        let mut known: Vec<&str> = Vec::new();
        for metric in all {
            if !known.contains(&metric) {
                known.push(metric);
            }
        }
        if self.metrics.iter().any(|name| name == ALL) {
            return Ok(known.into_iter().map(str::to_owned).collect());
        }
        let Some(name) = self.metrics.iter().find(|name| !known.contains(&name.as_str())) else {
            return Ok(self.metrics.clone());
        };
        let (suggestion, known) = (hint(name, known.iter().copied()), known.join(", "));
        Err(Failure::input(format!("no {kind} is named `{name}`; the definitions have {known}{suggestion}")))
    }
}

pub fn confidence(text: &str) -> Result<f64, String> {
    number(text, "a number between 0 and 1 such as 0.95", |value| value > 0.0 && value < 1.0)
}

#[cfg(test)]
mod tests {
    use super::confidence;

    #[test]
    fn a_confidence_is_strictly_between_zero_and_one() {
        assert_eq!(confidence("0.99"), Ok(0.99));
        for text in ["0", "1", "95", "-0.5", "NaN", "", "95%"] {
            assert!(confidence(text).unwrap_err().contains("between 0 and 1"), "{text}");
        }
    }
}

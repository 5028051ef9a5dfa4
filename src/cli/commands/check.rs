//! `mirrorstats check`: whether the replies in traces are good enough, for CI and before a report.

use std::io::{self, Write as _};

use schemars::JsonSchema;
use serde::Serialize;

use crate::base::escape::visible;
use crate::base::format::fixed;
use crate::cli::args::TraceArgs;
use crate::cli::outcome::{Failure, Outcome};
use crate::cli::output;
use crate::cli::quality::{self, CellAnswer};
use crate::score::quality::{CellKey, Quality, QualityByCell};

/// Check what became of the replies in traces: exits with 1 where a limit is passed
///
/// Shares are of the replies of one cell: an experiment, a model and a condition. A limit on something that the traces do
/// not record counts as passed. Lost episodes are those that the infrastructure ended, and those in `lost.jsonl` beside the
/// traces.
#[derive(Clone, Debug, clap::Args)]
pub struct CheckArgs {
    /// The traces to read.
    #[command(flatten)]
    pub traces: TraceArgs,
    /// The largest share of replies without a decision, such as 0.05
    #[arg(long, value_name = "SHARE", value_parser = share)]
    pub max_unreadable: Option<f64>,
    /// The largest share of refusals
    #[arg(long, value_name = "SHARE", value_parser = share)]
    pub max_refused: Option<f64>,
    /// The largest share of replies that were cut off
    #[arg(long, value_name = "SHARE", value_parser = share)]
    pub max_truncated: Option<f64>,
    /// The largest share of replies that had to be repaired
    #[arg(long, value_name = "SHARE", value_parser = share)]
    pub max_repaired: Option<f64>,
    /// The most lost episodes, over all cells
    #[arg(long, value_name = "N")]
    pub max_lost: Option<u64>,
    /// The longest time within which 95 % of a cell's replies came, in milliseconds
    #[arg(long, value_name = "MS")]
    pub max_latency: Option<i64>,
    /// Answer as JSON
    #[arg(long)]
    pub json: bool,
}

/// What was checked.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct CheckAnswer {
    /// Whether no limit is passed.
    pub holds: bool,
    /// The limits that are passed.
    pub passed: Vec<PassedLimit>,
    /// Every cell.
    pub cells: Vec<CellAnswer>,
}

/// A limit that is passed.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct PassedLimit {
    /// The cell; null for a limit over all cells.
    pub cell: Option<CellKey>,
    /// The option, without its dashes.
    pub limit: &'static str,
    /// The largest that was allowed.
    pub expected: f64,
    /// What was found; null where the traces do not record it.
    pub found: Option<f64>,
}

impl CheckArgs {
    /// Reads and checks.
    ///
    /// # Errors
    /// Whatever is wrong with the traces; no limit at all.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let limits = [self.max_unreadable, self.max_refused, self.max_truncated, self.max_repaired];
        if limits.iter().all(Option::is_none) && self.max_lost.is_none() && self.max_latency.is_none() {
            let words = "expected a limit to check, found none\n  help: name one, such as --max-unreadable 0.05";
            return Err(Failure::input(words));
        }
        let cells = self.traces.open()?.quality()?;
        let answer = CheckAnswer { passed: self.passed(&cells), holds: true, cells: quality::answers(&cells) };
        let answer = CheckAnswer { holds: answer.passed.is_empty(), ..answer };
        if self.json {
            output::print_json(&answer)?;
        } else {
            print(&answer, &cells)?;
        }
        Ok(if answer.holds { Outcome::Done } else { Outcome::CheckFailed })
    }

    fn passed(&self, cells: &QualityByCell) -> Vec<PassedLimit> {
        let mut passed = Vec::new();
        for (key, quality) in &cells.0 {
            for (limit, expected, found) in self.found(quality) {
                passed.extend(exceeded(Some(key), limit, expected, found));
            }
        }
        let lost = cells.whole().lost.map(real);
        passed.extend(exceeded(None, "max-lost", self.max_lost.map(real), lost));
        passed
    }

    /// Each limit of a cell, what it allows, and what was found.
    fn found(&self, quality: &Quality) -> [(&'static str, Option<f64>, Option<f64>); 5] {
        let of = |count: u64| (quality.replies() > 0).then(|| real(count) / real(quality.replies()));
        #[expect(clippy::cast_precision_loss, reason = "milliseconds are far below 2^53")]
        let ms = |ms: i64| ms as f64;
        [
            ("max-unreadable", self.max_unreadable, of(quality.unusable())),
            ("max-refused", self.max_refused, of(quality.of_status("refusal"))),
            ("max-truncated", self.max_truncated, of(quality.of_status("truncated"))),
            ("max-repaired", self.max_repaired, of(quality.of_status("repaired"))),
            ("max-latency", self.max_latency.map(ms), quality.latency(0.95).map(ms)),
        ]
    }
}

#[expect(clippy::cast_precision_loss, reason = "counts of replies are far below 2^53")]
fn real(count: u64) -> f64 {
    count as f64
}

/// The limit, if it is passed or cannot be told.
fn exceeded(
    cell: Option<&CellKey>,
    limit: &'static str,
    expected: Option<f64>,
    found: Option<f64>,
) -> Option<PassedLimit> {
    let expected = expected?;
    let holds = found.is_some_and(|found| found <= expected);
    (!holds).then(|| PassedLimit { cell: cell.cloned(), limit, expected, found })
}

fn print(answer: &CheckAnswer, cells: &QualityByCell) -> io::Result<()> {
    let mut out = io::stdout().lock();
    out.write_all(quality::text(cells, crate::cli::terminal::width()).as_bytes())?;
    writeln!(out)?;
    for passed in &answer.passed {
        let place = match &passed.cell {
            Some(CellKey { experiment, model, .. }) => format!("{}, {}: ", visible(experiment), visible(model)),
            None => String::new(),
        };
        let found = passed.found.map_or_else(|| "nothing recorded".to_owned(), number);
        writeln!(out, "{place}--{}: expected at most {}, found {found}", passed.limit, number(passed.expected))?;
    }
    if answer.holds {
        writeln!(out, "no limit is passed")?;
    }
    Ok(())
}

/// As few digits as say it.
fn number(value: f64) -> String {
    let text = fixed(Some(value), 4);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn share(text: &str) -> Result<f64, String> {
    let fault = || format!("expected a share from 0 to 1 such as 0.05, found `{}`", visible(text));
    let value: f64 = text.parse().map_err(|_| fault())?;
    if (0.0..=1.0).contains(&value) { Ok(value) } else { Err(fault()) }
}

//! `mirrorstats trace check`: whether the replies in traces are good enough, for CI and before a report.

use std::io::{self, Write as _};

use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::args::TraceArgs;
use crate::cli::outcome::{Failure, Outcome};
use crate::cli::output;
use crate::cli::quality::{self, CellAnswer};
use exact::escape::visible;
use exact::format::fixed;
use score::quality::{CellKey, Quality, QualityByCell};
use statistics::losses::INFRASTRUCTURE;

/// Check the quality of the replies in traces: exits with 1 if any limit is exceeded or cannot be checked
///
/// Shares are of the replies of one cell: an experiment, a model and a condition. A limit cannot be checked where traces do
/// not record its quantity for every step. Lost episodes are those that the infrastructure ended, and those in `lost.jsonl`
/// beside the traces.
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

/// The result of the check.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct QualityCheckAnswer {
    /// Whether every limit could be checked and none is exceeded.
    pub holds: bool,
    /// The limits that are exceeded.
    pub violations: Vec<Violation>,
    /// The limits that could not be checked.
    pub not_recorded: Vec<NotRecorded>,
    /// Every cell.
    pub cells: Vec<CellAnswer>,
}

/// A limit that is exceeded.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Violation {
    /// The cell; null for a limit over all cells.
    pub cell: Option<CellKey>,
    /// The option, without its dashes.
    pub limit: &'static str,
    /// The largest that was allowed.
    pub expected: f64,
    /// The value in the traces.
    pub found: f64,
}

/// A limit on a quantity that the traces do not record for every step of a cell.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NotRecorded {
    /// The cell.
    pub cell: CellKey,
    /// The option, without its dashes.
    pub limit: &'static str,
    /// The steps of the cell without it.
    pub missing: u64,
    /// All steps of the cell.
    pub steps: u64,
}

impl CheckArgs {
    pub fn run(&self) -> Result<Outcome, Failure> {
        let limits = [self.max_unreadable, self.max_refused, self.max_truncated, self.max_repaired];
        if limits.iter().all(Option::is_none) && self.max_lost.is_none() && self.max_latency.is_none() {
            let words = "expected a limit to check, found none\n  help: name one, such as --max-unreadable 0.05";
            return Err(Failure::input(words));
        }
        let cells = self.traces.open()?.quality()?;
        let (violations, not_recorded) = (self.violations(&cells), self.not_recorded(&cells));
        let holds = violations.is_empty() && not_recorded.is_empty();
        let answer = QualityCheckAnswer { holds, violations, not_recorded, cells: quality::answers(&cells) };
        if self.json {
            output::print_json(&answer)?;
        } else {
            print(&answer, &cells)?;
        }
        Ok(if answer.holds { Outcome::Done } else { Outcome::CheckFailed })
    }

    fn violations(&self, cells: &QualityByCell) -> Vec<Violation> {
        let of_cell = |(key, quality)| self.found(quality).map(|found| exceeded(Some(key), found));
        let lost = ("max-lost", self.max_lost.map(real), cells.whole().lost.map(real));
        cells.0.iter().flat_map(of_cell).chain([exceeded(None, lost)]).flatten().collect()
    }

    fn not_recorded(&self, cells: &QualityByCell) -> Vec<NotRecorded> {
        let missing = |quality: &Quality| {
            let replies = quality.steps.saturating_sub(quality.replies());
            // What the infrastructure ended came with no reply, which would have taken some time.
            let ended: u64 = INFRASTRUCTURE.iter().map(|status| quality.of_status(status)).sum();
            let timed = quality.latencies.values().sum::<u64>() + ended;
            [
                ("max-unreadable", self.max_unreadable.is_some(), replies),
                ("max-refused", self.max_refused.is_some(), replies),
                ("max-truncated", self.max_truncated.is_some(), replies),
                ("max-repaired", self.max_repaired.is_some(), replies),
                ("max-latency", self.max_latency.is_some(), quality.steps.saturating_sub(timed)),
                ("max-lost", self.max_lost.is_some(), if quality.lost.is_none() { quality.steps } else { replies }),
            ]
        };
        let mut found = Vec::new();
        for (cell, quality) in &cells.0 {
            let asked = missing(quality).into_iter().filter(|(_, is_asked, missing)| *is_asked && *missing > 0);
            let of = |(limit, _, missing)| NotRecorded { cell: cell.clone(), limit, missing, steps: quality.steps };
            found.extend(asked.map(of));
        }
        found
    }

    /// Each limit of a cell, what it allows, and what was found.
    fn found(&self, quality: &Quality) -> [Limit; 5] {
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

/// An option, the largest value that it allows, and the value in the traces.
type Limit = (&'static str, Option<f64>, Option<f64>);

#[expect(clippy::cast_precision_loss, reason = "counts of replies are far below 2^53")]
fn real(count: u64) -> f64 {
    count as f64
}

fn exceeded(cell: Option<&CellKey>, (limit, expected, found): Limit) -> Option<Violation> {
    let (expected, found) = expected.zip(found)?;
    (found > expected).then(|| Violation { cell: cell.cloned(), limit, expected, found })
}

fn print(answer: &QualityCheckAnswer, cells: &QualityByCell) -> io::Result<()> {
    let mut out = io::stdout().lock();
    out.write_all(quality::text(cells, crate::cli::terminal::width()).as_bytes())?;
    writeln!(out)?;
    let named = |cell: &CellKey| match cell.condition.as_str() {
        _ if !cells.has_conditions() => format!("{}, {}: ", visible(&cell.experiment), visible(&cell.model)),
        condition => format!("{}, {} [{}]: ", visible(&cell.experiment), visible(&cell.model), visible(condition)),
    };
    for Violation { cell, limit, expected, found } in &answer.violations {
        let place = cell.as_ref().map_or_else(String::new, named);
        writeln!(out, "{place}--{limit}: expected at most {}, found {}", number(*expected), number(*found))?;
    }
    for NotRecorded { cell, limit, missing, steps } in &answer.not_recorded {
        let what = format!("not recorded for {missing} of {steps} steps, so the limit cannot be checked");
        writeln!(out, "{}--{limit}: {what}", named(cell))?;
    }
    if answer.holds {
        writeln!(out, "no limit is exceeded")?;
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

//! `mirrorstats trace check`: checks the design and the quality of replies in traces, for CI and before a report.

use std::io::{self, Write as _};

use crate::cli::args::{self, TraceArgs};
use crate::cli::{Failure, Outcome, output};
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::format::fixed;
use mirrorstats_report::layout;
use mirrorstats_score::quality::{CellKey, Quality, QualityByCell};
use mirrorstats_study::quality::{self, NotRecorded, QualityCheckAnswer, QualityLimits, Violation};
use mirrorstats_study::statistics::design_audit;

/// Check the design and the replies of traces: exits with 1 if anything is found or cannot be checked
///
/// `--design` audits what the episodes can be compared for: scenes, repeats, seeds, budgets, settings, losses.
///
/// Shares are of the replies of one cell: an experiment, a model and a condition. A limit cannot be checked if traces
/// do not record its quantity for every step. Lost episodes are those ended by the infrastructure, and those in
/// `lost.jsonl` beside the traces.
#[derive(Clone, Debug, clap::Args)]
pub struct CheckArgs {
    #[command(flatten)]
    pub traces: TraceArgs,
    /// The largest share of replies without a decision, such as 0.05
    #[arg(long, value_name = "SHARE", value_parser = share)]
    pub max_unreadable: Option<f64>,
    /// The most lost episodes, over all cells
    #[arg(long, value_name = "N")]
    pub max_lost: Option<u64>,
    /// Audit the design of the study
    #[arg(long)]
    pub design: bool,
    /// Answer as JSON
    #[arg(long)]
    pub json: bool,
}

impl CheckArgs {
    pub fn run(&self) -> Result<Outcome, Failure> {
        if self.max_unreadable.is_none() && self.max_lost.is_none() && !self.design {
            let words =
                "expected a limit to check or --design, found none\n  help: name one, such as --max-unreadable 0.05";
            return Err(Failure::input(words));
        }
        let limits = QualityLimits { max_unreadable: self.max_unreadable, max_lost: self.max_lost };
        let study = self.traces.open(None)?;
        let cells = quality::quality(&study)?;
        let design = if self.design { Some(design_audit(&study.grouped()?)?) } else { None };
        let answer = QualityCheckAnswer::of(&cells, limits, design);
        if self.json {
            output::print_json(&answer)?;
        } else {
            if let Some(design) = &answer.design {
                io::stdout().write_all(design.render(crate::cli::terminal::width()).as_bytes())?;
            }
            if self.max_unreadable.is_some() || self.max_lost.is_some() {
                print(&answer, &cells)?;
            }
        }
        Ok(if answer.holds { Outcome::Done } else { Outcome::CheckFailed })
    }
}

fn print(answer: &QualityCheckAnswer, cells: &QualityByCell) -> io::Result<()> {
    let mut out = io::stdout().lock();
    out.write_all(layout::quality::text(cells, crate::cli::terminal::width()).as_bytes())?;
    if let Some(unread) = layout::quality::unread_identifications(cells) {
        writeln!(out, "{unread}")?;
    }
    writeln!(out)?;
    let named = |cell: &CellKey| match cell.condition.as_str() {
        _ if !cells.has_conditions() => format!("{}, {}: ", visible(&cell.experiment), visible(&cell.model)),
        condition => format!("{}, {} [{}]: ", visible(&cell.experiment), visible(&cell.model), visible(condition)),
    };
    for Violation { cell, limit, expected, found } in &answer.violations {
        let place = cell.as_ref().map_or_else(String::new, named);
        writeln!(out, "{place}--{limit}: expected at most {}, found {}", number(*expected), number(*found))?;
        let quality = cell.as_ref().and_then(|cell| cells.0.get(cell)).filter(|_| *limit == "max-unreadable");
        if let Some((fault, replies)) = quality.and_then(Quality::commonest_fault) {
            writeln!(out, "  the most frequent reason ({replies}): {}", visible(fault))?;
        }
    }
    for NotRecorded { cell, limit, missing, steps } in &answer.not_recorded {
        let what = format!("not recorded for {missing} of {steps} steps, so the limit cannot be checked");
        writeln!(out, "{}--{limit}: {what}", named(cell))?;
    }
    if answer.violations.is_empty() && answer.not_recorded.is_empty() {
        writeln!(out, "no limit is exceeded")?;
    }
    Ok(())
}

fn number(value: f64) -> String {
    let text = fixed(Some(value), 4);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn share(text: &str) -> Result<f64, String> {
    args::number(text, "a share from 0 to 1 such as 0.05", |value| (0.0..=1.0).contains(&value))
}

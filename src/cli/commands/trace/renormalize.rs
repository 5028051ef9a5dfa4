//! `mirrorstats trace renormalize`: derives the attributions of old traces by the rule of this program.

use std::fmt::{self, Write as _};
use std::path::PathBuf;

use crate::cli::args::TraceArgs;
use crate::cli::{Failure, Outcome, output, terminal};
use exact::escape::visible;
use exact::format::counted;
use report::tables::Table;
use trace::renormalize::{RenormalizeAnswer, RenormalizeError, RenormalizedFile, renormalize};

/// Recompute the attributions of old traces from the texts of `identification`
///
/// Writes each trace under its name into another folder, with `self_color` as this version reads the texts, and prints
/// every step that changes. Steps without a text, all other columns and the rest of the recording's metadata stay
/// unchanged. All traces are written, or none.
#[derive(Clone, Debug, clap::Args)]
pub struct RenormalizeArgs {
    #[command(flatten)]
    input: TraceArgs,
    /// The folder to write the new traces to; never that of the old ones
    #[arg(short, long, value_name = "DIR", required_unless_present = "dry_run")]
    out: Option<PathBuf>,
    /// Write nothing, only print what changes
    #[arg(long)]
    dry_run: bool,
    /// Exit with 1 if an attribution changes
    #[arg(long)]
    fail_on_change: bool,
    /// Print what changes as JSON
    #[arg(long)]
    json: bool,
}

impl RenormalizeArgs {
    pub fn run(&self) -> Result<Outcome, Failure> {
        let inputs = self.input.inputs()?;
        output::note_stale_checksums(&inputs);
        let folder = self.out.as_deref().filter(|_| !self.dry_run);
        let answer = renormalize(&inputs, folder, self.input.threads.count())?;
        output::print_told(&answer, self.json, tell)?;
        let has_failed = self.fail_on_change && !answer.flips.is_empty();
        Ok(if has_failed { Outcome::CheckFailed } else { Outcome::Done })
    }
}

impl From<RenormalizeError> for Failure {
    fn from(error: RenormalizeError) -> Self {
        match error {
            RenormalizeError::Unwritable { path, source } => output::unwritable(&path, source),
            other => Self::input(other),
        }
    }
}

/// The most characters of a text in the table; `--json` prints all.
const LONGEST: usize = 80;

fn tell(text: &mut String, answer: &RenormalizeAnswer) -> fmt::Result {
    if !answer.flips.is_empty() {
        let header = ["episode", "t", "before", "after", "identification"];
        let mut table = Table { names: 2, ..Table::of_texts(header).aligned_right([1]) };
        let name = |color: &Option<String>| visible(color.as_deref().unwrap_or("--"));
        for flip in &answer.flips {
            table.push([
                visible(&flip.episode_id),
                flip.t.to_string(),
                name(&flip.before),
                name(&flip.after),
                shortened(&flip.identification),
            ]);
        }
        writeln!(text, "{}", table.within(terminal::width()))?;
    }
    let sum = |of: fn(&RenormalizedFile) -> u64| answer.files.iter().map(of).sum::<u64>();
    let (flips, texts) = (counted(answer.flips.len() as u64, "attribution"), sum(|file| file.texts));
    let (steps, files) = (counted(sum(|file| file.steps), "step"), counted(answer.files.len() as u64, "trace"));
    let verb = if answer.flips.len() == 1 { "changes" } else { "change" };
    write!(text, "{flips} {verb} of {texts} with a text, in {steps} of {files}")?;
    writeln!(text, "; identification version {}{}", versions_before(answer), answer.identification_version)?;
    if answer.written { Ok(()) } else { writeln!(text, "nothing was written") }
}

/// `0 -> ` with the traces' versions, if they differ from this one.
fn versions_before(answer: &RenormalizeAnswer) -> String {
    let mut before: Vec<&str> = answer.files.iter().filter_map(|file| file.version_before.as_deref()).collect();
    before.retain(|version| *version != answer.identification_version);
    before.sort_unstable();
    before.dedup();
    if before.is_empty() { String::new() } else { format!("{} -> ", visible(&before.join(", "))) }
}

fn shortened(text: &str) -> String {
    let line = visible(text);
    if line.chars().count() <= LONGEST {
        return line;
    }
    line.chars().take(LONGEST).chain("...".chars()).collect()
}

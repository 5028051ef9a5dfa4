//! `mirrorstats renormalize`: the attributions of old traces by the rule of this program.

use std::collections::BTreeMap;
use std::fmt;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::args::TraceArgs;
use crate::cli::outcome::{Failure, Outcome};
use crate::cli::text_table::counted;
use crate::cli::{output, terminal};
use exact::escape::visible;
use exact::replace::{Content, is_same_file};
use report::tables::Table;
use trace::diagnostic::Severity;
use trace::error::TraceError;
use trace::identification::VERSION;
use trace::inputs::Input;
use trace::renormalize::{Old, Renormalized};
use trace::validate::validate;

/// Make the attributions of old traces anew from the texts of `identification`
///
/// Writes each trace again under its name into another folder, with `self_color` as this program reads the texts, and
/// prints every step whose attribution changes. Steps without a text, all other columns and the rest of the recording's
/// metadata stay as they are. All traces are written, or none.
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

/// What changes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct RenormalizeAnswer {
    /// The version of the rule of this program.
    pub identification_version: String,
    /// Whether new traces were written.
    pub written: bool,
    /// The traces, by name.
    pub files: Vec<RenormalizedFile>,
    /// Every step whose attribution changes, by file and row.
    pub flips: Vec<Flip>,
}

/// One trace.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct RenormalizedFile {
    /// The old trace.
    pub name: String,
    /// The new one; null with --dry-run.
    pub out: Option<String>,
    /// The version of the rule that the old trace tells; null where it tells none.
    pub version_before: Option<String>,
    /// How many steps it has.
    pub steps: u64,
    /// How many of them have a text.
    pub texts: u64,
    /// How many of them change.
    pub flips: usize,
}

/// A step whose attribution changes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Flip {
    /// The trace.
    pub file: String,
    /// The episode.
    pub episode_id: String,
    /// The timestep.
    pub t: i64,
    /// The attribution of the old trace; null where it has none.
    pub before: Option<String>,
    /// The attribution of the new one; null where the text holds none.
    pub after: Option<String>,
    /// The text behind both.
    pub identification: String,
}

impl RenormalizeArgs {
    pub fn run(&self) -> Result<Outcome, Failure> {
        let inputs = self.input.inputs()?;
        let places = self.places(&inputs)?;
        output::note_stale_checksums(&inputs);
        let old = inputs.iter().map(Old::open).collect::<Result<Vec<_>, _>>().map_err(Failure::input)?;
        self.check(&inputs)?;
        let mut answer = RenormalizeAnswer {
            identification_version: VERSION.to_owned(),
            written: places.is_some(),
            files: Vec::new(),
            flips: Vec::new(),
        };
        let stage = self.written_to().map(output::stage_beside).transpose()?;
        let mut new = Vec::new();
        for (at, (input, old)) in inputs.iter().zip(&old).enumerate() {
            let place = places.as_ref().map(|places| places[at].as_path());
            let staged = stage.as_ref().map(|stage| stage.path().join(at.to_string()));
            let result = renormalized(old, place.zip(staged.as_deref()))?;
            new.extend(input.path.file_name().map(Path::new).zip(staged));
            answer.add(input, place, result);
        }
        if let Some(folder) = self.written_to() {
            let files: Vec<_> = new.iter().map(|(name, staged)| (*name, Content::File(staged))).collect();
            output::write_folder(folder, &files)?;
        }
        output::print(&answer, self.json)?;
        let has_failed = self.fail_on_change && !answer.flips.is_empty();
        Ok(if has_failed { Outcome::CheckFailed } else { Outcome::Done })
    }

    /// The folder, if anything is written.
    fn written_to(&self) -> Option<&Path> {
        self.out.as_deref().filter(|_| !self.dry_run)
    }

    /// Where each trace goes; `None` if nothing is written.
    fn places(&self, inputs: &[Input]) -> Result<Option<Vec<PathBuf>>, Failure> {
        let Some(folder) = self.written_to() else { return Ok(None) };
        let mut taken: BTreeMap<PathBuf, &Input> = BTreeMap::new();
        let mut places = Vec::new();
        for input in inputs {
            let place = folder.join(input.path.file_name().unwrap_or_default());
            if let Some(other) = taken.insert(place.clone(), input) {
                return Err(refused(input, &format!("a name of its own in {}", folder.display()), &other.name));
            }
            places.push(place);
        }
        for (place, input) in inputs.iter().flat_map(|input| places.iter().map(move |place| (place, input))) {
            if is_same_file(place, &input.path) {
                return Err(refused(input, "another folder for the new trace", "the trace itself"));
            }
        }
        Ok(Some(places))
    }

    /// Holds the traces against every rule of the schema; what is copied is not looked at again.
    fn check(&self, inputs: &[Input]) -> Result<(), Failure> {
        let report = validate(inputs, None, self.input.threads.count()).map_err(Failure::input)?;
        let errors = report.findings.into_iter().filter(|finding| finding.severity == Severity::Error).collect();
        TraceError::of(errors).map_or(Ok(()), |error| Err(Failure::input(error)))
    }
}

/// What changes in a trace; the new one for `place` is written to another path, if anything is written.
fn renormalized(old: &Old, to: Option<(&Path, &Path)>) -> Result<Renormalized, Failure> {
    let Some((place, staged)) = to else { return Ok(old.renormalize(io::sink()).map_err(Failure::input)?.1) };
    let out = File::create(staged).map_err(|error| output::unwritable(place, error))?;
    Ok(old.renormalize(out).map_err(|error| Failure::input(error.writing(place)))?.1)
}

fn refused(input: &Input, expected: &str, found: &str) -> Failure {
    let help = "help: give another --out, or fewer traces at a time";
    Failure::Rendered(format!("error: {}: expected {expected}, found {found}\n  {help}", input.name))
}

impl RenormalizeAnswer {
    fn add(&mut self, input: &Input, place: Option<&Path>, result: Renormalized) {
        self.files.push(RenormalizedFile {
            name: input.name.clone(),
            out: place.map(|place| Input::new(place).name),
            version_before: result.version_before,
            steps: result.steps,
            texts: result.texts,
            flips: result.flips.len(),
        });
        self.flips.extend(result.flips.into_iter().map(|flip| Flip {
            file: input.name.clone(),
            episode_id: flip.episode_id,
            t: flip.t,
            before: flip.before,
            after: flip.after,
            identification: flip.identification,
        }));
    }
}

/// The most characters of a text in the table; `--json` has all.
const LONGEST: usize = 80;

impl fmt::Display for RenormalizeAnswer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.flips.is_empty() {
            let header = ["episode", "t", "before", "after", "identification"];
            let mut table = Table { names: 2, ..Table::of_texts(header).aligned_right([1]) };
            let name = |color: &Option<String>| visible(color.as_deref().unwrap_or("--"));
            for flip in &self.flips {
                table.push([
                    visible(&flip.episode_id),
                    flip.t.to_string(),
                    name(&flip.before),
                    name(&flip.after),
                    shortened(&flip.identification),
                ]);
            }
            writeln!(f, "{}", table.within(terminal::width()))?;
        }
        let sum = |of: fn(&RenormalizedFile) -> u64| self.files.iter().map(of).sum::<u64>();
        let (flips, texts) = (counted(self.flips.len() as u64, "attribution"), sum(|file| file.texts));
        let (steps, files) = (counted(sum(|file| file.steps), "step"), counted(self.files.len() as u64, "trace"));
        let verb = if self.flips.len() == 1 { "changes" } else { "change" };
        write!(f, "{flips} {verb} of {texts} with a text, in {steps} of {files}")?;
        writeln!(f, "; identification version {}{}", self.versions_before(), self.identification_version)?;
        if self.written { Ok(()) } else { writeln!(f, "nothing was written") }
    }
}

impl RenormalizeAnswer {
    /// `0 -> ` where the traces tell other versions than this one.
    fn versions_before(&self) -> String {
        let mut before: Vec<&str> = self.files.iter().filter_map(|file| file.version_before.as_deref()).collect();
        before.retain(|version| *version != self.identification_version);
        before.sort_unstable();
        before.dedup();
        if before.is_empty() { String::new() } else { format!("{} -> ", visible(&before.join(", "))) }
    }
}

fn shortened(text: &str) -> String {
    let line = visible(text);
    if line.chars().count() <= LONGEST {
        return line;
    }
    line.chars().take(LONGEST).chain("...".chars()).collect()
}

//! `mirrorstats import`: makes a trace from steps of any harness.

use std::io;
use std::path::{Path, PathBuf};

use crate::cli::{Failure, Outcome, output};
use mirrorstats_exact::replace::{self, TemporaryFolder};
use mirrorstats_import::{Draft, Format, Mapping, Notes, Text, guess};
use mirrorstats_study::Study;
use mirrorstats_study::import::{ImportRequest, import, mapping_in};
use mirrorstats_study::report::{ReportOptions, report};
use mirrorstats_trace::inputs::{Input, resolve};

/// Make a trace of another harness's steps or logs
///
/// One line or row is one step: its keys are columns of the schema, as `mirrorstats trace schema step` prints them.
/// Other keys become columns of their own. Rows of an episode may be in any order and in several files. The trace holds
/// every row and keeps every rule of `mirrorstats trace validate`, or nothing is written. Logs of Inspect,
/// inspect-robots and LeRobot are read directly; content that is not a step is counted and named.
#[derive(Clone, Debug, clap::Args)]
pub struct ImportArgs {
    /// Files of steps, or the folder of a LeRobot data set; `-` for standard input
    #[arg(value_name = "FILE", required = true)]
    steps: Vec<PathBuf>,
    /// The format of the files, or a mapping file: `jsonl`, `json`, `csv`, `parquet`, `inspect`, `inspect-robots`,
    /// `lerobot`, `atif`, `vla-eval`, `mirrorbench`, or a TOML file [default: detected from names and first bytes]
    #[arg(long, value_name = "FORMAT|FILE.toml")]
    from: Option<PathBuf>,
    /// The trace to write
    #[arg(short, long, value_name = "TRACE.parquet", required_unless_present = "guess")]
    out: Option<PathBuf>,
    /// Draft the mapping and the definitions of a file or folder, with a first table; say what the draft rests on
    #[arg(long, conflicts_with_all = ["out", "from", "map", "set", "json", "palette", "cluster", "reconstruction"])]
    guess: bool,
    /// The definitions whose experiments are known: `paper`, `extended`, or a TOML file [default: those of the format,
    /// else paper]
    #[arg(long, value_name = "NAME|FILE")]
    definitions: Option<PathBuf>,
    /// The possible colours, which the trace then declares: names separated by commas, a file of names, or `default`
    /// for the ten colours of the study
    #[arg(long, value_name = "NAMES|FILE|default")]
    palette: Option<PathBuf>,
    /// What similar episodes share: statistics treat it as a cluster. Episodes with an equal `scene` are pairs by
    /// default
    #[arg(long, value_name = "COLUMN", value_parser = ["seed"])]
    cluster: Option<String>,
    /// The steps are rebuilt from published numbers, so statistics use no pairs and no clusters
    #[arg(long, conflicts_with = "cluster")]
    reconstruction: bool,
    /// A column and the path of its value in each line: keys and list positions separated by dots; a trailing `+1` adds
    /// 1 to an integer. Unused lists and objects are left out and named
    #[arg(long, value_name = "COLUMN=PATH")]
    map: Vec<String>,
    /// A column and its value in every line
    #[arg(long, value_name = "COLUMN=VALUE")]
    set: Vec<String>,
    /// Answer as JSON
    #[arg(long)]
    json: bool,
}

impl ImportArgs {
    pub fn run(&self) -> Result<Outcome, Failure> {
        let Some(out) = &self.out else { return self.draft() };
        self.check_places(out)?;
        let (from, file) = self.from.as_deref().map_or((None, None), format_or_file);
        let of_definitions = self.definitions.as_deref().map(mapping_in).transpose()?.flatten();
        let mapping = Mapping::parse(file, of_definitions, &self.map, &self.set)?;
        let mut notes = Notes::default();
        let texts =
            self.steps.iter().map(|path| text(path, from, &mapping, &mut notes)).collect::<Result<Vec<_>, _>>()?;
        output::notes(&notes.texts());
        let request = ImportRequest {
            out: out.clone(),
            definitions: self.definitions.clone(),
            palette: self.palette.clone(),
            clusters_by_seed: self.cluster.is_some(),
            reconstruction: self.reconstruction,
        };
        output::print(&import(texts, &request)?, self.json)
    }

    fn draft(&self) -> Result<Outcome, Failure> {
        let [place] = &*self.steps else {
            let words = format!("--guess: expected one file or folder, found {}\n  help: name one", self.steps.len());
            return Err(Failure::input(words));
        };
        let files = resolve(&[place.clone().into_os_string()], io::empty())?;
        let Draft { text, mut reasons } = guess(&files[0].path).map_err(Failure::input)?;
        if files.len() > 1 {
            reasons.insert(0, format!("the draft is of {}, the first of {} files", files[0].name, files.len()));
        }
        let table = first_table(files, &text)?;
        output::notes(&reasons);
        output::plain(table.lines().fold(text, |text, line| format!("{text}\n# {line}").trim_end().to_owned()) + "\n")
    }

    fn check_places(&self, out: &Path) -> Result<(), Failure> {
        if self.steps.iter().filter(|path| is_standard_input(path)).count() > 1 {
            let words = "`-`: expected standard input once, found it twice\n  help: name it once";
            return Err(Failure::input(words));
        }
        replace::check_target(out, &self.steps, "the steps themselves")?;
        output::check_target(out, self.definitions.iter().chain(&self.palette))
    }
}

/// What `report` prints for the files under the draft.
fn first_table(files: Vec<Input>, draft: &str) -> Result<String, Failure> {
    let folder = TemporaryFolder::private("draft").map_err(Failure::input)?;
    let definitions = folder.path().join("draft.toml");
    std::fs::write(&definitions, draft).map_err(Failure::input)?;
    let study = Study::with_logs(files, Some(&definitions))?.definitions(&definitions)?;
    let report = report(&study, &ReportOptions { figures: false, ..ReportOptions::default() })?;
    let tables = report.main_table().into_iter().chain(report.other_table());
    Ok(tables.map(|table| table.printed().markdown()).collect())
}

/// The format with this name, or the file of a mapping.
fn format_or_file(typed: &Path) -> (Option<Format>, Option<&Path>) {
    let format = Format::ALL.into_iter().find(|format| typed.as_os_str() == format.name());
    (format, Some(typed).filter(|_| format.is_none()))
}

fn text(path: &Path, from: Option<Format>, mapping: &Mapping, notes: &mut Notes) -> Result<Text, Failure> {
    if matches!(from.or(mapping.format), None | Some(Format::LeRobot))
        && let Some(text) = Text::of_data_set(path, mapping, notes)?
    {
        return Ok(text);
    }
    let text = if is_standard_input(path) { Text::spool("standard input", io::stdin()) } else { Text::open(path) };
    let read = text.and_then(|mut text| text.read(mapping, from, notes).map(|()| text));
    read.map_err(Failure::input)
}

fn is_standard_input(path: &Path) -> bool {
    path.as_os_str() == "-"
}

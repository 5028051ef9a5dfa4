//! Remakes a report from its own traces under other definitions.
//!
//! Rule: the new report keeps the old one's filter, grouping, style and choice of metrics. The old report is not
//! changed. Traces are found by their hashes.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use crate::diff::{Diff, Pair, Scored};
use crate::provenance::ProvenanceError;
use crate::question::Question;
use crate::report::{Report, ReportOptions, check_folder, report};
use crate::{ErrorKind, Study, StudyError, provenance};
use mirrorstats_exact::input;
use mirrorstats_report::bundle::{Manifest, Output};
use mirrorstats_report::style::Style;
use mirrorstats_score::format::{self, Partition};
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_trace::inputs::Input;

/// The report to remake, and the changes.
#[derive(Clone, Debug)]
pub struct RescoreRequest {
    /// The folder of the report.
    pub report: PathBuf,
    /// The definitions to score under, by name or path; those that the traces name if absent.
    pub definitions: Option<PathBuf>,
    /// The traces: those of [`traces_of`], or replacements.
    pub traces: Vec<Input>,
    /// The folder of the new report.
    pub out: PathBuf,
    /// A style to replace the report's.
    pub style: Option<PathBuf>,
    /// Metrics to replace the report's.
    pub metrics: Option<Vec<String>>,
    pub threads: NonZeroUsize,
}

/// The traces of a report, found by their hashes in folders or files. If `places` is empty, searches the current
/// folder, the report's folder and its parents.
pub fn traces_of(report: &Path, places: &[PathBuf]) -> Result<Vec<Input>, ProvenanceError> {
    provenance::traces(&provenance::manifest(report)?, &provenance::places(report, places))
}

#[derive(Debug)]
pub struct Rescored {
    pub report: Report,
    /// The changes from the old report, or the reason why they are unknown.
    pub changes: Result<Diff, String>,
}

impl RescoreRequest {
    /// Remakes the report. Errors: a folder that is no report; faults in the definitions.
    pub fn run(&self) -> Result<Rescored, StudyError> {
        let manifest = provenance::manifest(&self.report)?;
        let figures = self.report.join("figures").is_dir() || self.report.join("report.html").is_file();
        let is_png = |file: &Output| Path::new(&file.path).extension().is_some_and(|ending| ending == "png");
        let png = manifest.outputs.iter().any(is_png);
        let options = ReportOptions { style: self.style(&manifest)?, figures, png };
        let study = Study::of(self.traces.clone())?.threads(self.threads).asked(self.question(&manifest))?;
        study.traces()?;
        check_folder(&study, &self.out, &options)?;
        let before = self.scores_before(&manifest);
        let mut report = report(&study, &options)?;
        report.notes.extend(study.stale_checksums());
        let changes = match before {
            Ok(before) => Ok(changes(&study, before, &report)?),
            Err(reason) => Err(reason),
        };
        Ok(Rescored { report, changes })
    }

    fn question(&self, manifest: &Manifest) -> Question {
        let selected = manifest.metrics.len() < manifest.definitions.metric.len();
        Question {
            definitions: self.definitions.clone(),
            filter: manifest.filter.clone(),
            metrics: self.metrics.clone().or_else(|| selected.then(|| manifest.metrics.clone())),
            by: Some(manifest.by.clone()),
            pool: true,
            ..Question::default()
        }
    }

    /// The name or path of the style: the report's own unless another is requested.
    fn style(&self, manifest: &Manifest) -> Result<PathBuf, StudyError> {
        if let Some(style) = &self.style {
            return Ok(style.clone());
        }
        let (name, expected) = (&manifest.style.name, &manifest.style.sha256);
        let found = match Style::load(name) {
            Ok(style) if style.hash == *expected => return Ok(name.into()),
            Ok(Style { hash, .. }) => {
                format!(
                    "the style `{name}` changed since the report was made: expected sha256 {expected}, found {hash}"
                )
            }
            Err(_) => {
                format!("the report's style `{name}` (sha256 {expected}) was a file, and a manifest keeps no paths")
            }
        };
        Err(StudyError::new(ErrorKind::Input, format!("{found}\n  help: name the style with --style")))
    }

    fn scores_before(&self, manifest: &Manifest) -> Result<EpisodeTable, String> {
        let path = self.report.join("episodes.parquet");
        let file = input::open(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        let table = format::read_parquet(file, &Partition::default())
            .map_err(|error| format!("{}: {error}", path.display()))?;
        if table.catalog.hash == manifest.definitions.hash {
            return Ok(table);
        }
        Err(format!("{}: its definitions are not those of the manifest", path.display()))
    }
}

/// The folder of the new report: `out`, or `REPORT-rescored`; never the report itself.
pub fn folder_of_rescored(report: &Path, out: Option<&Path>) -> Result<PathBuf, StudyError> {
    let place = |path: &Path| std::path::absolute(path).and_then(|path| path.canonicalize().or(Ok(path)));
    let out = match out {
        Some(out) => out.to_owned(),
        None => beside(report)?,
    };
    if place(&out)? == place(report)? {
        let words = format!(
            "{}: expected a folder beside the report, found the report itself\n  \
             help: the old report stays as it is; give another --out",
            out.display()
        );
        return Err(StudyError::new(ErrorKind::Output, words));
    }
    Ok(out)
}

fn beside(report: &Path) -> Result<PathBuf, StudyError> {
    let named = if report.file_name().is_some() { report.to_owned() } else { report.canonicalize()? };
    let mut name = named.file_name().unwrap_or_default().to_owned();
    name.push("-rescored");
    Ok(named.with_file_name(name))
}

fn changes(study: &Study, before: EpisodeTable, report: &Report) -> Result<Diff, StudyError> {
    let traces = study.traces()?;
    let after = Scored::of(report.results.episodes.clone(), Some(study.question.bind(traces)?));
    let pair = Pair { before: Scored::of(before, None), after, evidence: None };
    let mut changes = pair.changes(&report.cells.by, &report.style)?;
    let notes = pair.explain(&mut changes, traces, study.threads)?;
    Ok(Diff { changes, notes })
}

//! All findings of traces, and the requirements of definitions on the traces that they score.

use std::fmt::{self, Write as _};
use std::num::NonZeroUsize;
use std::path::Path;

use crate::StudyError;
use crate::experiment_findings::experiment_findings;
use crate::own_definitions::{Carried, DEFAULT_DEFINITIONS, carried};
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::format::counted;
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_metric::file;
use mirrorstats_score::vocabulary::{declared_columns, schema_columns};
use mirrorstats_trace::diagnostic::Severity;
use mirrorstats_trace::footers::checksums::Checksums;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::open::{TraceFile, TraceSet};
use mirrorstats_trace::schema::{DeclaredColumn, Domain};
use mirrorstats_trace::validate::{Expected, Validation, validate_as};

#[derive(Clone, Debug)]
pub(crate) struct ExpectedTraces {
    /// The known experiments; any if `None`.
    pub(crate) experiments: Option<Vec<String>>,
    /// The name of their domain; `None` for the mirror's.
    pub(crate) domain: Option<String>,
    pub(crate) declared: Vec<DeclaredColumn>,
    /// Their name and text, if they are not built in.
    pub(crate) carried: Option<Carried>,
}

impl ExpectedTraces {
    pub(crate) fn of(name: &Path) -> Result<Self, StudyError> {
        let definitions = Definitions::load(name, &schema_columns())?;
        let is_built_in = name.to_str().is_some_and(|name| file::built_in(name).is_some());
        // Commands look for those of the mirror by the names of experiments.
        let is_known = is_built_in && definitions.catalog.domain.is_none();
        let carried = (!is_known).then(|| Carried::of(&definitions));
        Ok(Self { carried, ..Self::by(&definitions) })
    }

    fn by(definitions: &Definitions) -> Self {
        let catalog = &definitions.catalog;
        let experiments = (!catalog.open).then(|| catalog.experiment.keys().cloned().collect());
        let (domain, declared) = (catalog.domain.clone(), declared_columns(definitions));
        Self { experiments, domain, declared, carried: None }
    }

    pub(crate) fn as_expected(&self) -> Expected<'_> {
        let domain = if self.domain.is_some() { Domain::Own } else { Domain::Mirror };
        Expected { experiments: self.experiments.as_deref(), domain, declared: &self.declared, errors_alone: false }
    }
}

const SHOWN: usize = 10;

/// The findings under these definitions. If `None`: under those that the traces carry, else those of the paper.
pub fn findings(definitions: Option<&Path>, inputs: &[Input], threads: NonZeroUsize) -> Result<Validation, StudyError> {
    let traces = TraceSet::from_files(inputs.iter().filter_map(|input| TraceFile::open(input).ok()).collect());
    let named = definitions.map_or(Path::new(DEFAULT_DEFINITIONS), |name| name);
    let definitions = match definitions.map_or_else(|| carried(&traces), |_| Ok(None))? {
        Some(carried) => carried.load(&schema_columns())?,
        None => Definitions::load(named, &schema_columns())?,
    };
    let mut found = validate_as(inputs, ExpectedTraces::by(&definitions).as_expected(), threads)?;
    found.findings.extend(experiment_findings(&definitions.catalog, &traces));
    Ok(found)
}

pub fn findings_text(report: &Validation) -> String {
    let mut text = String::new();
    // Writing to a string does not fail.
    let _ = write(&mut text, report);
    text
}

fn write(out: &mut String, report: &Validation) -> fmt::Result {
    let (shown, rest) = report.abridged(SHOWN);
    for finding in shown {
        writeln!(out, "{finding}\n")?;
    }
    for rest in &rest {
        writeln!(out, "{}: {}, and {} more of these", rest.code, visible(rest.file), rest.count)?;
    }
    if !rest.is_empty() {
        writeln!(out, "`--json` prints all findings\n")?;
    }
    let incomplete = report.files.iter().filter(|file| !file.complete).count();
    let unchecked = report.files.iter().filter(|file| file.complete && file.checksums == Checksums::None);
    match unchecked.count() as u64 {
        0 => {}
        count => writeln!(out, "no checksums in {}: damage to their data may not be found", counted(count, "file"))?,
    }
    let (episodes, steps) = report
        .files
        .iter()
        .fold((0_u64, 0_u64), |(episodes, steps), file| (episodes + file.episodes, steps + file.steps));
    let files = counted(report.files.len() as u64, "file");
    write!(out, "{files}, {}, {} checked", counted(episodes, "episode"), counted(steps, "step"))?;
    if incomplete > 0 {
        write!(out, " ({incomplete} of the files not to their end)")?;
    }
    let [errors, notes] = [Severity::Error, Severity::Note].map(|severity| report.count(severity) as u64);
    writeln!(out, ": {}, {}", counted(errors, "error"), counted(notes, "note"))
}

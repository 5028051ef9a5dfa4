//! Scores by the SQL lowering on Spark. The results are those of the native kernels.

use std::ffi::OsString;
use std::path::PathBuf;

use crate::inputs::InputError;
use crate::own_definitions::check_scored;
use crate::question::Question;
use crate::results::{Outputs, Results};
use crate::{Study, StudyError, design, scan, scores};
use mirrorstats_engines::spark::source::{Sources, is_uri};
use mirrorstats_engines::spark::{self, Cluster, Job, SparkError, Written};
use mirrorstats_exact::replace::check_target;
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_score::vocabulary::{check_label, unknown_columns};
use mirrorstats_trace::validate::replies::REPLY_STATUS;

/// A job for Spark, checked as far as possible without Spark.
#[derive(Debug)]
pub struct SparkJob {
    sources: Sources,
    definitions: Definitions,
    labels: Vec<String>,
    cluster: Cluster,
    read: Vec<PathBuf>,
}

impl SparkJob {
    pub fn of_study(study: &Study, cluster: Cluster) -> Result<Self, StudyError> {
        let traces = study.traces()?;
        let mut labels = study.question.labels_over(traces);
        labels.retain(|label| !traces.is_label_column(label));
        labels.iter().try_for_each(|label| check_label(traces, label))?;
        let definitions = study.question.bind(traces)?;
        let plan = &definitions.plan;
        let read =
            plan.columns(&plan.needed()).into_iter().map(|(name, _)| name.to_owned()).chain(study.question.labels());
        if let Some(column) = read.into_iter().find(|name| traces.is_label_column(name)) {
            return Err(SparkError::Label { column }.into());
        }
        let sources = Sources::files(&study.inputs, traces)
            .map_err(|source| SparkError::System { what: "name the traces for Spark".to_owned(), source })?;
        let read = study.files_read(None);
        if let Some(log) = &cluster.log {
            check_target(log, &read, "one that is read")?;
        }
        Ok(Self { sources, definitions, labels, cluster, read })
    }

    pub fn of_uris(uris: Vec<String>, question: &Question, cluster: Cluster) -> Result<Self, StudyError> {
        let definitions = question.bind_to(&unknown_columns())?;
        let (sources, labels, read) = (Sources::uris(uris), question.labels(), Vec::new());
        Ok(Self { sources, definitions, labels, cluster, read })
    }

    pub fn read(&self) -> &[PathBuf] {
        &self.read
    }

    pub fn score(&self) -> Result<EpisodeTable, StudyError> {
        Ok(spark::score(self.job(), &self.cluster)?)
    }

    pub fn write(&self, folder: &str) -> Result<Written, StudyError> {
        Ok(spark::write(self.job(), &self.cluster, folder)?)
    }

    fn job(&self) -> Job<'_> {
        Job { definitions: &self.definitions, labels: &self.labels, sources: &self.sources }
    }
}

/// The episode table, computed by Spark, and with `for_a_file` as a file keeps it ([`scores::score`]). Lost episodes, which
/// Spark does not know, and hashes of steps come from a scan. Errors: as
/// [`Study::score`]; scores in the place of traces; faults of Spark.
pub fn score_on(study: &Study, cluster: Cluster, for_a_file: bool) -> Result<EpisodeTable, StudyError> {
    let traces = study.traces()?;
    let mut job = SparkJob::of_study(study, cluster)?;
    if for_a_file {
        design::add_labels(&mut job.labels, traces);
    }
    let episodes = job.score()?;
    check_scored(&study.question.bind(traces)?, traces, &episodes)?;
    let mut results = Results::of(episodes);
    if traces.column(REPLY_STATUS).is_some() {
        let scanned = scan::scan(traces, &study.question, Outputs::default(), study.threads)?;
        results = Results { episodes: results.episodes, ..scanned };
    }
    study.check_unchanged()?;
    study.declare(&mut results)?;
    if for_a_file { scores::for_a_file(study, results.episodes) } else { Ok(results.episodes) }
}

/// Returns true if all arguments are URIs, false if none is.
pub fn are_uris(arguments: &[OsString]) -> Result<bool, InputError> {
    match arguments.iter().filter(|argument| argument.to_str().is_some_and(is_uri)).count() {
        0 => Ok(false),
        all if all == arguments.len() => Ok(true),
        _ => Err(InputError::FilesAndUris),
    }
}

//! Scores by the SQL lowering on Spark. The results are those of the native kernels.

use std::ffi::OsString;
use std::path::PathBuf;

use crate::question::Question;
use crate::{Study, StudyError};
use mirrorstats_engines::spark::source::{Sources, is_uri};
use mirrorstats_engines::spark::{self, Cluster, Job, SparkError, Written};
use mirrorstats_exact::replace::check_target;
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_score::vocabulary::check_label;

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
        let definitions = question.bind_to(&mirrorstats_score::vocabulary::unknown_columns())?;
        let (sources, labels, read) = (Sources::Uris(uris), question.labels(), Vec::new());
        Ok(Self { sources, definitions, labels, cluster, read })
    }

    pub fn read(&self) -> &[PathBuf] {
        &self.read
    }

    pub fn score(&self) -> Result<EpisodeTable, StudyError> {
        Ok(spark::score(self.job(), &self.cluster)?)
    }

    /// Scores on Spark, which writes a folder of Parquet.
    pub fn write(&self, folder: &str) -> Result<Written, StudyError> {
        Ok(spark::write(self.job(), &self.cluster, folder)?)
    }

    fn job(&self) -> Job<'_> {
        Job { definitions: &self.definitions, labels: &self.labels, sources: &self.sources }
    }
}

/// Returns true if all arguments are URIs, false if none is.
pub fn are_uris(arguments: &[OsString]) -> Result<bool, StudyError> {
    match arguments.iter().filter(|argument| argument.to_str().is_some_and(is_uri)).count() {
        0 => Ok(false),
        all if all == arguments.len() => Ok(true),
        _ => Err(StudyError::FilesAndUris),
    }
}

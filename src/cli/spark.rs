//! `--engine spark`: from what was typed to a job for the user's own Spark.

use std::path::{Path, PathBuf};

use super::args::{Engine, EngineArgs, ScoringArgs, SparkArgs, TraceArgs};
use super::outcome::Failure;
use super::{output, scoring};
use crate::engine::spark::source::{Sources, is_uri};
use crate::engine::spark::{self, Cluster, Job, SparkError, Written};
use crate::metric::definitions::Definitions;
use crate::score::format::Format;
use crate::score::score_traces;
use crate::score::table::EpisodeTable;
use crate::trace::inputs::Input;

impl EngineArgs {
    /// Refuses words for Spark where another engine is asked for.
    ///
    /// # Errors
    /// Such words.
    pub fn check(&self) -> Result<(), Failure> {
        let SparkArgs { master, spark_conf, spark_timeout, spark_log } = &self.spark;
        let words = master.is_some() || !spark_conf.is_empty() || spark_timeout.is_some() || spark_log.is_some();
        if self.engine == Engine::Spark || !words {
            return Ok(());
        }
        Err(Failure::Rendered(
            "error: --master and --spark-... are words for Spark\n  help: add --engine spark".to_owned(),
        ))
    }

    fn cluster(&self) -> Cluster {
        let SparkArgs { master, spark_conf, spark_timeout, spark_log } = self.spark.clone();
        Cluster { master, settings: spark_conf, timeout_s: spark_timeout, log: spark_log }
    }
}

/// What Spark is to read, and the definitions checked against it.
#[derive(Debug)]
pub struct Asked {
    sources: Sources,
    definitions: Definitions,
    cluster: Cluster,
    /// The files of this machine that are read.
    read: Vec<PathBuf>,
}

impl Asked {
    /// Traces of this machine, or URIs that only Spark can read.
    ///
    /// # Errors
    /// Both at once; whatever is wrong with the footers of files, or with the definitions.
    pub fn of(traces: &TraceArgs, scoring_args: &ScoringArgs, engine: &EngineArgs) -> Result<Self, Failure> {
        match traces.traces.iter().filter(|argument| is_uri(argument)).count() {
            0 => Self::of_files(&scoring::resolve(traces)?, scoring_args, &[], engine),
            all if all == traces.traces.len() => Ok(Self {
                sources: Sources::Uris(traces.traces.clone()),
                definitions: scoring::definitions_unopened(scoring_args)?,
                cluster: engine.cluster(),
                read: Vec::new(),
            }),
            _ => Err(Failure::Rendered(
                "error: expected files of this machine or URIs for Spark, found both\n  help: name the files as file:// URIs, or score the two apart"
                    .to_owned(),
            )),
        }
    }

    /// Traces of this machine.
    ///
    /// # Errors
    /// Whatever is wrong with the footers of files, or with the definitions.
    pub fn of_files(
        inputs: &[Input],
        scoring_args: &ScoringArgs,
        labels: &[String],
        engine: &EngineArgs,
    ) -> Result<Self, Failure> {
        let opened = scoring::open_steps(inputs)?;
        labels
            .iter()
            .try_for_each(|label| score_traces::check_label(&opened, label))
            .map_err(scoring::score_failure)?;
        let definitions = scoring::definitions(&opened, scoring_args)?;
        let sources = Sources::files(inputs, &opened)
            .map_err(|source| SparkError::System { what: "name the traces for Spark".to_owned(), source })
            .map_err(Failure::input)?;
        let read = output::files_read(inputs, &[scoring_args.definitions.as_deref()]);
        if let Some(log) = &engine.spark.spark_log {
            output::check_target(log, &read)?;
        }
        Ok(Self { sources, definitions, cluster: engine.cluster(), read })
    }

    /// The files of this machine that are read.
    pub fn read(&self) -> &[PathBuf] {
        &self.read
    }

    /// The scores, brought here.
    ///
    /// # Errors
    /// Whatever Spark, its absence, or the traces give.
    pub fn score(&self, labels: &[String]) -> Result<EpisodeTable, Failure> {
        spark::score(self.job(labels), &self.cluster).map_err(Failure::input)
    }

    /// The scores, written by Spark as a folder of Parquet.
    ///
    /// # Errors
    /// Whatever Spark, its absence, or the traces give.
    pub fn write(&self, folder: &str) -> Result<Written, Failure> {
        spark::write(self.job(&[]), &self.cluster, folder).map_err(Failure::input)
    }

    fn job<'a>(&'a self, labels: &'a [String]) -> Job<'a> {
        Job { definitions: &self.definitions, labels, sources: &self.sources }
    }
}

/// Whether an output is a folder that Spark writes, rather than a file that is written here.
pub fn is_folder(output: &Path) -> bool {
    let name = output.to_string_lossy();
    is_uri(&name) || Format::of_name(&name).is_err()
}

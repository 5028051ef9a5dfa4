//! Converts typed engine options to the engine of a study.

use std::path::Path;

use crate::cli::args::{Engine, EngineArgs, SparkArgs};
use crate::cli::outcome::Failure;
use engines::spark::Cluster;
use engines::spark::source::is_uri;
use exact::replace::is_stream;
use score::format::Format;
use study::Backend;

impl EngineArgs {
    pub fn backend(&self) -> Result<Backend, Failure> {
        self.check()?;
        Ok(match self.engine {
            Engine::Native => Backend::Native,
            Engine::Polars => Backend::Polars,
            Engine::Spark => Backend::Spark(self.cluster()),
        })
    }

    /// The typed cluster.
    pub fn cluster(&self) -> Cluster {
        let SparkArgs { master, spark_conf, spark_timeout, spark_log } = self.spark.clone();
        Cluster { master, settings: spark_conf, timeout_s: spark_timeout, log: spark_log }
    }

    fn check(&self) -> Result<(), Failure> {
        let SparkArgs { master, spark_conf, spark_timeout, spark_log } = &self.spark;
        let typed = master.is_some() || !spark_conf.is_empty() || spark_timeout.is_some() || spark_log.is_some();
        if self.engine == Engine::Spark || !typed {
            return Ok(());
        }
        Err(Failure::Rendered(
            "error: --master and --spark-... are words for Spark\n  help: add --engine spark".to_owned(),
        ))
    }
}

/// Returns true if an output is a folder that Spark writes, not a file written here.
pub fn is_folder(output: &Path) -> bool {
    let name = output.to_string_lossy();
    is_uri(&name) || Format::of_name(&name).is_err() && !is_stream(output)
}

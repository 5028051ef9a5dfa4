//! `score`: the episode table of traces, or the evidence for one episode.

use std::io::{self, BufWriter};
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};

use crate::cli::args::{GroupingArgs, ScoringArgs, TraceArgs};
use crate::cli::{Failure, Outcome, output};
use mirrorstats_engines::spark::Cluster;
use mirrorstats_engines::spark::setting::Setting;
use mirrorstats_engines::spark::source::is_uri;
use mirrorstats_exact::format::counted;
use mirrorstats_exact::replace::is_stream;
use mirrorstats_score::format::Format;
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_study::Study;
use mirrorstats_study::explain::explain;
use mirrorstats_study::scores;
use mirrorstats_study::spark::{SparkJob, are_uris, score_on};

/// Compute every metric of every episode
#[derive(Clone, Debug, clap::Args)]
pub struct ScoreArgs {
    #[command(flatten)]
    pub traces: TraceArgs,
    #[command(flatten)]
    pub scoring: ScoringArgs,
    #[command(flatten)]
    pub engine: EngineArgs,
    /// Write the episode table here: a name that ends in .parquet, .csv or .jsonl; with --engine spark any other name or
    /// a URI is a folder of Parquet, written by Spark [default: CSV on standard output]
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Show one episode's scores and the timesteps that decided them
    #[arg(long, value_name = "EPISODE", conflicts_with = "output")]
    pub explain: Option<String>,
    /// Print JSON: lines of episodes, or one object with --explain
    #[arg(long, conflicts_with = "output")]
    pub json: bool,
}

/// The engine of the episode table, and the options for submitting to Spark.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct EngineArgs {
    /// The engine of the scores; the result is the same
    #[arg(long, value_enum, default_value_t)]
    engine: Engine,
    /// The master of --engine spark: spark://HOST:PORT, yarn, local, ... [default: what your Spark is configured for]
    #[arg(long, value_name = "URL")]
    master: Option<String>,
    /// A setting for --engine spark; may be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    spark_conf: Vec<Setting>,
    /// Give up on Spark after this many seconds [default: never]
    #[arg(long, value_name = "SECONDS")]
    spark_timeout: Option<NonZeroU32>,
    /// Keep Spark's own log in this file
    #[arg(long, value_name = "FILE")]
    spark_log: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
enum Engine {
    /// The program's own kernels
    #[default]
    Native,
    /// The SQL statement of `mirrorstats definitions sql` on your own Spark: `SPARK_HOME`, `spark-submit` on PATH, or Python's package `pyspark`
    Spark,
}

impl EngineArgs {
    /// The cluster; `None` for the native engine. Errors: options of Spark without it.
    fn cluster(&self) -> Result<Option<Cluster>, Failure> {
        let Self { engine, master, spark_conf: settings, spark_timeout: timeout_s, spark_log: log } = self.clone();
        let is_typed = master.is_some() || !settings.is_empty() || timeout_s.is_some() || log.is_some();
        match engine {
            Engine::Spark => Ok(Some(Cluster { master, settings, timeout_s, log })),
            Engine::Native if !is_typed => Ok(None),
            Engine::Native => {
                Err(Failure::input("--master and --spark-... are words for Spark\n  help: add --engine spark"))
            }
        }
    }
}

impl ScoreArgs {
    pub fn run(self) -> Result<Outcome, Failure> {
        if let Some(cluster) = self.engine.cluster()? {
            return self.run_on(cluster);
        }
        // Refuse an unknown output format before a pass over the traces.
        let format = self.format()?;
        let study = self.study()?;
        self.check_target(study.files_read(None))?;
        if let Some(episode) = &self.explain {
            return output::print(&explain(&study, episode)?, self.json);
        }
        let table = if self.output.is_some() { scores::score(&study)? } else { study.score()?.episodes };
        self.deliver(&table, format)?;
        output::notes(study.empty_filter(table.len())?.as_slice());
        Ok(Outcome::Done)
    }

    fn run_on(&self, cluster: Cluster) -> Result<Outcome, Failure> {
        if self.explain.is_some() {
            let words = "--explain looks into the steps, which Spark keeps to itself\n  help: leave --engine out";
            return Err(Failure::input(words));
        }
        let folder = self.output.as_deref().filter(|output| is_folder(output));
        let format = if folder.is_none() { self.format()? } else { Format::Parquet };
        if folder.is_none() && !are_uris(&self.traces.traces)? {
            let study = self.study()?;
            self.check_target(study.files_read(None))?;
            self.deliver(&score_on(&study, cluster, self.output.is_some())?, format)?;
            return Ok(Outcome::Done);
        }
        let job = self.job(cluster)?;
        if let Some(folder) = folder {
            let name = folder.to_string_lossy();
            let episodes = counted(job.write(&name)?.episodes, "episode");
            output::say(&format!("{episodes}; `mirrorstats report {name}` goes on from here"));
        } else {
            self.check_target(job.read().to_vec())?;
            self.deliver(&job.score()?, format)?;
        }
        Ok(Outcome::Done)
    }

    fn study(&self) -> Result<Study, Failure> {
        self.traces.study(&self.scoring, &GroupingArgs::default())
    }

    fn job(&self, cluster: Cluster) -> Result<SparkJob, Failure> {
        if !are_uris(&self.traces.traces)? {
            return Ok(SparkJob::of_study(&self.study()?, cluster)?);
        }
        let uris = self.traces.traces.iter().map(|uri| uri.to_string_lossy().into_owned()).collect();
        Ok(SparkJob::of_uris(uris, &self.scoring.question(&GroupingArgs::default()), cluster)?)
    }

    fn check_target(&self, read: Vec<PathBuf>) -> Result<(), Failure> {
        self.output.as_ref().map_or(Ok(()), |path| output::check_target(path, read))
    }

    fn format(&self) -> Result<Format, Failure> {
        let Some(path) = self.output.as_deref() else {
            return Ok(if self.json { Format::JsonLines } else { Format::Csv });
        };
        match Format::of_name(&path.to_string_lossy()) {
            Err(_) if is_stream(path) => Ok(Format::Csv),
            format => format.map_err(Failure::input),
        }
    }

    fn deliver(&self, table: &EpisodeTable, format: Format) -> Result<(), Failure> {
        let threads = self.traces.threads.count();
        match &self.output {
            Some(path) => {
                output::write_file_with(path, |file| Ok(scores::write(table, format, BufWriter::new(file), threads)?))
            }
            None => Ok(scores::write(table, format, BufWriter::new(io::stdout()), threads)?),
        }
    }
}

/// Returns true if an output is a folder that Spark writes, not a file written here.
fn is_folder(output: &Path) -> bool {
    let name = output.to_string_lossy();
    is_uri(&name) || Format::of_name(&name).is_err() && !is_stream(output)
}

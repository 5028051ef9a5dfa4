//! `score`: the episode table of traces, or the evidence for one episode.

use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use crate::cli::args::{Engine, EngineArgs, GroupingArgs, ScoringArgs, TraceArgs};
use crate::cli::{Failure, Outcome, output};
use mirrorstats_engines::spark::source::is_uri;
use mirrorstats_exact::format::counted;
use mirrorstats_exact::replace::is_stream;
use mirrorstats_score::format::Format;
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_study::{SparkJob, are_uris, write_scores};

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

impl ScoreArgs {
    pub fn run(self) -> Result<Outcome, Failure> {
        if self.engine.engine == Engine::Spark {
            return self.run_on_spark();
        }
        // Refuse an unknown output format before a pass over the traces.
        let format = self.output.as_deref().map(format_of).transpose()?;
        let study = self.traces.study_on(&self.engine, &self.scoring, &GroupingArgs::default())?;
        self.check_target(study.files_read(None))?;
        if let Some(episode) = &self.explain {
            return output::print(&study.explain(episode)?, self.json);
        }
        let table = study.score()?.episodes;
        self.deliver(&table, format)?;
        if let Some(words) = study.empty_filter(table.len())? {
            output::note(&words);
        }
        Ok(Outcome::Done)
    }

    fn run_on_spark(&self) -> Result<Outcome, Failure> {
        if self.explain.is_some() {
            let words =
                "error: --explain looks into the steps, which Spark keeps to itself\n  help: leave --engine out";
            return Err(Failure::Rendered(words.to_owned()));
        }
        if let Some(folder) = self.output.as_deref().filter(|output| is_folder(output)) {
            let name = folder.to_string_lossy();
            let written = self.spark_job()?.write(&name)?;
            let episodes = counted(written.episodes, "episode");
            output::say(&format!("{episodes}; `mirrorstats report {name}` goes on from here"));
            return Ok(Outcome::Done);
        }
        let format = self.output.as_deref().map(format_of).transpose()?;
        if are_uris(&self.traces.traces)? {
            let job = self.spark_job()?;
            self.check_target(job.read().to_vec())?;
            self.deliver(&job.score()?, format)?;
            return Ok(Outcome::Done);
        }
        let study = self.traces.study_on(&self.engine, &self.scoring, &GroupingArgs::default())?;
        self.check_target(study.files_read(None))?;
        self.deliver(&study.score()?.episodes, format)?;
        Ok(Outcome::Done)
    }

    fn check_target(&self, read: Vec<PathBuf>) -> Result<(), Failure> {
        self.output.as_ref().map_or(Ok(()), |path| output::check_target(path, read))
    }

    fn spark_job(&self) -> Result<SparkJob, Failure> {
        let cluster = self.engine.cluster();
        if are_uris(&self.traces.traces)? {
            return Ok(SparkJob::of_uris(
                self.traces.traces.iter().map(|uri| uri.to_string_lossy().into_owned()).collect(),
                &self.scoring.question(&GroupingArgs::default()),
                cluster,
            )?);
        }
        Ok(SparkJob::of_study(&self.traces.study(&self.scoring, &GroupingArgs::default())?, cluster)?)
    }

    fn deliver(&self, table: &EpisodeTable, format: Option<Format>) -> Result<(), Failure> {
        let format = format.unwrap_or(if self.json { Format::JsonLines } else { Format::Csv });
        let threads = self.traces.threads.count();
        match &self.output {
            Some(path) => {
                output::write_file_with(path, |file| Ok(write_scores(table, format, BufWriter::new(file), threads)?))
            }
            None => Ok(write_scores(table, format, BufWriter::new(io::stdout()), threads)?),
        }
    }
}

fn format_of(path: &Path) -> Result<Format, Failure> {
    match Format::of_name(&path.to_string_lossy()) {
        Err(_) if is_stream(path) => Ok(Format::Csv),
        format => format.map_err(Failure::input),
    }
}

/// Returns true if an output is a folder that Spark writes, not a file written here.
fn is_folder(output: &Path) -> bool {
    let name = output.to_string_lossy();
    is_uri(&name) || Format::of_name(&name).is_err() && !is_stream(output)
}

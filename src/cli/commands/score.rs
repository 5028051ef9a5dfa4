//! `score`: the episode table of traces, or the evidence for one episode.

use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use super::super::args::{Engine, EngineArgs, ScoringArgs, TraceArgs};
use super::super::listing::counted;
use super::super::outcome::{Failure, Outcome};
use super::super::{empty_filter, output, scoring, spark};
use crate::score::evidence;
use crate::score::format::Format;
use crate::trace::inputs::Input;

/// Compute every metric of every episode
#[derive(Clone, Debug, clap::Args)]
pub struct ScoreArgs {
    /// What to score.
    #[command(flatten)]
    pub traces: TraceArgs,
    /// How it is defined.
    #[command(flatten)]
    pub scoring: ScoringArgs,
    /// What computes it.
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
    /// Scores.
    ///
    /// # Errors
    /// Whatever is wrong with the traces, the definitions or the output.
    pub fn run(self) -> Result<Outcome, Failure> {
        self.engine.check()?;
        if self.engine.engine == Engine::Spark {
            return self.run_on_spark();
        }
        if self.explain.is_some() && self.engine.engine != Engine::Native {
            let words = "error: --explain shows what the native engine decided by\n  help: leave --engine out";
            return Err(Failure::Rendered(words.to_owned()));
        }
        // An output name of no known format should not cost a pass over the traces.
        let format = self.output.as_deref().map(format_of).transpose()?;
        let inputs = scoring::resolve(&self.traces)?;
        self.check_target(&inputs)?;
        let threads = self.traces.threads.count();
        if let Some(episode) = &self.explain {
            let traces = scoring::open_steps(&inputs)?;
            let definitions = scoring::definitions(&traces, &self.scoring)?;
            let found = evidence::explain(&traces, &definitions, episode, threads).map_err(|error| match error {
                evidence::EvidenceError::Score(error) => scoring::score_failure(error),
                other @ evidence::EvidenceError::NoSuchEpisode { .. } => Failure::input(other),
            })?;
            return output::print(&found, self.json);
        }
        let table = scoring::table_on(&self.engine, &inputs, &self.scoring, &[], threads)?;
        self.deliver(format, |format, out| scoring::write_table(&table, format, out, threads))?;
        empty_filter::note(table.len(), &inputs, &self.scoring, threads)?;
        Ok(Outcome::Done)
    }

    fn run_on_spark(&self) -> Result<Outcome, Failure> {
        if self.explain.is_some() {
            let words =
                "error: --explain looks into the steps, which Spark keeps to itself\n  help: leave --engine out";
            return Err(Failure::Rendered(words.to_owned()));
        }
        let asked = || spark::Asked::of(&self.traces, &self.scoring, &self.engine);
        if let Some(folder) = self.output.as_deref().filter(|output| spark::is_folder(output)) {
            let name = folder.to_string_lossy();
            let written = asked()?.write(&name)?;
            let episodes = counted(written.episodes, "episode");
            output::say(&format!("{episodes}; `mirrorstats report {name}` goes on from here"));
            return Ok(Outcome::Done);
        }
        let format = self.output.as_deref().map(format_of).transpose()?;
        let asked = asked()?;
        if let Some(path) = &self.output {
            output::check_target(path, asked.read())?;
        }
        let (table, threads) = (asked.score(&[])?, self.traces.threads.count());
        self.deliver(format, |format, out| scoring::write_table(&table, format, out, threads))?;
        Ok(Outcome::Done)
    }

    /// That the output is no input.
    fn check_target(&self, inputs: &[Input]) -> Result<(), Failure> {
        let Some(path) = &self.output else { return Ok(()) };
        output::check_target(path, output::files_read(inputs, &[self.scoring.definitions.as_deref()]))
    }

    /// Writes the table to where it was asked for.
    fn deliver(
        &self,
        format: Option<Format>,
        write: impl FnOnce(Format, &mut (dyn io::Write + Send)) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let format = format.unwrap_or(if self.json { Format::JsonLines } else { Format::Csv });
        match &self.output {
            Some(path) => output::write_file_with(path, |file| write(format, &mut BufWriter::new(file)))?,
            None => write(format, &mut BufWriter::new(io::stdout()))?,
        }
        Ok(())
    }
}

fn format_of(path: &Path) -> Result<Format, Failure> {
    Format::of_name(&path.to_string_lossy()).map_err(Failure::input)
}

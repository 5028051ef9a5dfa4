//! `query`: any SELECT over steps, episodes and cells.

use std::path::PathBuf;

use super::super::args::{ScoringArgs, TraceArgs};
use super::super::outcome::{Failure, Outcome};

/// Ask traces anything: one SELECT over the tables steps, episodes and cells
///
/// `steps` has a row a step, with every column of the traces as it is; a column that one file lacks is null there.
/// `episodes` is what `score` writes, `cells` what `report` writes as cells.csv. Rows come in no fixed order unless the
/// query says ORDER BY. A query reads the traces named and nothing else.
#[derive(Clone, Debug, clap::Args)]
pub struct QueryArgs {
    /// The query, such as "SELECT model, COUNT(*) AS steps FROM steps GROUP BY model ORDER BY model"
    #[arg(value_name = "SELECT")]
    pub query: String,
    /// What to ask.
    #[command(flatten)]
    pub traces: TraceArgs,
    /// How metrics are defined.
    #[command(flatten)]
    pub scoring: ScoringArgs,
    /// How to write the answer [default: by the ending of FILE; table on standard output]
    #[arg(long, value_enum)]
    pub format: Option<AnswerFormat>,
    /// Where to write it [default: standard output]
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// The most rows of a table, the first and the last ones; 0 for all
    #[arg(long, value_name = "N", default_value_t = 40)]
    pub rows: usize,
}

/// The formats by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum AnswerFormat {
    /// For people: names, types, the first and the last rows
    Table,
    /// Comma-separated with a header; null is empty
    Csv,
    /// A JSON object a line
    Jsonl,
    /// Parquet; only with -o
    Parquet,
}

impl QueryArgs {
    /// Refuses: the work needs Polars.
    ///
    /// # Errors
    /// Always.
    #[cfg(not(feature = "polars"))]
    pub fn run(self) -> Result<Outcome, Failure> {
        Err(crate::study::StudyError::WithoutPolars { what: "query" }.into())
    }

    /// Runs the query.
    ///
    /// # Errors
    /// Whatever is wrong with the query, the traces, the definitions or the output.
    #[cfg(feature = "polars")]
    pub fn run(self) -> Result<Outcome, Failure> {
        super::super::querying::run(&self)
    }
}

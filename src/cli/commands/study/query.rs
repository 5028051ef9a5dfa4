//! `query`: a SELECT over steps, episodes and cells.

use std::path::PathBuf;

use crate::cli::args::{ScoringArgs, TraceArgs};
use crate::cli::{Failure, Outcome};

/// Run a SELECT over the tables steps, episodes and cells
///
/// `steps` has one row per step, with every column of the traces as it is; a column that one file lacks is null there.
/// `episodes` is what `score` writes, with the labels of coders as true or false, `cells` what `report` writes as cells.csv. Rows come in no fixed order unless the
/// query says ORDER BY. A query reads the traces named and nothing else.
#[derive(Clone, Debug, clap::Args)]
pub struct QueryArgs {
    /// The query, such as "SELECT model, COUNT(*) AS steps FROM steps GROUP BY model ORDER BY model"
    #[arg(value_name = "SELECT")]
    pub query: String,
    #[command(flatten)]
    pub traces: TraceArgs,
    #[command(flatten)]
    pub scoring: ScoringArgs,
    /// The format of the answer [default: by the ending of FILE; table on standard output]
    #[arg(long, value_enum)]
    pub format: Option<AnswerFormat>,
    /// The file to write [default: standard output]
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// The most rows of a table, the first and the last ones; 0 for all
    #[arg(long, value_name = "N", default_value_t = 40)]
    pub rows: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum AnswerFormat {
    /// For people: names, types, the first and the last rows
    Table,
    /// Comma-separated with a header; null is empty
    Csv,
    /// One JSON object per line
    Jsonl,
    /// Parquet; only with -o
    Parquet,
}

impl QueryArgs {
    pub fn run(self) -> Result<Outcome, Failure> {
        rows::answer(&self)
    }
}

/// Refuses the query, which needs Polars.
#[cfg(not(feature = "polars"))]
mod rows {
    use super::{Failure, Outcome, QueryArgs};

    pub fn answer(_: &QueryArgs) -> Result<Outcome, Failure> {
        let words = "`query` needs Polars, which this build lacks\n  \
                     help: build with it: cargo build --release --features polars";
        Err(Failure::input(words))
    }
}

/// Runs a typed query and writes its rows to standard output or a file.
#[cfg(feature = "polars")]
mod rows {
    use std::io::{self, Write as _};
    use std::path::Path;

    use super::{AnswerFormat, Failure, Outcome, QueryArgs};
    use crate::cli::args::GroupingArgs;
    use crate::cli::{output, terminal};
    use mirrorstats_engines::polars::answer::{Excerpt, Format, excerpt, write};
    use mirrorstats_engines::polars::run::PolarsError;
    use mirrorstats_engines::polars::shared_file::{WriteError, write_file};
    use mirrorstats_engines::polars::statement;
    use mirrorstats_exact::format::counted;
    use mirrorstats_exact::replace::is_stream;
    use mirrorstats_study::{StudyError, query};
    use mirrorstats_tables::Table as Printed;

    const NULL: &str = "NULL";

    pub(super) fn answer(args: &QueryArgs) -> Result<Outcome, Failure> {
        let format = format(args)?;
        // Refuse an invalid query before reading the traces.
        let query = statement::check(&args.query).map_err(Failure::Faults)?;
        let study = args.traces.study(&args.scoring, &GroupingArgs::default())?;
        if let Some(path) = &args.output {
            output::check_target(path, study.files_read(None))?;
        }
        let failed = |error: StudyError| failed(error, || query::in_duckdb(&study, &query));
        let (frame, note) = query::query(&study, &query).map_err(failed)?;
        output::notes(note.as_slice());
        match (format, &args.output) {
            (None, path) => {
                let excerpt =
                    excerpt(frame, (args.rows > 0).then_some(args.rows)).map_err(|error| failed(error.into()))?;
                match path {
                    Some(path) => output::write_file(path, render(&excerpt, None).as_bytes())?,
                    None => io::stdout().lock().write_all(render(&excerpt, terminal::width()).as_bytes())?,
                }
            }
            (Some(format), None) => write(frame, format, io::stdout()).map_err(|error| failed(error.into()))?,
            (Some(format), Some(path)) => output::write_file_with(path, |file| {
                write_file(frame, format, file.try_clone()?).map_err(|error| match error {
                    WriteError::Output(error) => Failure::Output(error),
                    WriteError::Polars(error) => failed(error.into()),
                })
            })?,
        }
        Ok(Outcome::Done)
    }

    /// The failure of an engine, with another one that may do better.
    fn failed(error: StudyError, elsewhere: impl FnOnce() -> String) -> Failure {
        match error.cause() {
            Some(PolarsError::Failed(_)) => Failure::input(format!("{error}\n  help: {}", elsewhere())),
            _ => error.into(),
        }
    }

    /// The requested format; `None` for a table.
    fn format(args: &QueryArgs) -> Result<Option<Format>, Failure> {
        let ending =
            args.output.as_deref().and_then(Path::extension).map(|ending| ending.to_string_lossy().to_lowercase());
        let by_ending = match (ending.as_deref(), &args.output) {
            (_, None) | (Some("txt"), _) => AnswerFormat::Table,
            (Some("csv"), _) => AnswerFormat::Csv,
            (Some("jsonl" | "ndjson"), _) => AnswerFormat::Jsonl,
            (Some("parquet"), _) => AnswerFormat::Parquet,
            (_, Some(path)) if args.format.is_none() && !is_stream(path) => {
                return Err(Failure::input(format!(
                    "`{}`: expected a name that ends in .csv, .jsonl, .parquet or .txt\n  help: or say which format with --format",
                    path.display()
                )));
            }
            _ => AnswerFormat::Table,
        };
        Ok(match args.format.unwrap_or(by_ending) {
            AnswerFormat::Table => None,
            AnswerFormat::Csv => Some(Format::Csv),
            AnswerFormat::Jsonl => Some(Format::JsonLines),
            AnswerFormat::Parquet if args.output.is_none() => {
                let words = "Parquet is no text for standard output\n  help: name a file with -o";
                return Err(Failure::input(words));
            }
            AnswerFormat::Parquet => Some(Format::Parquet),
        })
    }

    fn render(excerpt: &Excerpt, width: Option<usize>) -> String {
        let mut table = Printed::of_texts(excerpt.columns.iter().map(|(name, _)| name.as_str()));
        table.push(excerpt.columns.iter().map(|(_, ty)| ty.as_str()));
        let shown = |row: &Vec<Option<String>>| -> Vec<String> {
            row.iter().map(|cell| cell.clone().unwrap_or_else(|| NULL.to_owned())).collect()
        };
        let left_out = excerpt.rows - excerpt.head.len() - excerpt.tail.len();
        let gap = (left_out > 0).then(|| vec!["·".to_owned(); excerpt.columns.len()]);
        let rows = excerpt.head.iter().map(shown).chain(gap).chain(excerpt.tail.iter().map(shown));
        let note = if left_out > 0 { format!(" ({} shown)", excerpt.rows - left_out) } else { String::new() };
        format!("{}{}{note}\n", table.with(rows).within(width), counted(excerpt.rows as u64, "row"))
    }
}

//! `sql`: the statement for computing the episode table on another engine.

use std::ffi::OsString;

use crate::cli::args::{Described, GroupingArgs, ScoringArgs, described};
use crate::cli::{Failure, Outcome, output};
use mirrorstats_metric::sql::{self, Dialect};
use mirrorstats_score::vocabulary::{schema_columns, trace_columns};
use mirrorstats_study::Study;

/// Print the SQL statement that computes the episode table from a table `steps`
#[derive(Clone, Debug, clap::Args)]
pub struct SqlArgs {
    /// Traces whose columns `steps` has [default: those that every trace has; what others mean then is part of the statement]
    #[arg(value_name = "TRACES")]
    pub traces: Vec<OsString>,
    #[command(flatten)]
    pub scoring: ScoringArgs,
    /// The SQL dialect
    #[arg(long, value_parser = described(&DIALECTS), default_value = DIALECTS[0].1)]
    pub dialect: Dialect,
}

const DIALECTS: [Described<Dialect>; 3] = [
    (Dialect::Portable, "portable", "The common subset of all engines"),
    (Dialect::Spark, "spark", "Spark SQL"),
    (Dialect::Duckdb, "duckdb", "`DuckDB`"),
];

impl SqlArgs {
    pub fn run(self) -> Result<Outcome, Failure> {
        let question = self.scoring.question(&GroupingArgs::default());
        let definitions = if self.traces.is_empty() {
            question.bind_to(&schema_columns())?
        } else {
            let study = Study::open(self.traces.clone())?;
            question.resolved(study.traces()?)?.bind_to(&trace_columns(study.traces()?))?
        };
        let statement = sql::lower(&definitions.plan, self.dialect)?;
        output::plain(statement)
    }
}

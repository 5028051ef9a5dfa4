//! `sql`: the statement for computing the episode table on another engine.

use std::ffi::OsString;

use crate::cli::args::{GroupingArgs, ScoringArgs};
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
    #[arg(long, value_enum, default_value_t = DialectArg::Portable)]
    pub dialect: DialectArg,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum DialectArg {
    /// The common subset of all engines
    Portable,
    /// Spark SQL
    Spark,
    /// `DuckDB`
    Duckdb,
}

impl From<DialectArg> for Dialect {
    fn from(dialect: DialectArg) -> Self {
        match dialect {
            DialectArg::Portable => Self::Portable,
            DialectArg::Spark => Self::Spark,
            DialectArg::Duckdb => Self::Duckdb,
        }
    }
}

impl SqlArgs {
    pub fn run(self) -> Result<Outcome, Failure> {
        let question = self.scoring.question(&GroupingArgs::default());
        let definitions = if self.traces.is_empty() {
            question.bind_to(&schema_columns())?
        } else {
            let study = Study::open(self.traces.clone())?;
            question.resolved(study.traces()?)?.bind_to(&trace_columns(study.traces()?))?
        };
        let statement = sql::lower(&definitions.plan, self.dialect.into())?;
        output::plain(statement)
    }
}

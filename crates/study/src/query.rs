//! A SELECT over the steps, episodes and cells of a study.

use engines::polars::answer::{Format, QueryError, plan};
use engines::polars::shared_file::in_memory;
use engines::polars::statement::{self, Checked, Table};
use engines::polars::tables;
use polars::prelude::LazyFrame;

use super::{Study, StudyError};

impl From<QueryError> for StudyError {
    fn from(error: QueryError) -> Self {
        match error {
            QueryError::Faults(faults) => Self::Filter(faults),
            QueryError::Polars(error) => Self::Polars(error),
        }
    }
}

impl Study {
    /// The lazy answer to a checked query, and a note if the filter keeps nothing. Computes only the tables that it
    /// names.
    pub fn query(&self, query: &Checked) -> Result<(LazyFrame, Option<String>), StudyError> {
        let (mut loaded, mut note) = (Vec::new(), None);
        if query.tables.contains(&Table::Steps) {
            loaded.push((Table::Steps, tables::steps(self.traces()?)?));
        }
        if query.tables.contains(&Table::Episodes) || query.tables.contains(&Table::Cells) {
            let scores = self.score()?.episodes;
            note = self.empty_filter(scores.len())?;
            loaded.push((Table::Episodes, tables::episodes(&scores)?));
            if query.tables.contains(&Table::Cells) {
                loaded.push((Table::Cells, tables::cells(&self.cells_of(&scores)?)?));
            }
        }
        Ok((plan(query, loaded)?, note))
    }

    /// The rows of a query as a Parquet file in memory. Errors: a query that cannot be run; faults of the inputs.
    pub fn query_parquet(&self, sql: &str) -> Result<Vec<u8>, StudyError> {
        let (frame, _) = self.query(&statement::check(sql)?)?;
        Ok(in_memory(frame, Format::Parquet)?)
    }
}

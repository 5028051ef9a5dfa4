//! A SELECT over the steps, episodes and cells of a study.

use engines::polars::answer::{QueryError, plan};
use engines::polars::statement::{Checked, Table};
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
    /// The lazy answer to a checked query, and a note if the filter keeps nothing. Tables that it does not name are not computed.
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
}

//! Differences between two open studies.

use std::path::Path;

use crate::Study;
use crate::diff::{Diff, DiffRequest, Pair, Scored, Side, diff};
use crate::error::StudyError;
use crate::inputs::Source;
use report::cells::group::DEFAULT_BY;
use report::layout::TableOrder;
use report::style::Style;
use score::table::EpisodeTable;

impl Study {
    /// The changes from this study to another: cells, and episodes by their ids. Two studies of the same traces under
    /// one filter are scored in one scan, which gives the timesteps that decided each difference. Other studies lack
    /// these timesteps, and a note says so.
    ///
    /// # Errors
    /// As [`Study::score`] for either study; sums of squares beyond 128 bits.
    pub fn diff(&self, other: &Self) -> Result<Diff, StudyError> {
        let by = self.question.by.clone().unwrap_or_else(|| DEFAULT_BY.map(str::to_owned).to_vec());
        if self.differs_in_definitions_alone(other) {
            let side = |study: &Self| Side::Definitions(study.question.definitions_name().to_owned());
            let (metrics, filter) = (self.question.metrics.clone(), self.question.filter.clone());
            let request = DiffRequest { metrics, filter, by, threads: self.threads, ..DiffRequest::default() };
            return diff(&side(self), &side(other), &self.inputs, &request);
        }
        let style = Style::load("default")?;
        let (before, after) = (Scored::of(self.score()?.episodes), Scored::of(other.score()?.episodes));
        let pair = Pair { before, after, evidence: None }.of_common_metrics();
        let mut changes = pair.changes(&by)?;
        TableOrder { catalog: &pair.after.table.catalog, style: &style }.sort(&mut changes);
        let notes = if changes.flips.is_empty() {
            Vec::new()
        } else {
            let why = "the two studies are not of the same traces under one filter";
            vec![format!("the timesteps that decided are not known: {why}")]
        };
        Ok(Diff { changes, notes })
    }

    fn differs_in_definitions_alone(&self, other: &Self) -> bool {
        let question = |study: &Self| crate::Question { definitions: None, ..study.question.clone() };
        let are_traces = [self, other].iter().all(|study| matches!(study.source, Source::Traces(_)));
        are_traces && self.stamps == other.stamps && question(self) == question(other)
    }

    /// The requested definitions: a name or a path.
    pub fn definitions_name(&self) -> &Path {
        self.question.definitions_name()
    }
}

impl Scored {
    fn of(table: EpisodeTable) -> Self {
        let metrics = table.metrics.iter().map(|metric| metric.name.clone()).collect();
        Self { table, metrics, definitions: None }
    }
}

impl Pair {
    fn of_common_metrics(mut self) -> Self {
        let common: Vec<String> =
            self.after.metrics.iter().filter(|name| self.before.metrics.contains(name)).cloned().collect();
        for side in [&mut self.before, &mut self.after] {
            side.table.metrics.retain(|metric| common.contains(&metric.name));
        }
        self
    }
}

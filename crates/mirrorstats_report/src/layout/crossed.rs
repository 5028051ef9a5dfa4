//! Tables of models by experiments: one group of rows for each metric, as papers about robots print them.

use std::iter;

use indexmap::IndexSet;

use super::metric_table::{MetricCell, MetricColumn, MetricRows, MetricTable};
use crate::style::TableLayout;
use mirrorstats_tables::{Column, RowGroup, TableCell};

/// The heading of the means over experiments.
const MEAN: &str = "Mean";

impl MetricTable {
    /// The columns and rows with models on one side and experiments on the other.
    pub(super) fn crossed(&self) -> (Vec<Column>, Vec<RowGroup>) {
        // In the order of their first rows.
        let models = Vec::from_iter(self.rows().map(|row| row.name.as_str()).collect::<IndexSet<_>>());
        let means = (!self.means.is_empty()).then_some(MEAN);
        let experiments: Vec<&str> = self.groups.iter().map(|group| group.short.as_str()).chain(means).collect();
        let is_by_model = self.layout == TableLayout::ModelsByExperiments;
        let (heading, down, across) = if is_by_model {
            (self.row_heading.as_str(), &models, &experiments)
        } else {
            ("Experiment", &experiments, &models)
        };
        let group = |(metric, column): (usize, &MetricColumn)| {
            let row = |(row, name): (usize, &&str)| {
                let cell = |at: usize| {
                    let (experiment, model) = if is_by_model { (at, row) } else { (row, at) };
                    self.crossed_cell(experiment, models[model], metric)
                };
                iter::once((*name).into()).chain((0..across.len()).map(cell)).collect()
            };
            let Column { heading, better, .. } = &column.printed;
            RowGroup {
                heading: Some(better.arrow().map_or_else(|| heading.clone(), |arrow| format!("{heading} {arrow}"))),
                rows: down.iter().enumerate().map(row).collect(),
            }
        };
        let columns = iter::once(Column::left(heading)).chain(across.iter().map(|name| Column::right(*name)));
        (columns.collect(), self.columns.iter().enumerate().map(group).collect())
    }

    /// The cell of a model in an experiment, or its mean behind the last one; the text for undefined if there is none.
    fn crossed_cell(&self, experiment: usize, model: &str, metric: usize) -> TableCell {
        let rows = self.groups.get(experiment).map_or(&self.means, |MetricRows { rows, .. }| rows);
        let found = rows.iter().find(|row| row.name == model).and_then(|row| row.cells.get(metric));
        found.map_or_else(|| self.undefined.as_str().into(), |cell: &MetricCell| cell.printed(&self.undefined))
    }
}

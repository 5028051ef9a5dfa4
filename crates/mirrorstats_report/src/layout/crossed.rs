//! Tables of models by experiments: one group of rows for each metric, as papers about robots print them.

use super::metric_table::{MetricCell, MetricColumn, MetricRows, MetricTable};
use crate::style::TableLayout;
use mirrorstats_tables::{Column, Look, RowGroup, Table, TableCell};

/// The heading of the means over experiments.
const MEAN: &str = "Mean";

impl MetricTable {
    /// The table with models on one side and experiments on the other.
    pub(super) fn crossed(&self) -> Table {
        let models = self.models();
        let is_by_model = self.layout == TableLayout::ModelsByExperiments;
        let mut experiments: Vec<&str> = self.groups.iter().map(|group| group.short.as_str()).collect();
        experiments.extend((!self.means.is_empty()).then_some(MEAN));
        let (heading, across) =
            if is_by_model { (self.row_heading.as_str(), &experiments) } else { ("Experiment", &models) };
        let columns = std::iter::once(Column::left(heading)).chain(across.iter().map(|name| Column::right(*name)));
        let group = |(at, column): (usize, &MetricColumn)| RowGroup {
            heading: Some(match column.better.arrow() {
                Some(arrow) => format!("{} {arrow}", column.heading),
                None => column.heading.clone(),
            }),
            rows: if is_by_model {
                let row = |model: &&str| {
                    let cells = (0..experiments.len()).map(|place| self.crossed_cell(place, model, at));
                    std::iter::once((*model).into()).chain(cells).collect()
                };
                models.iter().map(row).collect()
            } else {
                let row = |(place, name): (usize, &&str)| {
                    let cells = models.iter().map(|model| self.crossed_cell(place, model, at));
                    std::iter::once((*name).into()).chain(cells).collect()
                };
                experiments.iter().enumerate().map(row).collect()
            },
        };
        Table {
            title: self.title.clone(),
            sentences: self.sentences().map(str::to_owned).collect(),
            label: self.label.clone(),
            look: Look::Sheet,
            columns: columns.collect(),
            names: 1,
            is_tied: self.is_tied,
            groups: self.columns.iter().enumerate().map(group).collect(),
        }
    }

    /// The models of all groups in the order of their first rows.
    fn models(&self) -> Vec<&str> {
        let mut models = Vec::new();
        for row in self.rows() {
            if !models.contains(&row.name.as_str()) {
                models.push(row.name.as_str());
            }
        }
        models
    }

    /// The cell of a model in an experiment, or its mean behind the last one; the text for undefined if there is none.
    fn crossed_cell(&self, experiment: usize, model: &str, metric: usize) -> TableCell {
        let rows = self.groups.get(experiment).map_or(&self.means, |MetricRows { rows, .. }| rows);
        let found = rows.iter().find(|row| row.name == model).and_then(|row| row.cells.get(metric));
        found.map_or_else(|| self.undefined.as_str().into(), |cell: &MetricCell| cell.printed(&self.undefined))
    }
}

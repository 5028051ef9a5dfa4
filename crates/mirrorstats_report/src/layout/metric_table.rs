//! A table of cells: metrics in columns, the keys of the episodes in rows.
//!
//! Rule: all decisions are already made here (columns, order, rounding, emphasis, marks). [`MetricTable::printed`] is
//! for people, [`MetricTable::records`] for programs.

use std::iter;

use crate::layout::key_field;
use crate::style::{CellForm, Style, TableLayout};
use mirrorstats_analysis::statistics::Ranks;
use mirrorstats_exact::moments::Moments;
use mirrorstats_exact::number::Decimal;
use mirrorstats_metric::catalogs::catalog::Catalog;
use mirrorstats_score::cells::KeyValue;
use mirrorstats_score::tables::table::CONDITION;
use mirrorstats_tables::{Column, Emphasis, ListTable, Look, RowGroup, Table, TableCell};

/// A table of cells under a style.
#[derive(Clone, Debug, PartialEq)]
pub struct MetricTable {
    /// `main`, `appendix`, ...: the name of its files.
    pub name: String,
    /// The first words of its caption.
    pub title: String,
    /// The sentences after the title.
    pub note: String,
    /// Sentences about its cells, such as the meaning of the dagger.
    pub footnotes: Vec<String>,
    pub label: Option<String>,
    /// The text of an undefined value.
    pub undefined: String,
    pub form: CellForm,
    /// True if bold marks ties for the best, which [`MetricTable::mark_ties`] sets.
    pub is_tied: bool,
    /// The key columns of a row, as the episodes were grouped.
    pub keys: Vec<String>,
    /// The heading of the rows: `Model`.
    pub row_heading: String,
    pub columns: Vec<MetricColumn>,
    /// The rows, in groups that share a heading and compete.
    pub groups: Vec<MetricRows>,
    /// The layout for people.
    pub layout: TableLayout,
    /// The means over the groups, one row for each model, if they are printed.
    pub means: Vec<MetricRow>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MetricColumn {
    pub metric: String,
    /// As printed. The heading is the style's; else the title in domains other than the mirror, whose metrics the paper
    /// abbreviates.
    pub printed: Column,
}

#[derive(Clone, Debug, PartialEq)]
pub struct MetricRows {
    /// `E1: Active mirror-based self-identification`; `None` if there is only one group.
    pub heading: Option<String>,
    /// `E1`, or the title in domains other than the mirror: the heading of a column.
    pub short: String,
    pub rows: Vec<MetricRow>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct MetricRow {
    pub key: Vec<KeyValue>,
    pub name: String,
    pub cells: Vec<MetricCell>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct MetricCell {
    pub value: Value,
    pub emphasis: Emphasis,
    /// True if a dagger marks it because of few episodes.
    pub is_marked: bool,
    /// All episodes of the row, including undefined ones.
    pub episodes: u64,
    /// The episodes where the metric is defined.
    pub n: u64,
    /// The sum of the metric's values, in units of the last of its digits.
    pub sum: i128,
    /// The digits after the point of the metric's values.
    pub decimals: u8,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Value {
    Undefined,
    /// A mean and its standard error, if any.
    MeanSe {
        mean: Decimal,
        se: Option<Decimal>,
    },
    /// A rate as a count of the episodes where it is defined, with Wilson's interval.
    Count {
        count: i128,
        n: u64,
        mean: Decimal,
        spread: Spread,
    },
    /// The mean of a quantity with Student's interval; has `n` if it is not defined in all episodes, or in only one.
    Mean {
        mean: Decimal,
        spread: Spread,
        n: Option<u64>,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spread {
    /// Not given: too few values.
    Unknown,
    /// All values are equal, which is no evidence of certainty.
    AllEqual,
    Interval {
        low: Decimal,
        high: Decimal,
    },
}

impl MetricColumn {
    pub(crate) fn new(metric: &str, style: &Style, catalog: &Catalog) -> Self {
        let sheet = style.sheet.column.get(metric);
        let title = || catalog.domain.as_ref().and(catalog.metric.get(metric)).map(|metric| metric.title.clone());
        let heading = sheet.and_then(|column| column.header.clone()).or_else(title);
        let latex = sheet.and_then(|column| column.latex.clone());
        let better = style.sheet.better(metric, catalog);
        let column = Column::right(heading.unwrap_or_else(|| metric.to_owned()));
        Self { metric: metric.to_owned(), printed: Column { latex, better, ..column } }
    }
}

impl MetricTable {
    /// Sets the models that are tied for the best in bold, and adds `note`.
    ///
    /// Does nothing unless each row is a model in an experiment, and the style asks for ties.
    pub fn mark_ties(&mut self, ranks: &Ranks, note: &str) {
        let place = |name: &str| self.keys.iter().position(|key| key == name);
        let (Some(experiment), Some(model)) = (place("experiment"), place("model")) else { return };
        let condition = place(CONDITION);
        if !self.is_tied || self.keys.len() != 2 + usize::from(condition.is_some()) {
            return;
        }
        let mut is_marked = false;
        for row in self.groups.iter_mut().flat_map(|group| &mut group.rows) {
            let text = |at: usize| row.key[at].to_string();
            let condition = condition.map(text);
            let name = condition.map_or_else(|| text(model), |condition| format!("{} [{condition}]", text(model)));
            for (cell, column) in row.cells.iter_mut().zip(&self.columns) {
                let is_defined = cell.value.mean().is_some();
                if is_defined && ranks.is_tied(&row.key[experiment].to_string(), &name, &column.metric) {
                    cell.emphasis = Emphasis::Bold;
                    is_marked = true;
                }
            }
        }
        if is_marked {
            self.footnotes.insert(0, note.to_owned());
        }
    }

    /// The caption without its title: note and footnotes.
    pub(crate) fn sentences(&self) -> impl Iterator<Item = &str> {
        iter::once(self.note.as_str()).chain(self.footnotes.iter().map(String::as_str)).filter(|s| !s.is_empty())
    }

    /// Both forms of the table.
    pub fn list(&self) -> ListTable {
        ListTable { name: self.name.clone(), printed: self.printed(), records: self.records() }
    }

    pub(crate) fn rows(&self) -> impl Iterator<Item = &MetricRow> {
        self.groups.iter().flat_map(|group| &group.rows)
    }

    /// For people: one line per row.
    pub fn printed(&self) -> Table {
        let (columns, groups) = match self.layout {
            TableLayout::Grouped => self.grouped(),
            TableLayout::ModelsByExperiments | TableLayout::ExperimentsByModels => self.crossed(),
        };
        Table {
            title: self.title.clone(),
            sentences: self.sentences().map(str::to_owned).collect(),
            label: self.label.clone(),
            look: Look::Sheet,
            columns,
            names: 1,
            is_tied: self.is_tied,
            groups,
        }
    }

    fn grouped(&self) -> (Vec<Column>, Vec<RowGroup>) {
        let columns = self.columns.iter().map(|column| column.printed.clone());
        let row = |row: &MetricRow| {
            let cells = row.cells.iter().map(|cell| cell.printed(&self.undefined));
            iter::once(row.name.as_str().into()).chain(cells).collect()
        };
        let groups = self
            .groups
            .iter()
            .map(|group| RowGroup { heading: group.heading.clone(), rows: group.rows.iter().map(row).collect() });
        (iter::once(Column::left(&self.row_heading)).chain(columns).collect(), groups.collect())
    }

    /// For programs: one line per cell, numbers as printed.
    ///
    /// The key columns come first, then `metric`. Cells of mean and standard error continue with `mean,se,emphasis`,
    /// the form of the published tables; cells of counts with `episodes,n,sum,mean,ci_low,ci_high,emphasis`. Undefined
    /// values are empty.
    pub fn records(&self) -> Table {
        let tail = match self.form {
            CellForm::MeanSe => &["mean", "se", "emphasis"][..],
            CellForm::CountInterval => &["episodes", "n", "sum", "mean", "ci_low", "ci_high", "emphasis"],
        };
        let keys = self.keys.iter().map(String::as_str);
        let records = self.rows().flat_map(|row| {
            row.cells.iter().zip(&self.columns).map(|(cell, column)| {
                let keys = row.key.iter().map(key_field);
                keys.chain([column.metric.clone()]).chain(cell.fields(self.form)).collect::<Vec<_>>()
            })
        });
        Table::of_texts(keys.chain(["metric"]).chain(tail.iter().copied())).with(records)
    }
}

impl MetricCell {
    pub fn plain(value: Value, moments: &Moments, episodes: u64) -> Self {
        Self {
            value,
            emphasis: Emphasis::Plain,
            is_marked: false,
            episodes,
            n: moments.n,
            sum: moments.sum,
            decimals: 0,
        }
    }

    pub(super) fn printed(&self, undefined: &str) -> TableCell {
        let (text, detail) = self.value.parts(undefined);
        TableCell {
            text,
            detail,
            is_whole: matches!(self.value, Value::MeanSe { .. }),
            is_number: self.value != Value::Undefined,
            emphasis: self.emphasis,
            is_marked: self.is_marked,
        }
    }

    fn fields(&self, form: CellForm) -> Vec<String> {
        let text = |number: Option<Decimal>| number.map(|number| number.to_string()).unwrap_or_default();
        let (mean, emphasis) = (text(self.value.mean()), self.emphasis.name().to_owned());
        match form {
            CellForm::MeanSe => vec![mean, text(self.value.se()), emphasis],
            CellForm::CountInterval => {
                let [low, high] = match self.value {
                    Value::Count { spread: Spread::Interval { low, high }, .. }
                    | Value::Mean { spread: Spread::Interval { low, high }, .. } => [Some(low), Some(high)],
                    _ => [None, None],
                };
                let sum = Decimal::of_units(self.sum, self.decimals.into());
                let sum = if self.n == 0 { String::new() } else { sum.to_string() };
                vec![self.episodes.to_string(), self.n.to_string(), sum, mean, text(low), text(high), emphasis]
            }
        }
    }
}

impl Value {
    /// The estimate and its uncertainty as plain text.
    pub fn parts(&self, undefined: &str) -> (String, Option<String>) {
        match self {
            Self::Undefined => (undefined.to_owned(), None),
            Self::MeanSe { mean, se } => (mean.to_string(), se.map(|se| format!("± {se}"))),
            Self::Count { count, n, spread, .. } => (format!("{count}/{n}"), spread.text(Decimal::compact)),
            Self::Mean { mean, spread, n } => {
                let of = n.map(|n| format!("n={n}"));
                let parts: Vec<String> = spread.text(|bound| bound.to_string()).into_iter().chain(of).collect();
                (mean.to_string(), (!parts.is_empty()).then(|| parts.join(" ")))
            }
        }
    }

    /// The standard error as printed.
    pub fn se(&self) -> Option<Decimal> {
        if let Self::MeanSe { se, .. } = self { *se } else { None }
    }

    /// The mean as printed, or as it would print.
    pub fn mean(&self) -> Option<Decimal> {
        match self {
            Self::Undefined => None,
            Self::MeanSe { mean, .. } | Self::Count { mean, .. } | Self::Mean { mean, .. } => Some(*mean),
        }
    }
}

impl Spread {
    fn text(self, bound: impl Fn(Decimal) -> String) -> Option<String> {
        match self {
            Self::Unknown => None,
            Self::AllEqual => Some("(all equal)".to_owned()),
            Self::Interval { low, high } => Some(format!("[{}, {}]", bound(low), bound(high))),
        }
    }
}

//! The table: a group of rows per experiment and model, one row per threshold, one column per metric.

use super::{Level, Reference};
use crate::layout::{MetricCell, MetricColumn, MetricRow, MetricRows, MetricTable, Spread, TableOrder, Value};
use crate::style::{CellForm, Style, TableLayout, TableSheet};
use mirrorstats_exact::moments::Moments;
use mirrorstats_exact::number::Decimal;
use mirrorstats_metric::catalogs::catalog::{Kind, Metric};
use mirrorstats_score::cells::{Cell, Cells, Group, KeyValue};

const NOTE: &str = "Mirror evidence is in view where at least so many pixels show the own body by way of the mirror. Rates are \
                    counts of the episodes where the metric is defined; other values are means, n given where it is not \
                    all episodes.";

pub(super) struct Rows<'a> {
    pub levels: &'a [Level],
    /// The cells of the unchanged definitions.
    pub first: &'a Cells,
    pub reference: &'a Reference,
    pub metrics: &'a [String],
    pub style: &'a Style,
}

/// The keys of all levels, in the order of the tables.
pub(super) fn keys(levels: &[Level], first: &Cells, style: &Style) -> Vec<Vec<KeyValue>> {
    let order = TableOrder { catalog: &first.catalog, style };
    let groups = levels.iter().flat_map(|level| &level.cells.groups);
    let mut keys: Vec<Vec<KeyValue>> = groups.map(|group| group.key.clone()).collect();
    keys.sort_by_cached_key(|key| order.of_key(&first.by, key));
    keys.dedup();
    keys
}

impl Rows<'_> {
    pub(super) fn table(&self, keys: &[Vec<KeyValue>], independent: &[String]) -> MetricTable {
        let Self { first, style, .. } = *self;
        let unmoved = format!("The threshold does not move {}.", independent.join(", "));
        MetricTable {
            layout: TableLayout::Grouped,
            means: Vec::new(),
            name: "sensitivity".to_owned(),
            title: "Sensitivity to the threshold of mirror evidence".to_owned(),
            note: NOTE.to_owned(),
            footnotes: if independent.is_empty() { Vec::new() } else { vec![unmoved] },
            label: Some("tab:sensitivity".to_owned()),
            undefined: style.sheet.undefined.clone(),
            form: CellForm::CountInterval,
            is_tied: false,
            keys: first.by.iter().cloned().chain(["threshold".to_owned()]).collect(),
            row_heading: "Threshold".to_owned(),
            columns: self.metrics.iter().map(|metric| MetricColumn::new(metric, style, &first.catalog)).collect(),
            groups: keys.iter().map(|key| self.group(key)).collect(),
        }
    }

    fn group(&self, key: &[KeyValue]) -> MetricRows {
        let parts = self.first.by.iter().zip(key).map(|(name, value)| match name.as_str() {
            "experiment" | "model" => value.to_string(),
            _ => format!("{name} {value}"),
        });
        let rows = self.levels.iter().filter_map(|level| self.row(level, level.group(key)?));
        let heading = parts.collect::<Vec<_>>().join(", ");
        MetricRows { short: heading.clone(), heading: Some(heading), rows: rows.collect() }
    }

    fn row(&self, level: &Level, group: &Group) -> Option<MetricRow> {
        let (name, threshold) = match level.px {
            Some(px) => (format!("{px} px"), KeyValue::Int(px.into())),
            None => (self.reference.words(), KeyValue::Text(self.reference.word().to_owned())),
        };
        let cell = |metric: &String| {
            let Cell { metric, moments, .. } = level.cells.of_metric(group, metric)?;
            Some(MetricCell::plain(value(moments, metric, group.episodes, self.style), moments, group.episodes))
        };
        let cells = self.metrics.iter().map(cell).collect::<Option<Vec<_>>>()?;
        Some(MetricRow { key: group.key.iter().cloned().chain([threshold]).collect(), name, cells })
    }
}

fn value(moments: &Moments, metric: &Metric, episodes: u64, style: &Style) -> Value {
    let places = style.sheet.print_of(&TableSheet::default()).decimals.of(metric.kind);
    let Some(mean) = Decimal::of_ratio(moments.sum, i128::from(moments.n) * i128::from(metric.scale()), places) else {
        return Value::Undefined;
    };
    match metric.kind {
        Kind::Rate => Value::Count { count: moments.sum, n: moments.n, mean, spread: Spread::Unknown },
        Kind::Quantity => {
            Value::Mean { mean, spread: Spread::Unknown, n: (moments.n != episodes).then_some(moments.n) }
        }
    }
}

//! The table: a group of rows per experiment and model, one row per threshold, one column per metric.

use super::{Level, Reference};
use crate::layout::{MetricCell, MetricColumn, MetricRow, MetricRows, MetricTable, Spread, TableOrder, Value};
use crate::style::{CellForm, Style, TableSheet};
use mirrorstats_exact::moments::Moments;
use mirrorstats_exact::number::Decimal;
use mirrorstats_metric::catalogs::catalog::{Better, Kind, Metric};
use mirrorstats_score::cells::{Cell, Group, KeyValue};

const NOTE: &str = "Mirror evidence is in view where at least so many pixels show the own body by way of the mirror. Rates are \
                    counts of the episodes where the metric is defined; other values are means, n given where it is not \
                    all episodes.";

pub(super) fn table(
    levels: &[Level],
    reference: &Reference,
    (metrics, independent): (&[String], &[String]),
    style: &Style,
) -> MetricTable {
    let unmoved = format!("The threshold does not move {}.", independent.join(", "));
    MetricTable {
        name: "sensitivity".to_owned(),
        title: "Sensitivity to the threshold of mirror evidence".to_owned(),
        note: NOTE.to_owned(),
        footnotes: if independent.is_empty() { Vec::new() } else { vec![unmoved] },
        label: Some("tab:sensitivity".to_owned()),
        undefined: style.sheet.undefined.clone(),
        form: CellForm::CountInterval,
        is_tied: false,
        keys: by(levels).iter().cloned().chain(["threshold".to_owned()]).collect(),
        row_heading: "Threshold".to_owned(),
        columns: metrics.iter().map(|metric| column(metric, levels, style)).collect(),
        groups: keys(levels, style).iter().map(|key| group(key, levels, reference, (metrics, style))).collect(),
    }
}

pub(super) fn keys(levels: &[Level], style: &Style) -> Vec<Vec<KeyValue>> {
    let Some(first) = levels.first() else { return Vec::new() };
    let order = TableOrder { catalog: &first.cells.catalog, style };
    let groups = levels.iter().flat_map(|level| &level.cells.groups);
    let mut keys: Vec<Vec<KeyValue>> = groups.map(|group| group.key.clone()).collect();
    keys.sort_by_cached_key(|key| order.of_key(&first.cells.by, key));
    keys.dedup();
    keys
}

fn by(levels: &[Level]) -> &[String] {
    levels.first().map_or(&[], |level| &level.cells.by)
}

fn column(metric: &str, levels: &[Level], style: &Style) -> MetricColumn {
    let better = levels.first().map(|level| style.sheet.better(metric, &level.cells.catalog));
    MetricColumn {
        metric: metric.to_owned(),
        latex: style.sheet.column.get(metric).and_then(|column| column.latex.clone()),
        better: better.unwrap_or(Better::Neither),
    }
}

fn group(key: &[KeyValue], levels: &[Level], reference: &Reference, shown: (&[String], &Style)) -> MetricRows {
    let parts = by(levels).iter().zip(key).map(|(name, value)| match name.as_str() {
        "experiment" | "model" => value.to_string(),
        _ => format!("{name} {value}"),
    });
    let rows = levels.iter().filter_map(|level| row(level, level.group(key)?, reference, shown));
    MetricRows { heading: Some(parts.collect::<Vec<_>>().join(", ")), rows: rows.collect() }
}

fn row(
    level: &Level,
    group: &Group,
    reference: &Reference,
    (metrics, style): (&[String], &Style),
) -> Option<MetricRow> {
    let (name, threshold) = match level.px {
        Some(px) => (format!("{px} px"), KeyValue::Int(px.into())),
        None => (reference.words(), KeyValue::Text(reference.word().to_owned())),
    };
    let cell = |metric: &String| {
        let Cell { metric, moments, .. } = level.cells.of_metric(group, metric)?;
        Some(MetricCell::plain(value(moments, metric, group.episodes, style), moments, group.episodes))
    };
    let cells = metrics.iter().map(cell).collect::<Option<Vec<_>>>()?;
    Some(MetricRow { key: group.key.iter().cloned().chain([threshold]).collect(), name, cells })
}

fn value(moments: &Moments, metric: &Metric, episodes: u64, style: &Style) -> Value {
    let places = style.sheet.print_of(&TableSheet::default()).decimals.of(metric.kind);
    let Some(mean) = Decimal::of_ratio(moments.sum, i128::from(moments.n), places) else { return Value::Undefined };
    match metric.kind {
        Kind::Rate => Value::Count { count: moments.sum, n: moments.n, mean, spread: Spread::Unknown },
        Kind::Quantity => {
            Value::Mean { mean, spread: Spread::Unknown, n: (moments.n != episodes).then_some(moments.n) }
        }
    }
}

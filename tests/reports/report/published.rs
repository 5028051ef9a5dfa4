//! The published tables as cells: for each published value, moments of integers that print it.
//!
//! A rate is the k of n episodes that prints the published mean and standard error. A duration is a sum over 21
//! episodes, and a sum of squares that fits its standard error. If several fit, the choice does not matter here: the
//! tests are about how they print.

use std::collections::BTreeMap;
use std::fs;
use std::sync::LazyLock;

use indexmap::IndexMap;
use mirrorstats_exact::moments::Moments;
use mirrorstats_metric::catalogs::catalog::{Better, Catalog, Kind, Metric, StandardError};
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_report::layout::{self, MetricTable, Value, value};
use mirrorstats_report::style::Style;
use mirrorstats_score::cells::{Cell as CellOf, Cells, Group, KeyValue};
use mirrorstats_score::vocabulary::schema_columns;

/// The number of episodes behind every published cell.
pub const EPISODES: u64 = 21;

/// A published cell: mean and standard error as printed.
#[derive(Clone, Debug)]
pub struct Published {
    pub experiment: String,
    pub model: String,
    pub metric: String,
    pub mean: String,
    pub se: String,
}

pub fn path(table: &str, ending: &str) -> String {
    format!("{}/fixtures/published/{table}_table.{ending}", env!("CARGO_MANIFEST_DIR"))
}

pub fn published(table: &str) -> Vec<Published> {
    let text = fs::read_to_string(path(table, "csv")).unwrap();
    let line = |line: &str| {
        let fields: Vec<String> = line.split(',').map(str::to_owned).collect();
        let [experiment, model, metric, mean, se, _] = fields.try_into().unwrap();
        Published { experiment, model, metric, mean, se }
    };
    text.lines().skip(1).map(line).collect()
}

/// The cells behind both published tables.
pub fn cells() -> Cells {
    static CELLS: LazyLock<Cells> = LazyLock::new(find_cells);
    CELLS.clone()
}

fn find_cells() -> Cells {
    let catalog = catalog();
    let style = Style::load("paper").unwrap();
    let mut found: BTreeMap<(String, String), IndexMap<String, Moments>> = BTreeMap::new();
    for table in ["main", "appendix"] {
        let print = style.sheet.print_of(&style.sheet.table[table]);
        for cell in published(table) {
            let moments = found.entry((cell.experiment.clone(), cell.model.clone())).or_default();
            if !moments.contains_key(&cell.metric) {
                let metric = &catalog.metric[&cell.metric];
                let prints = |m: &Moments| {
                    let cell_of = CellOf { key: &[], name: &cell.metric, metric, moments: m, interval: None };
                    match value::value(&cell_of, EPISODES, &print) {
                        Value::MeanSe { mean, se: Some(se) } => {
                            (mean.to_string(), se.to_string()) == published_numbers(&cell)
                        }
                        _ => false,
                    }
                };
                let fitting = moments_that_print(&cell, metric, prints);
                moments.insert(cell.metric.clone(), fitting);
            }
        }
    }
    let metrics: Vec<String> = catalog.metric.keys().cloned().collect();
    let group = |((experiment, model), moments): ((String, String), IndexMap<String, Moments>)| Group {
        key: vec![KeyValue::Text(experiment), KeyValue::Text(model)],
        episodes: EPISODES,
        moments: metrics.iter().map(|metric| moments[metric]).collect(),
        repeats: false,
    };
    Cells {
        by: vec!["experiment".to_owned(), "model".to_owned()],
        groups: found.into_iter().map(group).collect(),
        metrics: metrics.clone(),
        ranges: Vec::new(),
        catalog,
    }
}

/// The published numbers as rule 5 prints them; the one mean that breaks the rule is corrected.
fn published_numbers(cell: &Published) -> (String, String) {
    let is_slip = (cell.experiment.as_str(), cell.model.as_str(), cell.metric.as_str()) == ("E3", "Gemma4 26B", "TTD");
    let mean = if is_slip { "57.91" } else { cell.mean.as_str() };
    (mean.to_owned(), cell.se.clone())
}

fn moments_that_print(cell: &Published, metric: &Metric, prints: impl Fn(&Moments) -> bool) -> Moments {
    let is_undefined_zero =
        cell.metric == "MTATO" && cell.model == "Ministral 3 14B" && ["E2", "E5"].contains(&&*cell.experiment);
    if cell.mean.is_empty() || is_undefined_zero {
        return Moments::default();
    }
    let found = match metric.kind {
        Kind::Rate => rates().find(prints),
        Kind::Quantity => quantities(cell).find(prints),
    };
    found.unwrap_or_else(|| panic!("no integers print {cell:?}"))
}

fn rates() -> impl Iterator<Item = Moments> {
    (1..=EPISODES).rev().flat_map(|n| (0..=i128::from(n)).map(move |k| Moments { n, sum: k, sum_sq: k }))
}

#[expect(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "small numbers of a test")]
fn quantities(cell: &Published) -> impl Iterator<Item = Moments> + use<> {
    let (mean, se): (f64, f64) = (cell.mean.parse().unwrap(), cell.se.parse().unwrap());
    let n = i128::from(EPISODES);
    let middle = (mean * 21.0).round() as i128;
    (middle - 1..=middle + 1).flat_map(move |sum| {
        let square = ((se * se * 420.0) + (sum * sum) as f64 / 21.0).round() as i128;
        let reach = (se * 10.0) as i128 + n;
        (square - reach..=square + reach).map(move |sum_sq| Moments { n: EPISODES, sum, sum_sq })
    })
}

pub fn tables(style: &str) -> Vec<MetricTable> {
    layout::tables(&cells(), &Style::load(style).unwrap()).unwrap()
}

/// The definitions of the paper.
pub fn catalog() -> Catalog {
    Definitions::load("paper", &schema_columns()).unwrap().catalog
}

pub fn metric_of(kind: Kind, better: Better, when: Option<String>, se: StandardError) -> Metric {
    Metric {
        title: String::new(),
        kind,
        unit: String::new(),
        decimals: 0,
        better,
        section: String::new(),
        help: String::new(),
        value: String::new(),
        when,
        se,
        chance: None,
        measures: None,
        range: None,
        finished: None,
        completes: None,
    }
}

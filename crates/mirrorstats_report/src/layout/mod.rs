//! Cells under a style: the tables with their rows, columns and order.
//!
//! The last key column, or the model if it is a key, names the rows; the other keys head the groups. Every metric of
//! the cells is in some table: those that the style does not name get their own table.

mod crossed;
pub(crate) mod emphasis;
mod metric_table;
mod order;
pub mod quality;
pub mod value;

use crate::style::{EmphasisRule, MAIN_TABLE, OTHER_TABLE, Print, Style, StyleError, TableLayout, TableSheet};
use mirrorstats_exact::moments::Moments;
use mirrorstats_exact::number::Decimal;
use mirrorstats_metric::catalogs::catalog::Catalog;
use mirrorstats_score::cells::{Cells, Group, KeyValue};
use mirrorstats_statistics::intervals::coverage::STUDENT;
use mirrorstats_tables::{DAGGER, Emphasis, text_field};

use self::emphasis::emphasise;
pub use self::metric_table::{MetricCell, MetricColumn, MetricRow, MetricRows, MetricTable, Spread, Value};
pub use self::order::TableOrder;
pub(crate) use self::order::row_key;

/// The tables of a report, in the order of the style; the first is `main`.
///
/// A table without any of its metrics is omitted, except that `main` then takes every metric.
pub fn tables(cells: &Cells, style: &Style) -> Result<Vec<MetricTable>, StyleError> {
    style.check_against(&cells.catalog)?;
    let sheets = sheets(cells, style);
    Ok(sheets.iter().map(|(name, sheet)| Layout::new(cells, style, sheet).table(name, sheet)).collect())
}

/// A key as a field of a CSV file.
pub(crate) fn key_field(value: &KeyValue) -> String {
    match value {
        KeyValue::Text(text) => text_field(text),
        value => value.to_string(),
    }
}

/// The most metrics in `main` that the style does not name: its columns have to fit on a page.
const MOST_IN_MAIN: usize = 6;

/// The style's tables with the available columns, `main` first. Metrics that the style does not name are in `main` if
/// the style is built in (it cannot name others) and they are few; otherwise in a table after it.
fn sheets(cells: &Cells, style: &Style) -> Vec<(String, TableSheet)> {
    let exists = |metric: &String| cells.metrics.contains(metric) && cells.catalog.metric.contains_key(metric);
    let present = |sheet: &TableSheet| TableSheet {
        columns: sheet.columns.iter().filter(|metric| exists(metric)).cloned().collect(),
        ..sheet.clone()
    };
    let mut sheets: Vec<(String, TableSheet)> =
        style.sheet.table.iter().map(|(name, sheet)| (name.clone(), present(sheet))).collect();
    sheets.sort_by_key(|(name, _)| name != MAIN_TABLE);
    let is_named = |metric: &String| sheets.iter().any(|(_, sheet)| sheet.columns.contains(metric));
    let left_over: Vec<String> = cells.metrics.iter().filter(|m| exists(m) && !is_named(m)).cloned().collect();
    if let Some((_, main)) = sheets.first_mut().filter(|(_, main)| main.columns.is_empty()) {
        main.columns = cells.metrics.iter().filter(|metric| exists(metric)).cloned().collect();
    } else if style.is_built_in && left_over.len() <= MOST_IN_MAIN {
        sheets.iter_mut().take(1).for_each(|(_, main)| main.columns.extend(left_over.iter().cloned()));
    } else if !left_over.is_empty() {
        sheets.insert(1, (OTHER_TABLE.to_owned(), other(left_over)));
    }
    sheets.retain(|(name, sheet)| name == MAIN_TABLE || !sheet.columns.is_empty());
    sheets
}

fn other(columns: Vec<String>) -> TableSheet {
    TableSheet {
        title: "Further metrics".to_owned(),
        label: Some(format!("tab:{OTHER_TABLE}")),
        columns,
        ..TableSheet::default()
    }
}

struct Layout<'a> {
    cells: &'a Cells,
    style: &'a Style,
    print: Print,
    row_key: usize,
}

impl<'a> Layout<'a> {
    fn new(cells: &'a Cells, style: &'a Style, sheet: &TableSheet) -> Self {
        Self { cells, style, print: style.sheet.print_of(sheet), row_key: row_key(&cells.by) }
    }

    fn table(&self, name: &str, sheet: &TableSheet) -> MetricTable {
        let mut groups = self.groups(sheet);
        if self.cells.by.get(self.row_key).is_some_and(|key| key == "model") {
            self.emphasise(&mut groups, sheet);
        }
        let means = if sheet.mean { self.means(&groups, sheet) } else { Vec::new() };
        MetricTable {
            layout: if self.cells.by.len() > 1 { sheet.layout } else { TableLayout::Grouped },
            means,
            name: name.to_owned(),
            title: sheet.title.clone(),
            note: sheet.note(name, self.print.cell).to_owned(),
            footnotes: self.footnotes(&groups),
            label: sheet.label.clone(),
            undefined: self.style.sheet.undefined.clone(),
            form: self.print.cell,
            is_tied: self.print.emphasis == EmphasisRule::Tied,
            keys: self.cells.by.clone(),
            row_heading: heading(self.cells.by.get(self.row_key).map_or("", String::as_str)),
            columns: sheet.columns.iter().map(|m| MetricColumn::new(m, self.style, &self.cells.catalog)).collect(),
            groups,
        }
    }

    fn footnotes(&self, groups: &[MetricRows]) -> Vec<String> {
        let cells = || groups.iter().flat_map(|group| &group.rows).flat_map(|row| &row.cells);
        let mut notes = Vec::new();
        if cells().any(|cell| cell.emphasis != Emphasis::Plain) {
            notes.push(self.style.sheet.emphasis_note(self.print.emphasis).to_owned());
        }
        if cells().any(|cell| cell.is_marked) {
            notes.push(format!("{DAGGER} defined in fewer than {} episodes.", self.print.mark_n_below));
        }
        let is_few =
            |value: &Value| matches!(value, Value::Mean { spread: Spread::Unknown, n: Some(n), .. } if *n < STUDENT);
        if cells().any(|cell| is_few(&cell.value)) {
            notes.push(format!(
                "A mean of fewer than {STUDENT} episodes has no interval: it would miss the truth too often."
            ));
        }
        if cells().any(|cell| matches!(cell.value, Value::Count { spread: Spread::Unknown, .. })) {
            notes.push(
                "Episodes that share a scene, seed or participant have no interval here; `stats` has intervals over those units."
                    .to_owned(),
            );
        }
        notes
    }

    fn groups(&self, sheet: &TableSheet) -> Vec<MetricRows> {
        let mut ordered: Vec<&Group> = self.cells.groups.iter().collect();
        let order = TableOrder { catalog: &self.cells.catalog, style: self.style };
        ordered.sort_by_cached_key(|group| order.of_key(&self.cells.by, &group.key));
        let runs = ordered.chunk_by(|a, b| self.heading_keys(a).eq(self.heading_keys(b)));
        runs.map(|run| MetricRows {
            heading: self.heading(run[0]),
            short: self.short_heading(run[0]),
            rows: run.iter().map(|group| self.row(group, sheet)).collect(),
        })
        .collect()
    }

    fn heading_keys<'g>(&self, group: &'g Group) -> impl Iterator<Item = (usize, &'g KeyValue)> {
        let row_key = self.row_key;
        group.key.iter().enumerate().filter(move |(at, _)| *at != row_key)
    }

    fn heading(&self, group: &Group) -> Option<String> {
        let parts: Vec<String> = self
            .heading_keys(group)
            .map(|(at, value)| match self.cells.by[at].as_str() {
                "experiment" => experiment(&self.cells.catalog, &value.to_string()),
                key => format!("{} {}", words(key), self.name(value)),
            })
            .collect();
        (!parts.is_empty()).then(|| parts.join(", "))
    }

    fn short_heading(&self, group: &Group) -> String {
        let of_key = |(at, value): (usize, &KeyValue)| {
            let name = self.name(value);
            let is_titled = self.cells.by[at] == "experiment" && self.cells.catalog.domain.is_some();
            let title = || self.cells.catalog.experiment.get(&name).map(|experiment| experiment.title.clone());
            is_titled.then(title).flatten().filter(|title| !title.is_empty()).unwrap_or(name)
        };
        self.heading_keys(group).map(of_key).collect::<Vec<_>>().join(", ")
    }

    /// The unweighted mean of each model's means over all groups; undefined where a group has none.
    fn means(&self, groups: &[MetricRows], sheet: &TableSheet) -> Vec<MetricRow> {
        let mut rows: Vec<MetricRow> = Vec::new();
        for row in groups.iter().flat_map(|group| &group.rows) {
            if rows.iter().any(|known| known.name == row.name) {
                continue;
            }
            let same = groups.iter().map(|group| group.rows.iter().find(|other| other.name == row.name));
            let keys: Option<Vec<_>> = same.map(|row| row.map(|row| &row.key)).collect();
            let cells = sheet.columns.iter().map(|metric| {
                let value = keys.as_ref().and_then(|keys| self.mean_of_means(keys, metric));
                MetricCell::plain(value.unwrap_or(Value::Undefined), &Moments::default(), 0)
            });
            rows.push(MetricRow { cells: cells.collect(), ..row.clone() });
        }
        rows
    }

    fn mean_of_means(&self, keys: &[&Vec<KeyValue>], metric: &str) -> Option<Value> {
        let mut sum = 0.0;
        let mut places = 0;
        for key in keys {
            let group = self.cells.groups.iter().find(|group| group.key == **key)?;
            let cell = self.cells.of_metric(group, metric)?;
            let (mean, digits) = value::unrounded_mean(&cell, &self.print)?;
            (sum, places) = (sum + mean, digits);
        }
        #[expect(clippy::cast_precision_loss, reason = "a number of experiments")]
        let mean = Decimal::of_float(sum / keys.len() as f64, places)?;
        Some(Value::Mean { mean, spread: Spread::Unknown, n: None })
    }

    fn name(&self, value: &KeyValue) -> String {
        match value {
            KeyValue::Missing => self.style.sheet.undefined.clone(),
            value => value.to_string(),
        }
    }

    fn row(&self, group: &Group, sheet: &TableSheet) -> MetricRow {
        MetricRow {
            key: group.key.clone(),
            name: group.key.get(self.row_key).map(|value| self.name(value)).unwrap_or_default(),
            cells: sheet.columns.iter().filter_map(|metric| self.cell(group, metric, sheet)).collect(),
        }
    }

    fn cell(&self, group: &Group, name: &str, sheet: &TableSheet) -> Option<MetricCell> {
        let cell = self.cells.of_metric(group, name)?;
        let (metric, moments) = (cell.metric, cell.moments);
        let is_zero = moments.n == 0 && sheet.undefined_as_zero.iter().any(|zero| zero == name);
        let value =
            if is_zero { value::zero(metric, &self.print) } else { value::value(&cell, group.episodes, &self.print) };
        let is_marked = moments.n < self.print.mark_n_below && value != Value::Undefined;
        let decimals = metric.decimals;
        Some(MetricCell { is_marked, decimals, ..MetricCell::plain(value, moments, group.episodes) })
    }

    fn emphasise(&self, groups: &mut [MetricRows], sheet: &TableSheet) {
        for group in groups {
            for (at, metric) in sheet.columns.iter().enumerate() {
                let mut column: Vec<&mut MetricCell> =
                    group.rows.iter_mut().filter_map(|row| row.cells.get_mut(at)).collect();
                emphasise(&mut column, self.style.sheet.better(metric, &self.cells.catalog), self.print.emphasis);
            }
        }
    }
}

/// `E1: Active mirror-based self-identification`, or only the name without a title.
fn experiment(catalog: &Catalog, name: &str) -> String {
    match catalog.experiment.get(name).map(|experiment| experiment.title.as_str()) {
        None | Some("") => name.to_owned(),
        Some(title) => format!("{name}: {title}"),
    }
}

fn words(key: &str) -> String {
    key.replace('_', " ")
}

/// A key column as a heading: `Body color`.
pub(crate) fn heading(key: &str) -> String {
    let words = words(key);
    let mut letters = words.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}

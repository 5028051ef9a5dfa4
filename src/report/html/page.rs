//! The page as its templates take it: text in order, every decision taken.

use std::collections::BTreeSet;

use minijinja::value::Value;
use serde::Serialize;

use super::cell::{CellView, chance};
use super::embedded;
use super::filter::{Filter, Filters};
use super::metric::{ExperimentView, LetView, MetricView};
use super::provenance::Provenance;
use super::template::markup;
use super::{Figure, HtmlError, Page};
use crate::base::visible::visible;
use crate::cells::cell::{Cells, Group, KeyValue};
use crate::cells::group::group;
use crate::metric::catalog::Better;
use crate::report::figures;
use crate::report::layout::heading;
use crate::report::order::row_key;
use crate::report::statistics::{Statistics, text};
use crate::report::table::{Row, RowGroup, Table};
use crate::score::table::{EpisodeTable, KeyRef};

/// Everything that a report puts into its page.
#[derive(Debug, Serialize)]
pub(super) struct Content {
    /// The font of page and figures, as a style sheet.
    font: Value,
    counts: Counts,
    filters: Vec<Filter>,
    tables: Vec<TableView>,
    figures: Vec<FigureView>,
    statistics: Option<StatisticsView>,
    metrics: Vec<MetricView>,
    lets: Vec<LetView>,
    experiments: Vec<ExperimentView>,
    provenance: Provenance,
    /// JSON for the script.
    data: Value,
}

/// How much there is.
#[derive(Debug, Serialize)]
struct Counts {
    episodes: usize,
    models: usize,
    experiments: usize,
}

#[derive(Debug, Serialize)]
struct TableView {
    name: String,
    title: String,
    sentences: Vec<String>,
    row_heading: String,
    /// What heads the groups in words, empty where all rows are of one: `Experiment`.
    group_heading: String,
    columns: Vec<ColumnView>,
    groups: Vec<GroupView>,
}

#[derive(Debug, Serialize)]
struct ColumnView {
    metric: String,
    arrow: Option<char>,
    /// The direction to sort by first.
    best_first: &'static str,
}

#[derive(Debug, Serialize)]
struct GroupView {
    heading: Option<String>,
    /// The heading's keys alone: `E1`.
    short: String,
    rows: Vec<RowView>,
}

#[derive(Debug, Serialize)]
struct RowView {
    name: String,
    /// The position of its group of episodes.
    group: usize,
    /// The places of its keys among the values of the filters.
    places: String,
    episodes: u64,
    experiment: Option<String>,
    model: Option<String>,
    cells: Vec<CellView>,
}

#[derive(Debug, Serialize)]
struct FigureView {
    name: String,
    title: String,
    caption: String,
    svg: Value,
}

#[derive(Debug, Serialize)]
struct StatisticsView {
    conclusions: Vec<String>,
    warnings: Vec<String>,
    text: String,
}

impl Content {
    /// The content of a page.
    ///
    /// # Errors
    /// When tables, cells and episodes are not of one report.
    pub(super) fn of(page: &Page<'_>) -> Result<Self, HtmlError> {
        if group(page.episodes, &page.cells.by)? != *page.cells {
            return Err(HtmlError::OtherEpisodes);
        }
        let undefined = page.tables.first().map_or("", |table| table.undefined.as_str());
        let catalog = &page.cells.catalog;
        let filters = Filters::of(page.tables, page.cells, undefined);
        let metrics = MetricView::all(catalog);
        let data = embedded::json(page.episodes, page.cells, &metrics, undefined)?;
        let table = |table: &Table| TableView::new(table, page.cells, &filters);
        Ok(Self {
            font: markup(&figures::font_style_sheet()),
            counts: Counts::of(page.episodes),
            tables: page.tables.iter().map(table).collect::<Result<_, _>>()?,
            filters: filters.filters,
            figures: page.figures.iter().map(FigureView::new).collect(),
            statistics: page.statistics.map(StatisticsView::new),
            metrics,
            lets: LetView::all(catalog),
            experiments: ExperimentView::all(catalog),
            provenance: Provenance::of(page.manifest),
            data: markup(&data),
        })
    }
}

impl Counts {
    fn of(episodes: &EpisodeTable) -> Self {
        let distinct = |of: fn(KeyRef<'_>) -> &str| episodes.keys.iter().map(of).collect::<BTreeSet<_>>().len();
        Self {
            episodes: episodes.len(),
            models: distinct(|key| key.model),
            experiments: distinct(|key| key.experiment),
        }
    }
}

impl TableView {
    fn new(table: &Table, cells: &Cells, filters: &Filters) -> Result<Self, HtmlError> {
        let row_key = row_key(&table.keys);
        let group_keys: Vec<&str> = others(&table.keys, row_key).map(String::as_str).collect();
        let group = |group: &RowGroup| GroupView::new(group, table, cells, filters);
        Ok(Self {
            name: table.name.clone(),
            title: visible(&table.title),
            sentences: table.sentences().map(visible).collect(),
            row_heading: visible(&table.row_heading),
            group_heading: heading(&visible(&group_keys.join(", "))),
            columns: table.columns.iter().map(ColumnView::new).collect(),
            groups: table.groups.iter().map(group).collect::<Result<_, _>>()?,
        })
    }
}

impl ColumnView {
    fn new(column: &crate::report::table::Column) -> Self {
        let best_first = match column.better {
            Better::Higher | Better::Neither => "descending",
            Better::Lower => "ascending",
        };
        Self { metric: visible(&column.metric), arrow: column.better.arrow(), best_first }
    }
}

impl GroupView {
    fn new(group: &RowGroup, table: &Table, cells: &Cells, filters: &Filters) -> Result<Self, HtmlError> {
        let first = group.rows.first().map_or(&[][..], |row| &row.key);
        let short = others(first, row_key(&table.keys)).map(|value| shown(value, &table.undefined));
        let row = |row: &Row| RowView::new(row, table, cells, filters);
        Ok(Self {
            heading: group.heading.as_deref().map(visible),
            short: short.collect::<Vec<_>>().join(", "),
            rows: group.rows.iter().map(row).collect::<Result<_, _>>()?,
        })
    }
}

impl RowView {
    fn new(row: &Row, table: &Table, cells: &Cells, filters: &Filters) -> Result<Self, HtmlError> {
        let stray = || HtmlError::StrayRow { table: table.name.clone(), row: row.name.clone() };
        let at = cells.groups.binary_search_by(|group| group.key.cmp(&row.key)).map_err(|_| stray())?;
        let group = &cells.groups[at];
        let key = |name: &str| cells.by.iter().position(|key| key == name).map(|at| row.key[at].to_string());
        let experiment = key("experiment");
        let cell = |(cell, column): (&crate::report::table::Cell, &crate::report::table::Column)| {
            let (metric, moments) = found(cells, group, &column.metric)?;
            let level = chance(&cells.catalog, experiment.as_deref(), &column.metric);
            Some(CellView::new(cell, (&column.metric, metric), moments, &table.undefined, level))
        };
        let views = row.cells.iter().zip(&table.columns).map(cell).collect::<Option<_>>().ok_or_else(stray)?;
        Ok(Self {
            name: visible(&row.name),
            group: at,
            places: filters.places(&row.key),
            episodes: group.episodes,
            model: key("model").as_deref().map(visible),
            experiment: experiment.as_deref().map(visible),
            cells: views,
        })
    }
}

/// The definition and the moments of a metric in a group.
fn found<'a>(
    cells: &'a Cells,
    group: &'a Group,
    name: &str,
) -> Option<(&'a crate::metric::catalog::Metric, &'a crate::cells::moments::Moments)> {
    let at = cells.metrics.iter().position(|metric| metric == name)?;
    Some((cells.catalog.metric.get(name)?, group.moments.get(at)?))
}

impl FigureView {
    fn new(figure: &Figure<'_>) -> Self {
        Self {
            name: visible(figure.name),
            title: visible(figure.title),
            caption: visible(figure.caption),
            svg: markup(figure.svg),
        }
    }
}

impl StatisticsView {
    fn new(statistics: &Statistics) -> Self {
        let all = |sentences: &[String]| sentences.iter().map(|sentence| visible(sentence)).collect();
        Self {
            conclusions: all(&statistics.conclusions),
            warnings: all(&statistics.warnings),
            text: text::render(statistics, &statistics.headline, None),
        }
    }
}

/// All but the item at a place.
fn others<T>(items: &[T], place: usize) -> impl Iterator<Item = &T> {
    items.iter().enumerate().filter(move |(at, _)| *at != place).map(|(_, item)| item)
}

/// A value of a key column as a reader sees it.
pub(super) fn shown(value: &KeyValue, undefined: &str) -> String {
    match value {
        KeyValue::Missing => visible(undefined),
        value => visible(&value.to_string()),
    }
}

//! The page as input of its templates: text in order, with all decisions made.

use std::collections::BTreeSet;

use minijinja::context;
use minijinja::value::{Serde, Value};
use serde_json::{Value as Json, json};

use super::filter::{Filters, shown};
use super::template::markup;
use super::{HtmlError, Page, definitions, embedded, pair};
use crate::bundle::{Manifest, cell_numbers};
use crate::layout::{self, MetricCell, MetricColumn, MetricRow, MetricRows, MetricTable, heading, row_key};
use mirrorstats_analysis::statistics::Statistics;
use mirrorstats_analysis::statistics::text::Length;
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::number::Decimal;
use mirrorstats_exact::ratio::Ratio;
use mirrorstats_figures::{Figure, FigureName, font_style_sheet};
use mirrorstats_metric::catalogs::catalog::{Better, Kind};
use mirrorstats_score::cells::group::group;
use mirrorstats_score::cells::{Cell, Cells};
use mirrorstats_score::tables::table::{EpisodeTable, KeyRef};
use mirrorstats_statistics::intervals::interval::Interval;
use mirrorstats_tables::{Column, DAGGER, Emphasis, ListTable};

pub(super) fn content(page: &Page<'_>) -> Result<Value, HtmlError> {
    // A cell whose episodes were all lost has no row in the table.
    let mut occupied = page.cells.clone();
    occupied.groups.retain(|group| group.episodes > 0);
    if group(page.episodes, &page.cells.by)? != occupied {
        return Err(HtmlError::OtherEpisodes);
    }
    let undefined = page.tables.first().map_or("", |table| table.undefined.as_str());
    let catalog = &page.cells.catalog;
    let filters = Filters::of(page.tables, page.cells, undefined);
    let metrics = definitions::metrics(catalog);
    let data = embedded::json(page, &metrics, undefined)?;
    let tables = page.tables.iter().map(|of| table(of, page.cells, &filters)).collect::<Result<Vec<_>, _>>()?;
    Ok(context! {
        font => markup(&font_style_sheet()),
        subject => visible(&catalog.subject()),
        counts => Serde(counts(page.episodes)),
        filters => Serde(filters.filters),
        tables => Serde(tables),
        figures => page.figures.iter().map(figure).collect::<Vec<_>>(),
        pair => Serde(pair::heading(page.statistics)),
        statistics => Serde(page.statistics.map(statistics)),
        lists => Serde(page.lists.iter().map(list).collect::<Vec<_>>()),
        metrics => Serde(metrics),
        lets => Serde(definitions::lets(catalog)),
        experiments => Serde(definitions::experiments(catalog)),
        provenance => Serde(provenance(page.manifest)),
        data => markup(&data),
    })
}

fn counts(episodes: &EpisodeTable) -> Json {
    let distinct = |of: fn(KeyRef<'_>) -> &str| episodes.keys.iter().map(of).collect::<BTreeSet<_>>().len();
    let (models, experiments) = (distinct(|key| key.model), distinct(|key| key.experiment));
    json!({ "episodes": episodes.len(), "models": models, "experiments": experiments })
}

fn table(table: &MetricTable, cells: &Cells, filters: &Filters) -> Result<Json, HtmlError> {
    let group_keys: Vec<&str> = others(&table.keys, row_key(&table.keys)).map(String::as_str).collect();
    let rows = |group: &MetricRows| row_group(group, table, cells, filters);
    Ok(json!({
        "name": table.name,
        "title": visible(&table.title),
        "sentences": table.sentences().map(visible).collect::<Vec<_>>(),
        "row_heading": visible(&table.row_heading),
        // The heading of the groups, empty if there is only one: `Experiment`.
        "group_heading": heading(&visible(&group_keys.join(", "))),
        "columns": table.columns.iter().map(column).collect::<Vec<_>>(),
        "groups": table.groups.iter().map(rows).collect::<Result<Vec<_>, _>>()?,
    }))
}

fn column(column: &MetricColumn) -> Json {
    // The initial sort direction.
    let Column { heading, better, .. } = &column.printed;
    let best_first = match better {
        Better::Higher | Better::Neither => "descending",
        Better::Lower => "ascending",
    };
    json!({ "metric": visible(&column.metric), "heading": visible(heading), "arrow": better.arrow(), "best_first": best_first })
}

fn row_group(group: &MetricRows, table: &MetricTable, cells: &Cells, filters: &Filters) -> Result<Json, HtmlError> {
    let first = group.rows.first().map_or(&[][..], |row| &row.key);
    // The keys in the heading: `E1`.
    let short = others(first, row_key(&table.keys)).map(|value| shown(value, &table.undefined));
    let short = short.collect::<Vec<_>>().join(", ");
    let rows = group.rows.iter().map(|of| row(of, table, cells, filters)).collect::<Result<Vec<_>, _>>()?;
    Ok(json!({ "heading": group.heading.as_deref().map(visible), "short": short, "rows": rows }))
}

fn row(row: &MetricRow, table: &MetricTable, cells: &Cells, filters: &Filters) -> Result<Json, HtmlError> {
    let stray = || HtmlError::StrayRow { table: table.name.clone(), row: row.name.clone() };
    let at = cells.groups.binary_search_by(|group| group.key.cmp(&row.key)).map_err(|_| stray())?;
    let group = &cells.groups[at];
    let key = |name: &str| cells.by.iter().position(|key| key == name).map(|at| row.key[at].to_string());
    let experiment = key("experiment");
    let views = row.cells.iter().zip(&table.columns).map(|(own, column)| {
        let of = cells.of_metric(group, &column.metric)?;
        let level = experiment.as_deref().and_then(|experiment| cells.catalog.chance(experiment, &column.metric));
        Some(cell(own, of, &table.undefined, level))
    });
    Ok(json!({
        "name": visible(&row.name),
        // The index of its group of episodes, and the indices of its keys in the values of the filters.
        "group": at,
        "places": filters.places(&row.key),
        "episodes": group.episodes,
        "model": key("model").as_deref().map(visible),
        "experiment": experiment.as_deref().map(visible),
        "cells": views.collect::<Option<Vec<_>>>().ok_or_else(stray)?,
    }))
}

/// One table cell. The attributes have the text of `cells.csv`, empty for undefined; a missing value that a style
/// prints as zero keeps its empty attributes.
fn cell(cell: &MetricCell, of: Cell, undefined: &str, chance: Option<Ratio>) -> Json {
    let (estimate, detail) = cell.value.parts(&visible(undefined));
    let [_, sum, sum_sq, mean, se, ci_low, ci_high] = cell_numbers(&of);
    json!({
        "metric": visible(of.name),
        "estimate": estimate,
        // The uncertainty; empty without one.
        "detail": detail.unwrap_or_default(),
        // True if it shows a missing value; a zero that a style prints instead does not count.
        "is_undefined": cell.value == layout::Value::Undefined,
        // True if emphasis covers the detail too.
        "is_whole": matches!(cell.value, layout::Value::MeanSe { .. }),
        "element": element(cell.emphasis),
        "mark": if cell.is_marked { DAGGER.to_string() } else { String::new() },
        "n": of.moments.n,
        "sum": sum,
        "sum_sq": sum_sq,
        "mean": mean,
        "se": se,
        "ci_low": ci_low,
        "ci_high": ci_high,
        "chance": chance.map(|level| level.to_string()).unwrap_or_default(),
        "strip": strip(&of),
    })
}

fn element(emphasis: Emphasis) -> &'static str {
    match emphasis {
        Emphasis::Plain => "span",
        Emphasis::Bold => "strong",
        Emphasis::Underline => "u",
    }
}

fn strip(of: &Cell) -> Option<Json> {
    let place = |share: f64| Decimal::of_float(share, 3).map(Decimal::compact);
    let Interval { low, high } = of.interval.filter(|_| of.metric.kind == Kind::Rate)?;
    Some(json!({ "low": place(low)?, "width": place(high - low)?, "mean": place(of.moments.mean()?)? }))
}

fn figure((name, figure): &(FigureName, Figure)) -> Value {
    let [title, caption] = [figure.title(), figure.caption()].map(visible);
    context! { name => name.name(), title, caption, svg => markup(&figure.inline_svg()) }
}

fn statistics(statistics: &Statistics) -> Json {
    let all = |sentences: &[String]| sentences.iter().map(|sentence| visible(sentence)).collect::<Vec<_>>();
    json!({
        "conclusions": all(&statistics.conclusions),
        "warnings": all(&statistics.warnings),
        "text": statistics.render(&statistics.headline, Length::Full, None),
    })
}

fn list(ListTable { name, printed, .. }: &ListTable) -> Json {
    json!({
        "name": name,
        "title": printed.title,
        "notes": printed.sentences.iter().map(|text| visible(text)).collect::<Vec<_>>(),
        "header": printed.columns.iter().map(|column| visible(&column.heading)).collect::<Vec<_>>(),
        "rows": printed.rows().map(|row| row.iter().map(|cell| visible(&cell.text)).collect()).collect::<Vec<Json>>(),
    })
}

fn provenance(manifest: &Manifest) -> Json {
    let names = |names: &[String]| names.iter().map(|name| visible(name)).collect::<Vec<_>>().join(", ");
    let source = |name: &str, hash: &str| {
        let short: String = hash.chars().take(12).collect();
        json!({ "name": visible(name), "sha256": hash, "short": short })
    };
    let inputs = manifest
        .inputs
        .iter()
        .map(|input| json!({ "path": visible(&input.path), "bytes": input.bytes, "sha256": input.sha256 }));
    json!({
        "version": manifest.version,
        "schema_version": manifest.schema_version,
        "definitions": source(&manifest.definitions.name, &manifest.definitions.hash),
        "style": source(&manifest.style.name, &manifest.style.sha256),
        "filter": manifest.filter.as_deref().map(visible),
        "by": names(&manifest.by),
        "metrics": names(&manifest.metrics),
        "inputs": inputs.collect::<Vec<_>>(),
        // Without its outputs, since they include the hash of the page.
        "manifest": manifest.json().lines().map(visible).collect::<Vec<_>>().join("\n"),
    })
}

fn others<T>(items: &[T], place: usize) -> impl Iterator<Item = &T> {
    items.iter().enumerate().filter(move |(at, _)| *at != place).map(|(_, item)| item)
}

//! The list of episodes, page by page.

use std::cmp::Ordering;

use serde_json::{Value, json};

use super::labels;
use crate::filter::{COLUMNS, Filter, Query, condition_of, number, value};
use crate::{Snapshot, ViewError};
use mirrorstats_exact::escape::visible;
use mirrorstats_metric::catalogs::catalog::{Better, Kind};
use mirrorstats_score::tables::select::is_of_coders;
use mirrorstats_score::tables::table::{EpisodeTable, MetricColumn};

/// The maximum number of episodes in an answer.
const MOST: usize = 500;

/// Some episodes of the list, by `offset`, `limit`, `sort` and `order`.
pub(crate) fn answer(snapshot: &Snapshot, query: &Query) -> Result<Value, ViewError> {
    let Some(scored) = &snapshot.scored else { return Ok(none(snapshot)) };
    let table = &scored.results.episodes;
    let rows = sorted(snapshot, query)?;
    let offset = number(query, "offset")?.unwrap_or_default().min(rows.len());
    let limit = number(query, "limit")?.unwrap_or(100).min(MOST);
    let said = Filter::of(query).words().map(|words| snapshot.said(words)).transpose()?;
    let with_words = |table: &EpisodeTable, row: usize| {
        let mut entry = entry(table, row);
        if let Some(found) = said.as_ref().and_then(|said| said.get(table.keys.get(row).episode_id)) {
            let (t, column, excerpt) = (found.t, visible(&found.column), visible(&found.excerpt));
            entry["said"] = json!({"t": t, "column": column, "excerpt": excerpt, "steps": found.steps});
        }
        entry
    };
    let page: Vec<usize> = rows[offset..].iter().take(limit).copied().collect();
    Ok(json!({
        "total": rows.len(),
        "all": table.len(),
        "offset": offset,
        "generation": snapshot.generation,
        "metrics": table.metrics.iter().map(|metric| visible(&metric.name)).collect::<Vec<_>>(),
        "passes": passes(table),
        "has_conditions": table.has_conditions(),
        "has_labels": table.labels.iter().any(is_of_coders),
        "rows": page.iter().map(|row| with_words(table, *row)).collect::<Vec<_>>(),
    }))
}

/// The list until an episode is finished.
fn none(snapshot: &Snapshot) -> Value {
    json!({"total": 0, "all": 0, "offset": 0, "generation": snapshot.generation, "metrics": [], "passes": [], "rows": []})
}

/// The value of each rate that its definition calls better; null for quantities and for rates without a direction.
fn passes(table: &EpisodeTable) -> Vec<Option<&'static str>> {
    let pass = |metric: &MetricColumn| {
        let defined = table.catalog.metric.get(&metric.name).filter(|metric| metric.kind == Kind::Rate)?;
        match defined.better {
            Better::Higher => Some("1"),
            Better::Lower => Some("0"),
            Better::Neither => None,
        }
    };
    table.metrics.iter().map(pass).collect()
}

/// The whole list, for a copy. Rows whose names are shown escaped also have `keys`, the raw values for filters.
pub(crate) fn everything(snapshot: &Snapshot) -> Result<Value, ViewError> {
    let table = &snapshot.table()?.results.episodes;
    Ok(json!({
        "metrics": table.metrics.iter().map(|metric| visible(&metric.name)).collect::<Vec<_>>(),
        "passes": passes(table),
        "labels": table.labels.iter().map(|label| &label.name).collect::<Vec<_>>(),
        "has_conditions": table.has_conditions(),
        "has_labels": table.labels.iter().any(is_of_coders),
        "rows": (0..table.len()).map(|row| with_keys(table, row)).collect::<Vec<_>>(),
    }))
}

fn with_keys(table: &EpisodeTable, row: usize) -> Value {
    let mut entry = entry(table, row);
    let (key, condition) = (table.keys.get(row), condition_of(table, row));
    let keys = json!({"experiment": key.experiment, "model": key.model, "condition": condition});
    if COLUMNS.iter().any(|column| entry[column] != keys[column]) {
        entry["keys"] = keys;
    }
    let labels = table.labels.iter().map(|label| (label.name.clone(), json!(label.values.get(row))));
    entry["labels"] = labels.collect::<serde_json::Map<_, _>>().into();
    entry
}

pub(crate) fn neighbours(snapshot: &Snapshot, query: &Query, id: &str) -> Result<Value, ViewError> {
    let Some(scored) = &snapshot.scored else { return Ok(json!({})) };
    let rows = sorted(snapshot, query)?;
    let keys = &scored.results.episodes.keys;
    let at = rows.iter().position(|row| keys.get(*row).episode_id == id);
    let id_at = |at: Option<usize>| at.and_then(|at| rows.get(at)).map(|row| keys.get(*row).episode_id);
    Ok(json!({
        "previous": id_at(at.and_then(|at| at.checked_sub(1))),
        "next": id_at(at.map(|at| at + 1)),
        "place": at.map(|at| at + 1),
        "total": rows.len(),
    }))
}

/// The other episodes of an episode's scene. Without declared scenes, those of its experiment, seed and run.
pub(crate) fn siblings(snapshot: &Snapshot, id: &str) -> Vec<Value> {
    let Some(scored) = &snapshot.scored else { return Vec::new() };
    let table = &scored.results.episodes;
    let Some(at) = scored.rows.get(id).copied() else { return Vec::new() };
    let (own, scene) = (table.keys.get(at), scene_of(table, at));
    let is_sibling = |row: &usize| {
        let key = table.keys.get(*row);
        let is_beside = scene.map_or((key.seed, key.run) == (own.seed, own.run), |_| scene_of(table, *row) == scene);
        is_beside && key.experiment == own.experiment && key.episode_id != id
    };
    let named = |row: usize| {
        let key = table.keys.get(row);
        json!({"id": key.episode_id, "name": visible(key.episode_id), "model": visible(key.model), "condition": visible(condition_of(table, row))})
    };
    (0..table.len()).filter(is_sibling).take(MOST).map(named).collect()
}

fn scene_of(table: &EpisodeTable, row: usize) -> Option<&str> {
    table.label("scene").and_then(|label| label.get(row))
}

/// The filtered rows in the requested order; undefined values come last in both directions.
fn sorted(snapshot: &Snapshot, query: &Query) -> Result<Vec<usize>, ViewError> {
    let table = &snapshot.table()?.results.episodes;
    let mut rows = Filter::of(query).rows(snapshot)?;
    let down = value(query, "order") == Some("descending");
    let turned = |ordering: Ordering| if down { ordering.reverse() } else { ordering };
    let Some(name) = value(query, "sort") else { return Ok(rows) };
    if let Some(metric) = table.metric(name) {
        rows.sort_by(|a, b| {
            let (a, b) = (metric.get(*a), metric.get(*b));
            a.is_none().cmp(&b.is_none()).then(turned(a.cmp(&b)))
        });
        return Ok(rows);
    }
    let keys = |row: &usize| table.keys.get(*row);
    match name {
        "id" => rows.sort_by(|a, b| turned(keys(a).episode_id.cmp(keys(b).episode_id))),
        "model" => rows.sort_by(|a, b| turned(keys(a).model.cmp(keys(b).model))),
        "experiment" => rows.sort_by(|a, b| turned(keys(a).experiment.cmp(keys(b).experiment))),
        "condition" => rows.sort_by(|a, b| turned(condition_of(table, *a).cmp(condition_of(table, *b)))),
        "seed" => rows.sort_by(|a, b| turned((keys(a).seed, keys(a).run).cmp(&(keys(b).seed, keys(b).run)))),
        other => return Err(ViewError::Request(format!("cannot sort by `{}`", visible(other)))),
    }
    Ok(rows)
}

fn entry(table: &EpisodeTable, row: usize) -> Value {
    let key = table.keys.get(row);
    let value = |metric: &MetricColumn| table.decimal(metric, row).map(|value| value.to_string());
    json!({
        "id": key.episode_id,
        "name": visible(key.episode_id),
        "model": visible(key.model),
        "experiment": visible(key.experiment),
        "condition": visible(condition_of(table, row)),
        "seed": key.seed,
        "run": key.run,
        "values": table.metrics.iter().map(value).collect::<Vec<_>>(),
        "put": labels::of_row(table, row),
    })
}

//! The report, live: what the page begins with, and the sections of the report.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use serde_json::{Value, json};

use super::error::ViewError;
use super::filter::{COLUMNS, Filter, Query, condition_of};
use super::snapshot::{Scored, Snapshot};
use exact::escape::visible;
use report::html;
use score::table::EpisodeTable;
use study::{Outputs, Overview, Part, Question};
use trace::palette::Color;

pub(super) fn study(snapshot: &Snapshot) -> Value {
    let Some(scored) = &snapshot.scored else {
        return json!({"generation": snapshot.generation, "episodes": 0, "choices": [], "metrics": []});
    };
    let table = &scored.results.episodes;
    json!({
        "generation": snapshot.generation,
        "episodes": table.len(),
        "definitions": {"name": visible(&table.catalog.name), "hash": table.catalog.hash},
        "against": snapshot.options.against.as_deref().map(named),
        "where": snapshot.options.question.filter,
        "choices": COLUMNS.iter().filter_map(|column| choice(table, column)).collect::<Vec<_>>(),
        "metrics": html::metrics(&table.catalog),
        "paint": Color::ALL.map(|color| json!({"name": color.name(), "rgb": color.rgb()})),
        "version": env!("CARGO_PKG_VERSION"),
    })
}

fn named(definitions: &Path) -> String {
    visible(&definitions.file_stem().unwrap_or(definitions.as_os_str()).to_string_lossy())
}

fn choice(table: &EpisodeTable, column: &str) -> Option<Value> {
    let value = |row: usize| match column {
        "experiment" => table.keys.get(row).experiment,
        "model" => table.keys.get(row).model,
        _ => condition_of(table, row),
    };
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    (0..table.len()).for_each(|row| *counts.entry(value(row)).or_default() += 1);
    let title = |name: &str| table.catalog.experiment.get(name).map(|experiment| visible(&experiment.title));
    let values = counts
        .iter()
        .map(|(name, count)| json!({"value": name, "name": visible(name), "title": title(name), "episodes": count}));
    (counts.len() > 1).then(|| json!({"column": column, "values": values.collect::<Vec<_>>()}))
}

/// Sections of the report of the episodes that are wanted.
pub(super) fn sections(snapshot: &Snapshot, query: &Query, part: Part) -> Result<Value, ViewError> {
    let scored = snapshot.table()?;
    let filter = Filter::of(query);
    let made = match part {
        Part::Tables => {
            let results = filter.results(snapshot)?;
            if results.episodes.is_empty() {
                return Ok(empty(snapshot));
            }
            scored.study.overview(results, &snapshot.options.style, part)?
        }
        // Figures ask for timelines, which only a scan gives.
        Part::Figures | Part::Statistics => scanned(snapshot, scored, &filter, part)?,
    };
    Ok(json!({
        "generation": snapshot.generation,
        "episodes": made.episodes,
        "by": made.by,
        "groups": made.groups,
        "sections": made.sections,
    }))
}

fn scanned(snapshot: &Snapshot, scored: &Scored, filter: &Filter, part: Part) -> Result<Overview, ViewError> {
    let options = &snapshot.options;
    let condition = filter.as_condition(options.question.filter.as_deref());
    let question = Question { filter: condition, ..options.question.clone() };
    let study = Scored::study(options, scored.inputs.clone(), question)?;
    let figures = if part == Part::Figures { report::figures::FigureName::ALL.as_slice() } else { &[] };
    let outputs = Outputs { losses: true, ..Outputs::of_figures(figures) };
    Ok(study.overview(study.scan(outputs)?, &options.style, part)?)
}

fn empty(snapshot: &Snapshot) -> Value {
    let none: BTreeSet<String> = BTreeSet::new();
    json!({"generation": snapshot.generation, "episodes": 0, "by": none, "groups": none, "sections": none})
}

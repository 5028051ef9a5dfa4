//! The report, live: the start of the page, and the sections of the report.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use serde_json::{Value, json};

use crate::filter::{COLUMNS, Filter, PARTICIPANT, Query, STATUS, values_of};
use crate::snapshot::Scored;
use crate::{Snapshot, ViewError};
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::format::fixed;
use mirrorstats_report::html;
use mirrorstats_score::tables::select::is_of_coders;
use mirrorstats_score::tables::table::{EpisodeTable, MetricColumn};
use mirrorstats_study::overview::{Overview, Part, overview};
use mirrorstats_study::question::Question;
use mirrorstats_study::results::{ModelMean, Outputs, model_means};
use mirrorstats_trace::schema::colors::Color;

pub(crate) fn study(snapshot: &Snapshot) -> Value {
    let Some(scored) = &snapshot.scored else {
        return json!({"generation": snapshot.generation, "episodes": 0, "choices": [], "metrics": []});
    };
    let table = &scored.results.episodes;
    json!({
        "generation": snapshot.generation,
        "episodes": table.len(),
        "definitions": {"name": visible(&table.catalog.name), "hash": table.catalog.hash},
        "subject": visible(&table.catalog.subject()),
        "against": snapshot.options.against.as_deref().map(named),
        "where": snapshot.options.question.filter,
        "choices": choices(scored),
        "metrics": html::metrics(&table.catalog),
        "paint": Color::ALL.map(|color| json!({"name": color.name(), "rgb": color.rgb()})),
        "coder": snapshot.options.coder.as_deref().map(visible),
        "version": env!("CARGO_PKG_VERSION"),
    })
}

fn named(definitions: &Path) -> String {
    visible(&definitions.file_stem().unwrap_or(definitions.as_os_str()).to_string_lossy())
}

/// The columns to filter by, and their values.
fn choices(scored: &Scored) -> Vec<Value> {
    let table = &scored.results.episodes;
    let metrics = table.metrics.iter().map(|metric| metric.name.as_str());
    let of_coders = table.labels.iter().filter(|label| is_of_coders(label)).map(|label| label.name.as_str());
    let columns = COLUMNS.into_iter().chain(["seed", PARTICIPANT]).chain(of_coders).chain(metrics);
    columns.filter_map(|column| choice(table, column)).chain(statuses(scored)).collect()
}

/// The maximum number of values of a metric or a seed to choose from.
const MOST_VALUES: usize = 200;

fn choice(table: &EpisodeTable, column: &str) -> Option<Value> {
    let value = values_of(table, column).ok()?;
    let is_metric = table.metric(column).is_some();
    let mut counts: BTreeMap<Option<String>, usize> = BTreeMap::new();
    for row in 0..table.len() {
        *counts.entry(value(row)).or_default() += 1;
        // Durations are filtered by conditions.
        if is_metric && counts.keys().flatten().any(|value| value != "0" && value != "1") {
            return None;
        }
    }
    let title = |name: &str| table.catalog.experiment.get(name).map(|experiment| visible(&experiment.title));
    let values = counts.iter().map(|(name, count)| {
        let value = name.as_deref().unwrap_or_default();
        let shown = name.as_deref().map_or_else(|| "undefined".to_owned(), visible);
        json!({"value": value, "name": shown, "title": title(value), "episodes": count})
    });
    let is_wanted = counts.len() > 1 && (COLUMNS.contains(&column) || counts.len() <= MOST_VALUES);
    is_wanted.then(|| json!({"column": column, "is_metric": is_metric, "values": values.collect::<Vec<_>>()}))
}

/// The outcomes of replies, unless all are `ok`.
fn statuses(scored: &Scored) -> Option<Value> {
    let quality = scored.results.quality.as_ref()?.whole();
    let entry =
        |(status, replies): (&String, &u64)| json!({"value": status, "name": visible(status), "replies": replies});
    let values: Vec<Value> = quality.unread().map(entry).collect();
    (!values.is_empty()).then(|| json!({"column": STATUS, "is_metric": false, "values": values}))
}

/// The models ordered by the first metric that is a rate, as the mean over experiments with equal weights. Null without
/// such a metric, or with fewer than two models or experiments.
fn ranking(episodes: &EpisodeTable) -> Value {
    let is_rate = |metric: &&MetricColumn| metric.iter().flatten().all(|value| value == 0 || value == 1);
    let Some(metric) = episodes.metrics.iter().find(is_rate) else { return Value::Null };
    let models = model_means(episodes, metric);
    let experiments: BTreeSet<&str> = models.iter().flat_map(|of| of.experiments.keys().copied()).collect();
    if models.len() < 2 || experiments.len() < 2 {
        return Value::Null;
    }
    let entry = |ModelMean { model, mean, experiments: of }: &ModelMean<'_>| {
        let cell = |experiment: &&str| of.get(experiment).map(|mean| fixed(Some(*mean), 2));
        json!({
            "model": model, "name": visible(model), "mean": fixed(Some(*mean), 3),
            "values": experiments.iter().map(cell).collect::<Vec<_>>(),
        })
    };
    json!({
        "metric": visible(&metric.name),
        "experiments": experiments.iter().map(|name| visible(name)).collect::<Vec<_>>(),
        "rows": models.iter().map(entry).collect::<Vec<_>>(),
    })
}

pub(crate) fn sections(snapshot: &Snapshot, query: &Query, part: Part) -> Result<Value, ViewError> {
    let Some(scored) = &snapshot.scored else { return Ok(empty(snapshot)) };
    let filter = Filter::of(query);
    let mut order = Value::Null;
    let made = match part {
        Part::Tables => {
            let results = filter.results(snapshot)?;
            if results.episodes.is_empty() {
                return Ok(empty(snapshot));
            }
            order = ranking(&results.episodes);
            overview(&scored.study, results, &snapshot.options.style, part)?
        }
        // Figures need timelines, which require a scan.
        Part::Figures | Part::Statistics => scanned(snapshot, scored, &filter, part)?,
    };
    Ok(json!({
        "generation": snapshot.generation,
        "episodes": made.episodes,
        "by": made.by,
        "groups": made.groups,
        "sections": made.sections,
        "ranking": order,
    }))
}

fn scanned(snapshot: &Snapshot, scored: &Scored, filter: &Filter, part: Part) -> Result<Overview, ViewError> {
    let options = &snapshot.options;
    let condition = filter.as_condition(snapshot, options.question.filter.as_deref())?;
    let question = Question { filter: condition, ..options.question.clone() };
    let study = Scored::study(options, scored.inputs.clone(), question)?;
    let figures = if part == Part::Figures { mirrorstats_figures::FigureName::ALL.as_slice() } else { &[] };
    let outputs = Outputs { copy_candidates: true, ..Outputs::of_figures(figures) };
    Ok(overview(&study, study.scan(outputs)?, &options.style, part)?)
}

fn empty(snapshot: &Snapshot) -> Value {
    let none: BTreeSet<String> = BTreeSet::new();
    json!({"generation": snapshot.generation, "episodes": 0, "by": none, "groups": none, "sections": none})
}

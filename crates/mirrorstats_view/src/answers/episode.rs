//! One episode: its rows, their content, and the timesteps that decided each metric.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Map, Value, json};

use super::{labels, list, verdict};
use crate::filter::{Query, number, required};
use crate::logs::Opened;
use crate::snapshot::Scored;
use crate::{Snapshot, ViewError};
use mirrorstats_exact::escape::visible;
use mirrorstats_log::frames::Moment;
use mirrorstats_score::evidence::{Evidence, MetricEvidence, ranges};
use mirrorstats_study::Study;
use mirrorstats_study::explain::{explain_each_in, explain_in};
use mirrorstats_study::question::Question;
use mirrorstats_trace::episodes::episode::Episode;
use mirrorstats_trace::episodes::moments::moments;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::episode_rows::Displayed;
use mirrorstats_trace::schema::domain::is_identity;
use mirrorstats_trace::schema::{COLUMNS, Column, Kind, Stored, Value as Cell};

/// The maximum number of characters of a text in an answer; the page requests the whole text separately.
pub(crate) const LONGEST: usize = 4_000;

pub(crate) fn answer(snapshot: &Snapshot, query: &Query) -> Result<Value, ViewError> {
    let id = required(query, "id")?;
    let opened = snapshot.episode(id)?;
    let mut entry = about(snapshot, &opened, LONGEST)?;
    entry["siblings"] = list::siblings(snapshot, id).into();
    entry["neighbours"] = list::neighbours(snapshot, query, id)?;
    Ok(entry)
}

/// An episode without its position in a list, its texts cut to `longest` characters. An unreadable log hides nothing
/// else.
pub(crate) fn about(snapshot: &Snapshot, opened: &Opened, longest: usize) -> Result<Value, ViewError> {
    let (first, fault) = match snapshot.logs.moment(opened, 1) {
        Ok(first) => (first, None),
        Err(error) => (None, Some(ViewError::from(error).words())),
    };
    let mut entry = described(snapshot, opened, longest, first.as_ref(), scores(snapshot, opened)?);
    if let Some(fault) = fault {
        entry["log_fault"] = fault.into();
    } else if entry["frames"] == false && snapshot.renders(opened) {
        entry["frames"] = true.into();
        entry["rendered"] = true.into();
    }
    Ok(entry)
}

/// An episode without its position in a list; `first` is the log's record of its first step.
pub(crate) fn described(
    snapshot: &Snapshot,
    opened: &Opened,
    longest: usize,
    first: Option<&Moment>,
    (metrics, against): (Value, Value),
) -> Value {
    let episode = &opened.episode;
    let marks = moments(episode).into_iter().map(|(t, moment)| json!({"t": t, "title": moment.title()}));
    json!({
        "id": episode.episode_id,
        "name": visible(&episode.episode_id),
        "length": episode.steps.len(),
        "running": opened.running.is_some(),
        "frames": first.is_some_and(|moment| moment.frame.is_some()),
        "log": first.is_some(),
        "labels": labels::of_episode(snapshot, &episode.episode_id),
        "lost": is_lost(snapshot, &episode.episode_id),
        "constants": constants(opened, longest),
        "view": snapshot.recording(opened).map(|mut recording| recording["view"].take()),
        "own": opened.own.is_some(),
        "steps": steps(opened, longest),
        "verdict": verdict::answer(opened),
        "marks": marks.collect::<Vec<_>>(),
        "metrics": metrics,
        "against": against,
        "generation": snapshot.generation,
    })
}

pub(crate) fn text(snapshot: &Snapshot, query: &Query) -> Result<Value, ViewError> {
    let opened = snapshot.episode(required(query, "id")?)?;
    let (name, t) = (required(query, "column")?, number(query, "t")?.unwrap_or_default());
    if let Some(own) = opened.own.iter().flatten().find(|own| own.name == name) {
        let value = t.checked_sub(1).and_then(|at| own.values().nth(at)).flatten();
        return Ok(json!({"text": if let Some(Displayed::Text(text)) = value { Some(lines(&text)) } else { None }}));
    }
    let column = COLUMNS.iter().find(|column| column.name == name && !column.constant);
    let at = t.checked_sub(1).filter(|at| *at < opened.episode.steps.len());
    let (Some(column), Some(at)) = (column, at) else {
        return Err(ViewError::Absent(format!(
            "`{}` has no text `{}` at t = {t}",
            visible(&opened.episode.episode_id),
            visible(name)
        )));
    };
    match column.of_steps(&opened.episode).nth(at).flatten() {
        Some(Cell::Text(text)) => Ok(json!({"text": lines(text)})),
        _ => Ok(json!({"text": null})),
    }
}

fn is_lost(snapshot: &Snapshot, id: &str) -> bool {
    snapshot.scored.as_ref().is_some_and(|scored| scored.results.lost.as_ref().is_some_and(|lost| lost.contains(id)))
}

fn constants(opened: &Opened, longest: usize) -> Vec<Value> {
    let episode = &opened.episode;
    let is_known = |column: &Column| opened.own.is_none() || is_identity(column.name);
    let with_step = |column: &&Column| column.constant && column.name != "episode_hash" && is_known(column);
    let columns = COLUMNS.iter().filter(with_step);
    columns
        .filter_map(|column| {
            let value = column.of_steps(episode).next().flatten().or_else(|| head(episode, column))?;
            Some(json!({"name": column.name, "doc": column.doc, "value": shown(value, column.stored, longest)}))
        })
        .collect()
}

fn head<'e>(episode: &'e Episode, column: &Column) -> Option<Cell<'e>> {
    episode.steps.is_empty().then(|| match column.name {
        "episode_id" => Some(Cell::Text(&episode.episode_id)),
        "model" => Some(Cell::Text(&episode.model)),
        "experiment" => Some(Cell::Text(&episode.experiment)),
        _ => None,
    })?
}

fn steps(opened: &Opened, longest: usize) -> Value {
    let (episode, mut all) = (&opened.episode, Map::new());
    if let Some(own) = &opened.own {
        for column in own {
            let values: Vec<Option<Value>> = column.values().map(|value| Some(displayed(value?, longest))).collect();
            let entry = json!({"doc": "", "unit": null, "is_number": column.is_numeric(), "values": values});
            all.insert(column.name.clone(), entry);
        }
        return Value::Object(all);
    }
    for column in COLUMNS.iter().filter(|column| !column.constant && column.name != "frame_time") {
        let values: Vec<Option<Cell<'_>>> = column.of_steps(episode).collect();
        if values.iter().all(Option::is_none) {
            continue;
        }
        let is_number = matches!(column.stored.kind(), Kind::Int | Kind::Float);
        let values: Vec<Option<Value>> =
            values.into_iter().map(|value| Some(shown(value?, column.stored, longest))).collect();
        let entry = json!({"doc": column.doc, "unit": column.unit, "is_number": is_number, "values": values});
        all.insert(column.name.to_owned(), entry);
    }
    Value::Object(all)
}

/// A value for the page: numbers are text, since a browser would round them.
fn shown(value: Cell<'_>, stored: Stored, longest: usize) -> Value {
    match value {
        Cell::Bool(value) => json!(value),
        Cell::Int(value) => json!(value.to_string()),
        Cell::Float(value) => json!(shortest(value, stored)),
        Cell::Text(text) => cut(text, longest),
    }
}

fn displayed(value: Displayed, longest: usize) -> Value {
    match value {
        Displayed::Bool(value) => json!(value),
        Displayed::Text(text) => cut(&text, longest),
    }
}

/// The fewest digits that distinguish a float from its neighbours of the same width.
#[expect(clippy::cast_possible_truncation, reason = "the value was stored as a float of 32 bits")]
fn shortest(value: f64, stored: Stored) -> String {
    let text = if stored == Stored::Float32 { format!("{:?}", value as f32) } else { format!("{value:?}") };
    text.strip_suffix(".0").map(str::to_owned).unwrap_or(text)
}

fn cut(text: &str, longest: usize) -> Value {
    match text.char_indices().nth(longest) {
        None => json!(lines(text)),
        Some((end, _)) => json!({"text": lines(&text[..end]), "characters": text.chars().count()}),
    }
}

fn lines(text: &str) -> String {
    text.replace('\t', "    ").lines().map(visible).collect::<Vec<_>>().join("\n")
}

/// Every metric with its value and deciding steps, under the definitions and under those they are compared with.
pub(crate) fn scores(snapshot: &Snapshot, opened: &Opened) -> Result<(Value, Value), ViewError> {
    let (Some(scored), Some(input)) = (&snapshot.scored, &opened.input) else { return Ok((json!([]), Value::Null)) };
    let id = &opened.episode.episode_id;
    let own = entry(&explain_in(&scored.study, input, id)?);
    let Some(study) = other_study(snapshot, input)? else { return Ok((own, Value::Null)) };
    Ok((own, entry(&explain_in(&study, input, id)?)))
}

/// The same for some episodes of a trace, by id.
pub(crate) fn scores_of(
    snapshot: &Snapshot,
    input: &Input,
    ids: &BTreeSet<String>,
) -> Result<BTreeMap<String, (Value, Value)>, ViewError> {
    let own = explain_each_in(&snapshot.table()?.study, input, ids)?;
    let other = match other_study(snapshot, input)? {
        Some(study) => explain_each_in(&study, input, ids)?,
        None => BTreeMap::new(),
    };
    let against = |id: &String| other.get(id).map_or(Value::Null, entry);
    Ok(own.iter().map(|(id, evidence)| (id.clone(), (entry(evidence), against(id)))).collect())
}

/// The trace under the other definitions, if any.
fn other_study(snapshot: &Snapshot, input: &Input) -> Result<Option<Study>, ViewError> {
    let options = &snapshot.options;
    let Some(against) = &options.against else { return Ok(None) };
    let question = Question { definitions: Some(against.clone()), metrics: None, ..options.question.clone() };
    Scored::study(options, vec![input.clone()], question).map(Some)
}

fn entry(evidence: &Evidence) -> Value {
    let metric = |metric: &MetricEvidence| {
        let facts = metric.facts.iter().map(|fact| {
            json!({
                "name": fact.name.as_deref().map(visible),
                "expression": visible(&fact.expression),
                "value": fact.value.as_deref().map(visible),
                "timesteps": fact.timesteps,
                "at": ranges(&fact.timesteps),
                "is_of_episode": fact.is_of_episode,
            })
        });
        json!({
            "name": visible(&metric.metric),
            "value": metric.value.map(|value| value.to_string()),
            "timesteps": metric.timesteps,
            "at": ranges(&metric.timesteps),
            "facts": facts.collect::<Vec<_>>(),
        })
    };
    Value::Array(evidence.metrics.iter().map(metric).collect())
}

//! The filter of a page: chosen values of columns, a condition in the language of definitions, and search words.
//!
//! Rule: a condition on columns of the episode table is answered from memory; one on steps takes a scan.

use std::collections::HashSet;

use super::{Snapshot, ViewError};
use mirrorstats_exact::escape::visible;
use mirrorstats_score::tables::table::CONDITION;
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_study::results::Results;
use mirrorstats_trace::beside::labels;

/// The keys and values of a request, in order.
pub(super) type Query = [(String, String)];

pub(super) fn value<'q>(query: &'q Query, key: &str) -> Option<&'q str> {
    query.iter().find(|(name, _)| name == key).map(|(_, value)| value.as_str()).filter(|value| !value.is_empty())
}

pub(super) fn number(query: &Query, key: &str) -> Result<Option<usize>, ViewError> {
    let parse = |text: &str| text.parse().map_err(|_| ViewError::Request(format!("`{key}`: expected a whole number")));
    value(query, key).map(parse).transpose()
}

pub(super) fn required<'q>(query: &'q Query, key: &str) -> Result<&'q str, ViewError> {
    value(query, key).ok_or_else(|| ViewError::Request(format!("expected `{key}` in the request")))
}

/// Chosen values of a column; `None` for undefined.
type Chosen = (String, Vec<Option<String>>);

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Filter {
    chosen: Vec<Chosen>,
    pub condition: Option<String>,
    words: Option<String>,
}

/// The columns with their own key in a request.
pub(super) const COLUMNS: [&str; 3] = ["experiment", "model", CONDITION];

/// The key of all others: `seed=1`, `TSA=0`, `TSA=` for undefined.
const OTHERS: &str = "is";

/// The step column to filter by; an episode matches if any of its steps does.
pub(super) const STATUS: &str = "reply_status";

impl Filter {
    pub fn of(query: &Query) -> Self {
        let mut chosen: Vec<Chosen> = Vec::new();
        for (key, value) in query {
            let (column, value) = match (COLUMNS.contains(&key.as_str()), value.split_once('=')) {
                (true, _) => (key.as_str(), Some(value.clone())),
                (false, Some((column, value))) if key == OTHERS => {
                    (column, Some(value.to_owned()).filter(|value| !value.is_empty()))
                }
                _ => continue,
            };
            match chosen.iter_mut().find(|(known, _)| known == column) {
                Some((_, values)) => values.push(value),
                None => chosen.push((column.to_owned(), vec![value])),
            }
        }
        Self {
            chosen,
            condition: value(query, "where").map(str::to_owned),
            words: value(query, "search").map(str::to_lowercase),
        }
    }

    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    pub fn words(&self) -> Option<&str> {
        self.words.as_deref()
    }

    /// The matching rows of the table, in its order.
    pub fn rows(&self, snapshot: &Snapshot) -> Result<Vec<usize>, ViewError> {
        let scored = snapshot.table()?;
        let table = &scored.results.episodes;
        let statuses = self.chosen.iter().filter(|(column, _)| column == STATUS).map(sql_of);
        let kept = self.condition.clone().into_iter().chain(statuses).map(|condition| snapshot.kept(&condition));
        let kept: Vec<_> = kept.collect::<Result<_, _>>()?;
        let said = self.words.as_ref().map(|words| snapshot.said(words)).transpose()?;
        let chosen = self.chosen.iter().filter(|(column, _)| column != STATUS);
        let chosen: Vec<_> =
            chosen.map(|chosen| Ok((values_of(table, &chosen.0)?, &chosen.1))).collect::<Result<_, ViewError>>()?;
        let is_wanted = |row: &usize| {
            let key = table.keys.get(*row);
            let has = |text: &str, words: &String| text.to_lowercase().contains(words);
            let is_said = || said.as_ref().is_some_and(|said| said.contains_key(key.episode_id));
            chosen.iter().all(|(of_row, values)| values.contains(&of_row(*row)))
                && kept.iter().all(|kept| kept.contains(key.episode_id))
                && self
                    .words
                    .as_ref()
                    .is_none_or(|words| has(key.episode_id, words) || has(key.model, words) || is_said())
        };
        Ok((0..table.len()).filter(is_wanted).collect())
    }

    /// The results of the matching rows, from which tables are made.
    pub fn results(&self, snapshot: &Snapshot) -> Result<Results, ViewError> {
        let all = &snapshot.table()?.results;
        if self.is_empty() {
            return Ok(all.clone());
        }
        let rows = self.rows(snapshot)?;
        let episodes = all.episodes.taken(&rows);
        let cells: HashSet<(String, String)> =
            episodes.keys.iter().map(|key| (key.experiment.to_owned(), key.model.to_owned())).collect();
        let quality = all.quality.clone().map(|mut quality| {
            quality.0.retain(|key, _| cells.contains(&(key.experiment.clone(), key.model.clone())));
            quality
        });
        Ok(Results { episodes, quality, timelines: None, ..all.clone() })
    }

    /// The filter as a condition in the language of definitions, joined with another one.
    pub fn as_condition(&self, snapshot: &Snapshot, other: Option<&str>) -> Result<Option<String>, ViewError> {
        let chosen = self.chosen.iter().map(sql_of);
        let written = self.condition.iter().map(String::as_str).chain(other).map(|text| format!("({text})"));
        let mut all: Vec<String> = written.chain(chosen).collect();
        if self.words.is_some() {
            let keys = &snapshot.table()?.results.episodes.keys;
            let ids = self.rows(snapshot)?.into_iter().map(|row| quoted(keys.get(row).episode_id));
            all.push(format!("episode_id in ({})", ids.chain(["''".to_owned()]).collect::<Vec<_>>().join(", ")));
        }
        Ok((!all.is_empty()).then(|| all.join(" and ")))
    }
}

fn quoted(text: &str) -> String {
    format!("'{}'", text.replace('\'', "''"))
}

fn sql_of((column, values): &Chosen) -> String {
    let name = format!("\"{}\"", column.replace('"', "\"\""));
    let is_text = COLUMNS.contains(&column.as_str()) || [PARTICIPANT, STATUS].contains(&column.as_str());
    let one = |value: &Option<String>| match value {
        None => format!("{name} is null"),
        Some(value) if is_text => format!("{name} = {}", quoted(value)),
        Some(value) => format!("{name} = {value}"),
    };
    let any = values.iter().map(one).collect::<Vec<_>>().join(" or ");
    if column == STATUS { format!("any({any})") } else { format!("({any})") }
}

/// The column of the participant's code, in recordings of people.
pub(super) const PARTICIPANT: &str = "participant";

/// The values of a column by row, as a request names them.
pub(super) fn values_of<'t>(
    table: &'t EpisodeTable,
    column: &'t str,
) -> Result<Box<dyn Fn(usize) -> Option<String> + 't>, ViewError> {
    Ok(match column {
        "experiment" => Box::new(|row| Some(table.keys.get(row).experiment.to_owned())),
        "model" => Box::new(|row| Some(table.keys.get(row).model.to_owned())),
        CONDITION => Box::new(|row| Some(condition_of(table, row).to_owned())),
        "seed" => Box::new(|row| Some(table.keys.get(row).seed.to_string())),
        "run" => Box::new(|row| Some(table.keys.get(row).run.to_string())),
        PARTICIPANT => Box::new(|row| table.label(PARTICIPANT)?.get(row).map(str::to_owned)),
        name => match table.metric(name) {
            Some(metric) => Box::new(|row| table.decimal(metric, row).map(|value| value.to_string())),
            None if name.starts_with(labels::PREFIX) && table.label(name).is_some() => {
                Box::new(|row| table.label(name)?.get(row).map(str::to_owned))
            }
            None => {
                return Err(ViewError::Request(format!("cannot filter by `{}`", visible(name))));
            }
        },
    })
}

/// The condition of an episode; `default` if it has none.
pub(super) fn condition_of(table: &EpisodeTable, row: usize) -> &str {
    table.label(CONDITION).and_then(|label| label.get(row)).unwrap_or("default")
}

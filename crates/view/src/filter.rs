//! The filter of a page: chosen values of columns, a condition in the language of definitions, words in a name.
//!
//! Rule: a condition over what the episode table has is answered from memory; one that asks for steps costs a scan.

use std::collections::HashSet;

use super::error::ViewError;
use super::snapshot::{Scored, Snapshot};
use report::cells::group::CONDITION;
use score::select::{SelectError, select};
use score::table::EpisodeTable;
use study::{Question, Results, StudyError};

/// The keys and values of a request, in order.
pub(super) type Query = [(String, String)];

pub(super) fn value<'q>(query: &'q Query, key: &str) -> Option<&'q str> {
    query.iter().find(|(name, _)| name == key).map(|(_, value)| value.as_str()).filter(|value| !value.is_empty())
}

pub(super) fn number(query: &Query, key: &str) -> Result<Option<usize>, ViewError> {
    let parse = |text: &str| text.parse().map_err(|_| ViewError::Request(format!("`{key}`: expected a whole number")));
    value(query, key).map(parse).transpose()
}

/// A value that a key must have.
pub(super) fn required<'q>(query: &'q Query, key: &str) -> Result<&'q str, ViewError> {
    value(query, key).ok_or_else(|| ViewError::Request(format!("expected `{key}` in the request")))
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Filter {
    chosen: Vec<(&'static str, Vec<String>)>,
    pub condition: Option<String>,
    words: Option<String>,
}

/// The columns that values are chosen of.
pub(super) const COLUMNS: [&str; 3] = ["experiment", "model", CONDITION];

impl Filter {
    /// Reads a request.
    pub fn of(query: &Query) -> Self {
        let values = |column: &str| -> Vec<String> {
            query.iter().filter(|(key, _)| key == column).map(|(_, value)| value.clone()).collect()
        };
        let chosen = COLUMNS.map(|column| (column, values(column)));
        Self {
            chosen: chosen.into_iter().filter(|(_, values)| !values.is_empty()).collect(),
            condition: value(query, "where").map(str::to_owned),
            words: value(query, "search").map(str::to_lowercase),
        }
    }

    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// The rows of the table that are wanted, in its order.
    pub fn rows(&self, snapshot: &Snapshot) -> Result<Vec<usize>, ViewError> {
        let scored = snapshot.table()?;
        let table = &scored.results.episodes;
        let kept = self.condition.as_ref().map(|condition| kept(snapshot, scored, condition)).transpose()?;
        let is_kept = |row: usize| kept.as_ref().is_none_or(|kept| kept.contains(table.keys.get(row).episode_id));
        Ok((0..table.len()).filter(|row| self.holds(table, *row) && is_kept(*row)).collect())
    }

    /// The results of the rows that are wanted: what tables are made of.
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

    /// The same as a condition in the language of definitions, with another one.
    pub fn as_condition(&self, other: Option<&str>) -> Option<String> {
        let quoted = |value: &String| format!("'{}'", value.replace('\'', "''"));
        let chosen = self.chosen.iter().map(|(column, values)| {
            format!("{column} in ({})", values.iter().map(quoted).collect::<Vec<_>>().join(", "))
        });
        let written = self.condition.iter().map(String::as_str).chain(other).map(|text| format!("({text})"));
        let all: Vec<String> = written.chain(chosen).collect();
        (!all.is_empty()).then(|| all.join(" and "))
    }

    fn holds(&self, table: &EpisodeTable, row: usize) -> bool {
        let key = table.keys.get(row);
        let is_chosen = |(column, values): &(&str, Vec<String>)| match *column {
            "experiment" => values.iter().any(|value| value == key.experiment),
            "model" => values.iter().any(|value| value == key.model),
            _ => values.iter().any(|value| value == condition_of(table, row)),
        };
        let has = |text: &str, words: &String| text.to_lowercase().contains(words);
        self.chosen.iter().all(is_chosen)
            && self.words.as_ref().is_none_or(|words| has(key.episode_id, words) || has(key.model, words))
    }
}

/// The condition of an episode; `default` where it has none.
pub(super) fn condition_of(table: &EpisodeTable, row: usize) -> &str {
    table.label(CONDITION).and_then(|label| label.get(row)).unwrap_or("default")
}

fn kept(snapshot: &Snapshot, scored: &Scored, condition: &str) -> Result<HashSet<String>, ViewError> {
    let table = match select(scored.results.episodes.clone(), None, Some(condition)) {
        Ok(table) => table,
        Err(SelectError::Condition(_)) => {
            let options = &snapshot.options;
            let question = Question { filter: Some(condition.to_owned()), ..options.question.clone() };
            Scored::study(options, scored.inputs.clone(), question)?.score()?.episodes
        }
        Err(error) => return Err(StudyError::from(error).into()),
    };
    Ok(table.keys.iter().map(|key| key.episode_id.to_owned()).collect())
}

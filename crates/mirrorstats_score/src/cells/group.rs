//! The episode table grouped by key columns: cells.
//!
//! Rule: an undefined value enters no moments; only [`Group::episodes`] counts it. Groups are ordered by key, never by
//! arrival.

use std::collections::{BTreeMap, BTreeSet};

use super::interval::ranges;
use super::{Cells, Group, KeyValue};
use crate::tables::table::{EpisodeTable, TextColumn};
use mirrorstats_exact::budget::{Exceeded, Limit};
use mirrorstats_exact::moments::{MomentOverflow, Moments};
use mirrorstats_exact::suggest::hint;
use mirrorstats_trace::footers::declared::{Cluster, Origin};

/// The key columns of every episode table.
pub const KEY_COLUMNS: [&str; 5] = ["experiment", "model", "seed", "run", "episode_id"];
/// The default columns that cells are grouped by.
pub const DEFAULT_BY: [&str; 2] = ["experiment", "model"];

const MOST_CELLS: Limit =
    Limit::new("cells, groups times metrics; group by fewer columns or leave metrics out", 200_000);

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GroupError {
    #[error("no column to group by: expected at least one of {known}")]
    NoColumn { known: String },
    #[error("cannot group by `{name}`: expected one of {known}{hint}")]
    UnknownColumn { name: String, known: String, hint: String },
    #[error("cannot group by `{name}` twice: name each column once")]
    RepeatedColumn { name: String },
    #[error("metric `{metric}`: {source}")]
    Overflow { metric: String, source: MomentOverflow },
    #[error(transparent)]
    Exceeded(#[from] Exceeded),
}

/// Cells of `table` grouped by the columns `by`.
///
/// A label column with only integer values is ordered as integers.
pub fn group(table: &EpisodeTable, by: &[String]) -> Result<Cells, GroupError> {
    let Membership { keys, of_row } = Membership::of(table, by)?;
    MOST_CELLS.check((keys.len() as u64).saturating_mul(table.metrics.len() as u64))?;
    let none = |key| Group { key, episodes: 0, moments: vec![Moments::default(); table.metrics.len()], repeats: false };
    let mut groups: Vec<Group> = keys.into_iter().map(none).collect();
    for group in repeated(table, &of_row) {
        groups[group].repeats = true;
    }
    let mut start = 0;
    // A table is ordered by experiment and model: grouped by them, each group is one run of rows.
    for run in of_row.chunk_by(|a, b| a == b) {
        let rows = start..start + run.len();
        start = rows.end;
        let group = &mut groups[run[0]];
        group.episodes += run.len() as u64;
        for (moments, metric) in group.moments.iter_mut().zip(&table.metrics) {
            *moments = metric
                .add_moments(*moments, rows.clone())
                .map_err(|source| GroupError::Overflow { metric: metric.name.clone(), source })?;
        }
    }
    Ok(Cells {
        catalog: table.catalog.clone(),
        by: by.to_vec(),
        metrics: table.metrics.iter().map(|metric| metric.name.clone()).collect(),
        ranges: ranges(table),
        groups,
    })
}

/// The groups in which a unit has several episodes: a declared cluster, else a participant, else a scene. The scenes of a
/// reconstruction mean nothing.
fn repeated(table: &EpisodeTable, of_row: &[usize]) -> BTreeSet<usize> {
    let declared = &table.declared;
    let code = |name: &str, row: usize| table.label(name).and_then(|label| label.code(row));
    let unit = |row: usize| match declared.cluster {
        Some(Cluster::Seed) => Some((0, usize::try_from(i64::from(table.keys.seed(row)) - i64::from(i32::MIN)).ok()?)),
        None => code("participant", row).map(|it| (1, it)).or_else(|| code("scene", row).map(|it| (2, it))),
    };
    let mut seen = BTreeSet::new();
    let is_again = |&(row, &group): &(usize, &usize)| unit(row).is_some_and(|unit| !seen.insert((group, unit)));
    let rows = of_row.iter().enumerate().filter(|_| declared.origin != Some(Origin::Reconstruction));
    rows.filter(is_again).map(|(_, &group)| group).collect()
}

/// The distinct values of a key column, a label or a metric; `None` for any other name.
pub fn column_values(table: &EpisodeTable, name: &str) -> Option<BTreeSet<KeyValue>> {
    if let Some(ranks) = KeyRanks::of_column(table, name) {
        return Some(ranks.values.into_iter().collect());
    }
    let metric = table.metric(name)?;
    Some(metric.iter().map(|value| value.map_or(KeyValue::Missing, KeyValue::Int)).collect())
}

/// For each episode of `table`, the index of its group in the result of [`group`].
pub fn membership(table: &EpisodeTable, by: &[String]) -> Result<Vec<usize>, GroupError> {
    Ok(Membership::of(table, by)?.of_row)
}

struct Membership {
    keys: Vec<Vec<KeyValue>>,
    of_row: Vec<usize>,
}

impl Membership {
    fn of(table: &EpisodeTable, by: &[String]) -> Result<Self, GroupError> {
        let columns = columns(table, by)?;
        let ranks = |row: usize| columns.iter().map(move |column| column.of_row[row]);
        let mut seen: BTreeMap<Vec<usize>, usize> = BTreeMap::new();
        let mut of_row: Vec<usize> = Vec::with_capacity(table.len());
        for row in 0..table.len() {
            let group = match row.checked_sub(1) {
                Some(before) if ranks(before).eq(ranks(row)) => of_row[before],
                _ => {
                    let new = seen.len();
                    *seen.entry(ranks(row).collect()).or_insert(new)
                }
            };
            of_row.push(group);
        }
        // Groups are numbered by appearance, then by key.
        let mut places = vec![0; seen.len()];
        seen.values().zip(0..).for_each(|(seen, place)| places[*seen] = place);
        for group in &mut of_row {
            *group = places[*group];
        }
        let key = |ranks: &Vec<usize>| -> Vec<KeyValue> {
            columns.iter().zip(ranks).map(|(column, rank)| column.values[*rank].clone()).collect()
        };
        Ok(Self { keys: seen.keys().map(key).collect(), of_row })
    }
}

struct KeyRanks {
    values: Vec<KeyValue>,
    of_row: Vec<usize>,
}

impl KeyRanks {
    /// The ranks of a key column or a label; `None` for any other name.
    fn of_column(table: &EpisodeTable, name: &str) -> Option<Self> {
        let keys = &table.keys;
        Some(match name {
            "experiment" => Self::of_texts(&keys.experiment, false),
            "model" => Self::of_texts(&keys.model, false),
            "seed" => Self::of_ints(keys.seed.values()),
            "run" => Self::of_ints(keys.run.values()),
            "episode_id" => Self::of_texts(&keys.episode_id, false),
            label => {
                let column = table.label(label)?;
                Self::of_texts(column, column.iter().flatten().all(|text| canonical_integer(text).is_some()))
            }
        })
    }

    /// A text column with many duplicates: each row has a code, and each code a value.
    fn of_texts(column: &TextColumn, are_integers: bool) -> Self {
        // Null has its own code.
        let mut of_row: Vec<usize> = column.codes.iter().map(|code| code.map_or(0, |code| code as usize + 1)).collect();
        let mut first = vec![None; of_row.iter().max().map_or(0, |most| most + 1)];
        of_row.iter().enumerate().for_each(|(row, &code)| first[code] = first[code].or(Some(row)));
        let value = |row: usize| match column.get(row) {
            None => KeyValue::Missing,
            Some(text) if are_integers => canonical_integer(text).map_or(KeyValue::Missing, KeyValue::Int),
            Some(text) => KeyValue::Text(text.to_owned()),
        };
        let of_code: Vec<Option<KeyValue>> = first.into_iter().map(|row| row.map(value)).collect();
        let mut values: Vec<KeyValue> = of_code.iter().flatten().cloned().collect();
        values.sort_unstable();
        values.dedup();
        let place = |value: &KeyValue| values.binary_search(value).unwrap_or_default();
        let places: Vec<usize> = of_code.iter().map(|value| value.as_ref().map_or(0, place)).collect();
        for code in &mut of_row {
            *code = places[*code];
        }
        Self { values, of_row }
    }

    fn of_ints(ints: &[i32]) -> Self {
        let mut values = ints.to_vec();
        values.sort_unstable();
        values.dedup();
        let of_row = ints.iter().map(|value| values.binary_search(value).unwrap_or_default()).collect();
        Self { values: values.into_iter().map(|value| KeyValue::Int(value.into())).collect(), of_row }
    }
}

fn columns(table: &EpisodeTable, by: &[String]) -> Result<Vec<KeyRanks>, GroupError> {
    let known = || known_columns(table);
    if by.is_empty() {
        return Err(GroupError::NoColumn { known: known().join(", ") });
    }
    if let Some(name) = by.iter().enumerate().find_map(|(at, name)| by[..at].contains(name).then_some(name)) {
        return Err(GroupError::RepeatedColumn { name: name.clone() });
    }
    by.iter()
        .map(|name| {
            KeyRanks::of_column(table, name).ok_or_else(|| GroupError::UnknownColumn {
                name: name.clone(),
                known: known().join(", "),
                hint: hint(name, known()),
            })
        })
        .collect()
}

fn known_columns(table: &EpisodeTable) -> Vec<&str> {
    KEY_COLUMNS.into_iter().chain(table.labels.iter().map(|label| label.name.as_str())).collect()
}

/// The integer that prints as exactly this text: `7`, but not `07` or `+7`.
fn canonical_integer(text: &str) -> Option<i64> {
    text.parse().ok().filter(|value: &i64| value.to_string() == text)
}

#[cfg(test)]
mod tests {
    use indexmap::IndexMap;
    use proptest::prelude::*;

    use super::{GroupError, group, membership};
    use crate::cells::KeyValue;
    use crate::tables::table::{Declared, EpisodeKey, EpisodeTable, LabelColumn, MetricColumn};
    use mirrorstats_metric::catalogs::catalog::Catalog;

    /// Rows of (experiment, model, seed, label, value).
    type RowOf<'a> = (&'a str, &'a str, i32, Option<&'a str>, Option<i64>);

    fn table(rows: &[RowOf]) -> EpisodeTable {
        let catalog = Catalog {
            name: "test".to_owned(),
            domain: None,
            hash: String::new(),
            open: true,
            lets: IndexMap::new(),
            columns: IndexMap::new(),
            metric: IndexMap::new(),
            experiment: IndexMap::new(),
            factor: IndexMap::new(),
        };
        let key = |(at, row): (usize, &RowOf)| EpisodeKey {
            experiment: row.0.to_owned(),
            model: row.1.to_owned(),
            seed: row.2,
            run: 0,
            episode_id: format!("e{at}"),
        };
        EpisodeTable {
            catalog,
            keys: rows.iter().enumerate().map(key).collect(),
            labels: vec![LabelColumn {
                name: "distractors".to_owned(),
                values: rows.iter().map(|row| row.3).collect(),
            }],
            metrics: vec![MetricColumn::new("X", rows.iter().map(|row| row.4))],
            declared: Declared::default(),
        }
    }

    fn by(names: &[&str]) -> Vec<String> {
        names.iter().map(|&name| name.to_owned()).collect()
    }

    fn keys(rows: &[RowOf], names: &[&str]) -> Vec<String> {
        let cells = group(&table(rows), &by(names)).unwrap();
        let text = |key: &Vec<KeyValue>| key.iter().map(ToString::to_string).collect::<Vec<_>>().join("/");
        cells.groups.iter().map(|group| text(&group.key)).collect()
    }

    #[test]
    fn an_undefined_value_is_counted_among_the_episodes_only() {
        let rows = [("E1", "a", 1, None, Some(3)), ("E1", "a", 1, None, None), ("E1", "a", 2, None, Some(0))];
        let cells = group(&table(&rows), &by(&["experiment", "model"])).unwrap();
        let [only] = &cells.groups[..] else { panic!("one group") };
        assert_eq!(only.episodes, 3);
        assert_eq!((only.moments[0].n, only.moments[0].sum, only.moments[0].sum_sq), (2, 3, 9));
    }

    #[test]
    fn groups_are_ordered_by_key_and_integers_by_size() {
        let rows = [
            ("E2", "b", 10, Some("10"), None),
            ("E1", "b", 9, Some("9"), None),
            ("E1", "a", 10, None, None),
            ("E1", "a", 9, Some("-1"), None),
        ];
        assert_eq!(keys(&rows, &["experiment", "model"]), ["E1/a", "E1/b", "E2/b"]);
        assert_eq!(keys(&rows, &["seed"]), ["9", "10"]);
        assert_eq!(keys(&rows, &["distractors"]), ["", "-1", "9", "10"]);
        assert_eq!(keys(&rows, &["model", "seed"]), ["a/9", "a/10", "b/9", "b/10"]);
    }

    #[test]
    fn labels_that_only_look_like_integers_stay_text() {
        let rows =
            [("E1", "a", 1, Some("07"), None), ("E1", "a", 1, Some("7"), None), ("E1", "a", 1, Some("10"), None)];
        assert_eq!(keys(&rows, &["distractors"]), ["07", "10", "7"]);
    }

    #[test]
    fn an_unknown_group_column_is_named() {
        let table = table(&[("E1", "a", 1, None, None)]);
        let message = |names: &[&str]| group(&table, &by(names)).unwrap_err().to_string();
        insta::assert_snapshot!(message(&["modle"]), @"cannot group by `modle`: expected one of experiment, model, seed, run, episode_id, distractors; did you mean `model`?");
        insta::assert_snapshot!(message(&["zzz"]), @"cannot group by `zzz`: expected one of experiment, model, seed, run, episode_id, distractors");
        insta::assert_snapshot!(message(&["seed", "seed"]), @"cannot group by `seed` twice: name each column once");
        assert!(matches!(group(&table, &[]), Err(GroupError::NoColumn { .. })));
    }

    #[test]
    fn no_episode_gives_no_cell() {
        assert_eq!(keys(&[], &["model"]), Vec::<String>::new());
    }

    #[test]
    fn every_episode_knows_its_group() {
        let rows = [
            ("E2", "b", 1, Some("10"), None),
            ("E1", "b", 1, Some("9"), None),
            ("E2", "a", 1, None, None),
            ("E2", "b", 1, Some("9"), None),
        ];
        let places = |names: &[&str]| membership(&table(&rows), &by(names)).unwrap();
        assert_eq!(places(&["experiment", "model"]), [2, 0, 1, 2]);
        assert_eq!(places(&["distractors"]), [2, 1, 0, 1]);
        assert!(matches!(membership(&table(&rows), &by(&["x"])), Err(GroupError::UnknownColumn { .. })));
    }

    proptest! {
        #[test]
        fn cells_do_not_depend_on_the_order_of_episodes(
            rows in prop::collection::vec((0_usize..3, 0_usize..3, 0..3, prop::option::of(-9_i64..9)), 0..30),
            turn in 0_usize..30,
        ) {
            let names = ["a", "b", "c"];
            let row = |&(e, m, s, value): &(usize, usize, i32, Option<i64>)| (names[e], names[m], s, None, value);
            let rows: Vec<RowOf> = rows.iter().map(row).collect();
            let mut turned = rows.clone();
            turned.rotate_left(turn.min(rows.len()));
            turned.reverse();
            let grouped = |rows: &[RowOf]| group(&table(rows), &by(&["model", "seed"])).unwrap();
            prop_assert_eq!(grouped(&rows), grouped(&turned));
        }
    }
}

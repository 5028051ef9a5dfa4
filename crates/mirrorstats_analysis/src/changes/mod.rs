//! Compares two scorings: the cells that moved, the episodes that flipped.
//!
//! Rule: integers are compared, never floats. Episodes match if their whole keys are equal. Metrics, episodes and cells
//! of only one scoring are reported, and are never taken as zero.

mod text;

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::Serialize;

use mirrorstats_exact::number::Decimal;
use mirrorstats_metric::catalogs::catalog::{Catalog, Kind};
use mirrorstats_score::cells::group::{GroupError, group};
use mirrorstats_score::cells::{Cell, Cells, Group, KeyValue};
use mirrorstats_score::evidence::Evidence;
use mirrorstats_score::tables::table::{EpisodeKey, EpisodeKeys, EpisodeTable, KeyRef, MetricColumn};

/// A value of the scoring before, and the one after.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Pair<T> {
    /// Under the old definitions, or in the old scores.
    pub before: T,
    /// Under the new ones.
    pub after: T,
}

/// Changes from one scoring to another.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Changes {
    /// The definitions of each side.
    pub definitions: Pair<DefinitionsName>,
    /// Expressions that are written differently, those that only one side has included.
    pub rewritten: Vec<Rewritten>,
    /// The metrics of each side.
    pub metrics: Overlap<String>,
    /// The episodes of each side.
    pub episodes: Overlap<EpisodeName>,
    /// The columns that the cells are grouped by.
    pub by: Vec<String>,
    /// The number of compared cells.
    pub cells_compared: u64,
    /// The cells that moved, in the order of the tables.
    pub cells: Vec<CellChange>,
    /// The values that changed, by metric in the order of the tables, then by episode.
    pub flips: Vec<Flip>,
}

/// The definitions behind some scores.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct DefinitionsName {
    /// The file's own name; never a path.
    pub name: String,
    /// SHA-256 of the resolved definitions.
    pub sha256: String,
}

/// A part of a definition that is not written the same on both sides.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Rewritten {
    /// The `let` or the metric.
    pub name: String,
    /// `let`, `value`, `when`, or `se`.
    pub part: &'static str,
    /// The text of the definition; null on a side without one.
    pub text: Pair<Option<String>>,
}

/// Items of both sides, and items of one side only.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Overlap<T> {
    /// The number of items of both sides.
    pub both: u64,
    /// The items of the old scoring only.
    pub(crate) only_before: Vec<T>,
    /// The items of the new scoring only.
    pub(crate) only_after: Vec<T>,
}

/// The name of an episode.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct EpisodeName {
    /// Unique in a report.
    pub episode_id: String,
    /// Its model.
    pub model: String,
    /// Its experiment.
    pub experiment: String,
    /// Its seed.
    pub seed: i32,
    /// Its run within the seed.
    pub run: i32,
}

/// A cell whose moments are not the same on both sides.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct CellChange {
    /// The group, by the columns grouped by.
    pub key: IndexMap<String, KeyValue>,
    /// The metric.
    pub metric: String,
    /// A rate or a quantity, as the new definitions have it.
    pub kind: Kind,
    /// Its numbers; null where a side has no episode of the group.
    pub numbers: Pair<Option<Numbers>>,
    /// The mean after minus the mean before; null where either is undefined.
    pub mean_change: Option<f64>,
}

/// The exact numbers of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Numbers {
    /// The episodes of the group.
    pub episodes: u64,
    /// Those in which the metric is defined: the denominator.
    pub n: u64,
    /// The sum of the values; for a rate, the successes.
    pub sum: Decimal,
    /// The sum of their squares.
    pub sum_sq: Decimal,
    /// `sum / n`; null for no value.
    pub mean: Option<f64>,
    /// The standard error that the definition asks for; null where it is undefined.
    pub se: Option<f64>,
}

/// A value of one episode that changed.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Flip {
    /// The metric.
    pub metric: String,
    /// The episode.
    #[serde(flatten)]
    pub episode: EpisodeName,
    /// The old and the new value; null where the metric is undefined.
    pub value: Pair<Option<Decimal>>,
    /// The timesteps that decided it, ascending; null where the traces that say so were not given.
    pub timesteps: Pair<Option<Vec<i64>>>,
}

impl Changes {
    /// Compares two episode tables; cells are grouped by `by`.
    ///
    /// # Errors
    /// Columns to group by that a table lacks; sums beyond 128 bits.
    pub fn between(before: &EpisodeTable, after: &EpisodeTable, by: &[String]) -> Result<Self, GroupError> {
        let metrics = Overlap::of(&names(before), &names(after));
        let (cells_compared, cells) = cell_changes(&group(before, by)?, &group(after, by)?);
        let aligned = Aligned::of(&before.keys, &after.keys);
        Ok(Self {
            definitions: Pair { before: origin(&before.catalog), after: origin(&after.catalog) },
            rewritten: rewritten(before, after),
            metrics,
            episodes: aligned.overlap(before, after),
            by: by.to_vec(),
            cells_compared,
            cells,
            flips: flips(before, after, &aligned.both),
        })
    }

    /// Returns true if all numbers are equal, for the same metrics and episodes.
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty() && self.flips.is_empty() && self.metrics.is_full() && self.episodes.is_full()
    }

    pub fn flipped_episodes(&self) -> BTreeSet<String> {
        self.flips.iter().map(|flip| flip.episode.episode_id.clone()).collect()
    }

    pub fn flipped_metrics(&self) -> Vec<String> {
        Vec::from_iter(self.flips.iter().map(|flip| flip.metric.clone()).collect::<BTreeSet<_>>())
    }

    /// Adds the timesteps that decided the old and the new values; ignores evidence for values other than the scores'.
    pub fn explain(&mut self, before: &BTreeMap<String, Evidence>, after: &BTreeMap<String, Evidence>) {
        for flip in &mut self.flips {
            flip.timesteps.before = deciding(flip, flip.value.before, before);
            flip.timesteps.after = deciding(flip, flip.value.after, after);
        }
    }
}

/// The rows of two tables by their keys; both are in key order.
#[derive(Default)]
struct Aligned {
    both: Vec<Pair<usize>>,
    only_before: Vec<usize>,
    only_after: Vec<usize>,
}

impl Aligned {
    fn of(before: &EpisodeKeys, after: &EpisodeKeys) -> Self {
        let mut aligned = Self::default();
        if before.has_keys_of(after) {
            // One scan scored both, so keys need not be read. Comparing them takes a third of a diff.
            aligned.both.extend((0..before.len()).map(|row| Pair { before: row, after: row }));
            return aligned;
        }
        let (mut old, mut new) = (0, 0);
        while old < before.len() && new < after.len() {
            let order = before.get(old).cmp(&after.get(new));
            match order {
                Ordering::Less => aligned.only_before.push(old),
                Ordering::Greater => aligned.only_after.push(new),
                Ordering::Equal => aligned.both.push(Pair { before: old, after: new }),
            }
            old += usize::from(order.is_le());
            new += usize::from(order.is_ge());
        }
        aligned.only_before.extend(old..before.len());
        aligned.only_after.extend(new..after.len());
        aligned
    }

    fn overlap(&self, before: &EpisodeTable, after: &EpisodeTable) -> Overlap<EpisodeName> {
        let names = |rows: &[usize], table: &EpisodeTable| rows.iter().map(|row| table.keys.get(*row).into()).collect();
        Overlap {
            both: self.both.len() as u64,
            only_before: names(&self.only_before, before),
            only_after: names(&self.only_after, after),
        }
    }
}

impl CellChange {
    fn new(cells: &Cells, key: &[KeyValue], metric: &str, numbers: Pair<Option<Numbers>>) -> Self {
        let kind = cells.catalog.metric[metric].kind;
        let key = cells.by.iter().cloned().zip(key.iter().cloned()).collect();
        let mut change = Self { key, metric: metric.to_owned(), kind, numbers, mean_change: None };
        change.mean_change = change.exact_mean_change().map(as_float);
        change
    }

    /// The mean after minus the mean before, as an exact fraction; `None` if either is undefined, or beyond 128 bits.
    pub(crate) fn exact_mean_change(&self) -> Option<(i128, i128)> {
        let (before, after) = (self.numbers.before?, self.numbers.after?);
        let digits = before.sum.places().max(after.sum.places());
        let below = i128::from(before.n).checked_mul(i128::from(after.n)).filter(|below| *below > 0)?;
        let below = below.checked_mul(10_i128.pow(digits))?;
        let scaled = |sum: Decimal, n: u64| sum.with_places(digits)?.units().checked_mul(i128::from(n));
        let above = scaled(after.sum, before.n)?.checked_sub(scaled(before.sum, after.n)?)?;
        Some((above, below))
    }
}

impl From<KeyRef<'_>> for EpisodeName {
    fn from(key: KeyRef<'_>) -> Self {
        let EpisodeKey { experiment, model, seed, run, episode_id } = key.to_owned();
        Self { episode_id, model, experiment, seed, run }
    }
}

fn origin(catalog: &Catalog) -> DefinitionsName {
    DefinitionsName { name: catalog.name.clone(), sha256: catalog.hash.clone() }
}

fn names(table: &EpisodeTable) -> Vec<String> {
    table.metrics.iter().map(|metric| metric.name.clone()).collect()
}

impl<T> Overlap<T> {
    const fn is_full(&self) -> bool {
        self.only_before.is_empty() && self.only_after.is_empty()
    }
}

impl Overlap<String> {
    pub fn of(before: &[String], after: &[String]) -> Self {
        let without = |names: &[String], others: &[String]| -> Vec<String> {
            names.iter().filter(|name| !others.contains(name)).cloned().collect()
        };
        let only_after = without(after, before);
        Self { both: (after.len() - only_after.len()) as u64, only_before: without(before, after), only_after }
    }
}

fn rewritten(before: &EpisodeTable, after: &EpisodeTable) -> Vec<Rewritten> {
    let mut found = Vec::new();
    let mut push = |name: &str, part, before: Option<String>, after: Option<String>| {
        if before != after {
            found.push(Rewritten { name: name.to_owned(), part, text: Pair { before, after } });
        }
    };
    let (old, new) = (&before.catalog, &after.catalog);
    let mut lets: Vec<&String> = new.lets.keys().collect();
    lets.extend(old.lets.keys().filter(|name| !new.lets.contains_key(*name)));
    for name in lets {
        push(name, "let", old.lets.get(name).cloned(), new.lets.get(name).cloned());
    }
    for name in names(after) {
        if let (Some(old), Some(new)) = (old.metric.get(&name), new.metric.get(&name)) {
            push(&name, "value", Some(old.value.clone()), Some(new.value.clone()));
            push(&name, "when", old.when.clone(), new.when.clone());
            push(&name, "se", Some(old.se.name().to_owned()), Some(new.se.name().to_owned()));
        }
    }
    found
}

fn flips(before: &EpisodeTable, after: &EpisodeTable, both: &[Pair<usize>]) -> Vec<Flip> {
    let mut found = Vec::new();
    let in_place = both.iter().all(|rows| rows.before == rows.after);
    for new in &after.metrics {
        let may_flip = |old: &&MetricColumn| !(in_place && old.has_values_of(new));
        let Some(old) = before.metric(&new.name).filter(may_flip) else { continue };
        for rows in both {
            let value = Pair { before: before.decimal(old, rows.before), after: after.decimal(new, rows.after) };
            if value.before.map(Decimal::shortest) != value.after.map(Decimal::shortest) {
                let (metric, episode) = (new.name.clone(), EpisodeName::from(after.keys.get(rows.after)));
                found.push(Flip { metric, episode, value, timesteps: Pair { before: None, after: None } });
            }
        }
    }
    found
}

fn deciding(flip: &Flip, value: Option<Decimal>, evidence: &BTreeMap<String, Evidence>) -> Option<Vec<i64>> {
    let metrics = &evidence.get(&flip.episode.episode_id)?.metrics;
    let found = metrics.iter().find(|metric| metric.metric == flip.metric && metric.value == value)?;
    Some(found.timesteps.clone())
}

fn cell_changes(before: &Cells, after: &Cells) -> (u64, Vec<CellChange>) {
    let old: BTreeMap<&Vec<KeyValue>, &Group> = before.groups.iter().map(|group| (&group.key, group)).collect();
    let new: BTreeMap<&Vec<KeyValue>, &Group> = after.groups.iter().map(|group| (&group.key, group)).collect();
    let keys: BTreeSet<&Vec<KeyValue>> = old.keys().chain(new.keys()).copied().collect();
    let (mut compared, mut moved) = (0, Vec::new());
    for key in keys {
        for metric in after.metrics.iter().filter(|metric| before.metrics.contains(metric)) {
            let numbers = Pair {
                before: old.get(key).and_then(|group| Numbers::of(before, group, metric)),
                after: new.get(key).and_then(|group| Numbers::of(after, group, metric)),
            };
            compared += 1;
            if !is_same(numbers.before, numbers.after) {
                moved.push(CellChange::new(after, key, metric, numbers));
            }
        }
    }
    (compared, moved)
}

fn is_same(before: Option<Numbers>, after: Option<Numbers>) -> bool {
    let exact = |numbers: Numbers| {
        let [sum, sum_sq] = [numbers.sum, numbers.sum_sq].map(Decimal::shortest);
        (numbers.n, sum, sum_sq, numbers.se.map(f64::to_bits))
    };
    before.map(exact) == after.map(exact)
}

#[expect(clippy::cast_precision_loss, reason = "the one conversion from integers, done once")]
fn as_float((above, below): (i128, i128)) -> f64 {
    above as f64 / below as f64
}

impl Numbers {
    fn of(cells: &Cells, group: &Group, metric: &str) -> Option<Self> {
        let Cell { metric, moments, .. } = cells.of_metric(group, metric)?;
        let [sum, sum_sq] = metric.sums(moments);
        let (mean, se) = (metric.mean(moments), metric.standard_error(moments));
        Some(Self { episodes: group.episodes, n: moments.n, sum, sum_sq, mean, se })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::{Changes, Evidence};
    use mirrorstats_exact::number::Decimal;
    use mirrorstats_metric::definitions::Definitions;
    use mirrorstats_score::evidence::MetricEvidence;
    use mirrorstats_score::tables::table::{Declared, EpisodeKey, EpisodeTable, MetricColumn};
    use mirrorstats_score::vocabulary::schema_columns;

    const RATE: &str = "[metric.R]\nvalue = \"length() > 2\"";

    /// Episodes `0..` of one model with these values of the rate `R`.
    fn table(definitions: &str, first: i32, values: &[Option<i64>]) -> EpisodeTable {
        let key = |run: i32| EpisodeKey {
            experiment: "X".into(),
            model: "m".into(),
            seed: 1,
            run,
            episode_id: format!("e{run}"),
        };
        let keys = (first..).take(values.len()).map(key).collect();
        let catalog = Definitions::from_toml("d", definitions, &schema_columns()).unwrap().catalog;
        let metrics = vec![MetricColumn::new("R", values.iter().copied())];
        EpisodeTable { catalog, keys, labels: vec![], metrics, declared: Declared::default() }
    }

    fn changes(before: &EpisodeTable, after: &EpisodeTable) -> Changes {
        Changes::between(before, after, &["model".to_owned()]).unwrap()
    }

    fn units(value: Option<Decimal>) -> Option<i64> {
        value.map(|value| value.units().try_into().unwrap())
    }

    #[test]
    fn a_table_does_not_differ_from_itself() {
        let same = table(RATE, 0, &[Some(1), None, Some(0)]);
        let changes = changes(&same, &same);
        assert!(changes.is_empty() && changes.rewritten.is_empty());
        assert_eq!((changes.cells_compared, changes.metrics.both, changes.episodes.both), (1, 1, 3));
    }

    #[test]
    fn undefined_differs_from_zero() {
        let changes = changes(&table(RATE, 0, &[Some(0), Some(1)]), &table(RATE, 0, &[None, Some(1)]));
        let [flip] = &changes.flips[..] else { panic!("{:?}", changes.flips) };
        assert_eq!((units(flip.value.before), flip.value.after), (Some(0), None));
        let [cell] = &changes.cells[..] else { panic!("{:?}", changes.cells) };
        let (before, after) = (cell.numbers.before.unwrap(), cell.numbers.after.unwrap());
        assert_eq!([(before.n, before.sum.units()), (after.n, after.sum.units())], [(2, 1), (1, 1)]);
        assert_eq!(cell.exact_mean_change(), Some((1, 2)));
    }

    #[test]
    fn flips_that_cancel_move_no_cell() {
        let changes = changes(&table(RATE, 0, &[Some(0), Some(1)]), &table(RATE, 0, &[Some(1), Some(0)]));
        assert_eq!((changes.flips.len(), changes.cells.len()), (2, 0));
        assert!(!changes.is_empty());
    }

    #[test]
    fn another_standard_error_changes_a_cell_without_flips() {
        let population = format!("{RATE}\nse = \"population\"");
        let values = [Some(0), Some(1), Some(1)];
        let changes = changes(&table(RATE, 0, &values), &table(&population, 0, &values));
        assert_eq!((changes.flips.len(), changes.cells.len()), (0, 1));
        assert_eq!(changes.rewritten[0].part, "se");
    }

    #[test]
    fn episodes_of_one_side_are_listed_and_flip_nothing() {
        let changes = changes(&table(RATE, 0, &[Some(1), Some(1)]), &table(RATE, 1, &[Some(1), Some(1)]));
        let ids = |names: &[super::EpisodeName]| names.iter().map(|n| n.episode_id.clone()).collect::<Vec<_>>();
        assert_eq!(ids(&changes.episodes.only_before), ["e0"]);
        assert_eq!(ids(&changes.episodes.only_after), ["e2"]);
        assert_eq!((changes.flips.len(), changes.cells.len(), changes.is_empty()), (0, 0, false));
    }

    #[test]
    fn episodes_are_matched_by_id_not_by_row() {
        let changes = changes(&table(RATE, 0, &[Some(1), Some(0)]), &table(RATE, 1, &[Some(1), Some(0)]));
        let [flip] = &changes.flips[..] else { panic!("{:?}", changes.flips) };
        assert_eq!((flip.episode.run, units(flip.value.before), units(flip.value.after)), (1, Some(0), Some(1)));
    }

    #[test]
    fn metrics_of_one_side_are_listed() {
        let mut other = table(RATE, 0, &[Some(1)]);
        other.metrics[0].name = "S".into();
        let changes = changes(&table(RATE, 0, &[Some(1)]), &other);
        assert_eq!((changes.metrics.only_before, changes.metrics.only_after), (vec!["R".into()], vec!["S".into()]));
        assert_eq!(changes.cells_compared, 0);
    }

    proptest! {
        #[test]
        fn flips_lead_from_one_scoring_to_the_other(
            values in proptest::collection::vec((proptest::option::of(0..2i64), proptest::option::of(0..2i64)), 0..9),
        ) {
            let (before, after): (Vec<_>, Vec<_>) = values.into_iter().unzip();
            let (mut old, new) = (table(RATE, 0, &before), table(RATE, 0, &after));
            let changes = changes(&old, &new);
            for flip in &changes.flips {
                let row = old.keys.iter().position(|key| key.episode_id == flip.episode.episode_id).unwrap();
                let mut values: Vec<Option<i64>> = old.metrics[0].iter().collect();
                prop_assert_eq!(values[row], units(flip.value.before));
                prop_assert_ne!(flip.value.before, flip.value.after);
                values[row] = units(flip.value.after);
                old.metrics[0] = MetricColumn::new("R", values);
            }
            prop_assert_eq!(&old.metrics, &new.metrics);
            prop_assert_eq!(changes.is_empty(), before == after);
        }
    }

    #[test]
    fn evidence_for_another_value_explains_nothing() {
        let mut changes = changes(&table(RATE, 0, &[Some(0)]), &table(RATE, 0, &[Some(1)]));
        let metric = MetricEvidence {
            metric: "R".into(),
            value: Some(Decimal::of_units(1, 0)),
            timesteps: vec![2, 5],
            facts: vec![],
        };
        let evidence = Evidence { episode_id: "e0".into(), length: 5, metrics: vec![metric] };
        let evidence = [("e0".to_owned(), evidence)].into();
        changes.explain(&evidence, &evidence);
        assert_eq!((&changes.flips[0].timesteps.before, &changes.flips[0].timesteps.after), (&None, &Some(vec![2, 5])));
    }
}

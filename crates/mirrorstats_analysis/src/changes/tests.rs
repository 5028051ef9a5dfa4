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

//! Estimate, difference, sign, order, p and verdict of every answer come from one quantity: each unit counts once.

#![expect(clippy::cast_precision_loss, reason = "counts of a few episodes")]

use std::collections::BTreeMap;

use mirrorstats_analysis::gate::{Gate, GateCell, GateOptions, GateVerdict};
use mirrorstats_analysis::statistics::{
    Intervals, Options, OverallMethod, Sequential, SequentialPair, Statistics, Verdict,
};
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_statistics::design::Design;
use mirrorstats_statistics::intervals::random::SplitMix64;

use super::{CLUSTERED, RECORDED, Row, cells, labelled};

/// Successes and episodes of each unit.
type Units = BTreeMap<i32, (f64, f64)>;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Scenes,
    Seeds,
    People,
}

impl Kind {
    fn design(self) -> Design {
        if self == Self::Seeds { CLUSTERED } else { RECORDED }
    }

    /// Units are numbered by the seed.
    fn table(self, rows: &[Row]) -> EpisodeTable {
        match self {
            Self::Scenes => labelled(rows, "scene", |row| Some(row.2.to_string())),
            Self::Seeds => labelled(rows, "scene", |row| Some(format!("{} {}", row.2, row.3))),
            Self::People => labelled(rows, "participant", |row| Some(row.2.to_string())),
        }
    }

    fn statistics(self, rows: &[Row]) -> Statistics {
        let table = self.table(rows);
        Statistics::from_table(&table, &cells(&table), &Options { design: self.design(), ..Options::default() })
            .unwrap()
    }

    fn gate(self, base: &[Row], new: &[Row]) -> GateCell {
        let options = GateOptions { metric: "TSA".to_owned(), margin: 0.1, confidence: 0.95, pool: false };
        let found = Gate::between([&self.table(base), &self.table(new)], self.design(), &options).unwrap();
        found.cells.into_iter().next().unwrap()
    }
}

fn units(rows: &[Row], of: impl Fn(&Row) -> bool) -> Units {
    let mut units = Units::new();
    for row in rows.iter().filter(|row| of(row)) {
        let (successes, n) = units.entry(row.2).or_default();
        *successes += f64::from(u8::from(row.4));
        *n += 1.0;
    }
    units
}

fn mean(units: &Units) -> f64 {
    units.values().map(|(successes, n)| successes / n).sum::<f64>() / units.len() as f64
}

/// The mean difference of shared units and the difference of the other units' means, with the weights of Mantel and
/// Haenszel.
fn estimate(first: &Units, second: &Units) -> f64 {
    let alone = |side: &Units, other: &Units| -> Units {
        side.iter().filter(|(unit, _)| !other.contains_key(unit)).map(|(unit, sums)| (*unit, *sums)).collect()
    };
    let shared = first.iter().filter_map(|(unit, (a, m))| second.get(unit).map(|(b, n)| a / m - b / n));
    let (sum, count) = shared.fold((0.0, 0.0), |(sum, count), difference| (sum + difference, count + 1.0));
    let (a, b) = (alone(first, second), alone(second, first));
    if a.is_empty() || b.is_empty() {
        return sum / count;
    }
    let weight = 2.0 * (a.len() * b.len()) as f64 / (a.len() + b.len()) as f64;
    (sum + weight * (mean(&a) - mean(&b))) / (count + weight)
}

/// Two models in two experiments. Failed units are often repeated more, and units may be those of one side alone.
fn random_design(random: &mut SplitMix64) -> Vec<Row<'static>> {
    let mut rows = Vec::new();
    let most_repeats = [1, 3, 12][random.below(3)];
    let shift = [0, 0, 3, 40][random.below(4)];
    for (side, model) in ["a", "b"].into_iter().enumerate() {
        let count = 6 + random.below(9);
        let skill = random.unit();
        let first = if side == 1 { shift } else { 0 };
        for unit in first..first + i32::try_from(count).unwrap() {
            for experiment in ["E1", "E2"] {
                let is_solved = random.unit() < skill;
                let repeats =
                    if is_solved { 1 + random.below(2).min(most_repeats - 1) } else { 1 + random.below(most_repeats) };
                for run in 0..i32::try_from(repeats).unwrap() {
                    let steps = 2 + i64::try_from(random.below(if is_solved { 20 } else { 60 })).unwrap();
                    rows.push((experiment, model, unit, run, is_solved != (random.unit() < 0.1), steps));
                }
            }
        }
    }
    rows
}

fn agree(difference: Option<f64>, expected: f64, about: &str) {
    let difference = difference.unwrap_or_else(|| panic!("{about}: no difference"));
    assert!((difference - expected).abs() < 1e-9, "{about}: {difference}, not {expected}");
}

#[test]
fn every_sign_is_the_sign_of_the_estimate_that_is_tested() {
    let mut random = SplitMix64::seeded(20_261_129);
    let mut verdicts = 0;
    for at in 0..60 {
        let kind = [Kind::Scenes, Kind::Seeds, Kind::People][at % 3];
        let rows = random_design(&mut random);
        let found = kind.statistics(&rows);
        let side = |experiment: &str, model: &str| units(&rows, |row| row.0 == experiment && row.1 == model);
        for row in found.chance.iter().filter(|row| row.metric == "TSA") {
            let mean = mean(&side(&row.key.experiment, &row.key.model));
            verdicts += usize::from(row.verdict != Verdict::NotSeparated);
            assert!(row.verdict != Verdict::Above || mean > row.level.value(), "{row:?}");
            assert!(row.verdict != Verdict::Below || mean < row.level.value(), "{row:?}");
        }
        for family in &found.models {
            let test = &family.tests[0];
            let (Some(difference), Some(_)) = (test.comparison.difference, test.comparison.p) else { continue };
            assert!(if family.metric == "TTD" { difference <= 0.0 } else { difference >= 0.0 }, "{test:?}");
            if family.metric == "TSA" {
                let [first, second] = [&test.first, &test.second].map(|model| side(&family.experiment, model));
                agree(Some(difference), estimate(&first, &second), "models");
                verdicts += usize::from(test.comparison.separated);
            }
        }
        for contrast in found.conditions.iter().filter(|it| it.metric == "TSA" && it.comparison.p.is_some()) {
            let [first, second] = [&contrast.baseline, &contrast.against].map(|it| side(it, &contrast.model));
            agree(contrast.comparison.difference, estimate(&first, &second), "conditions");
        }
        for row in found.overall.iter().filter(|row| row.metric == "TSA" && row.p.is_some()) {
            assert!(row.difference.unwrap() >= 0.0, "{row:?}");
            if row.method == OverallMethod::Units {
                let [first, second] = [&row.first, &row.second].map(|model| units(&rows, |it| it.1 == *model));
                agree(row.difference, estimate(&first, &second), "overall");
            }
        }
        gate_agrees(kind, &rows);
        sequential_agrees(kind, &rows);
    }
    assert!(verdicts > 40, "{verdicts} verdicts");
}

fn gate_agrees(kind: Kind, rows: &[Row]) {
    let of = |model: &str| -> Vec<Row<'static>> {
        let own = rows.iter().filter(|row| row.0 == "E1" && row.1 == model);
        own.map(|row| ("E1", "m", row.2, row.3, row.4, row.5)).collect()
    };
    let (base, new) = (of("a"), of("b"));
    let cell = kind.gate(&base, &new);
    let expected = estimate(&units(&new, |_| true), &units(&base, |_| true));
    agree(cell.difference, expected, "gate");
    assert!(cell.verdict != GateVerdict::Improved || expected > 0.0, "{cell:?}");
    assert!(cell.verdict != GateVerdict::Regressed || expected < 0.0, "{cell:?}");
    assert!(cell.verdict != GateVerdict::Held || expected > -0.1, "{cell:?}");
}

fn sequential_agrees(kind: Kind, rows: &[Row]) {
    let options = Options { design: kind.design(), ..Options::default() };
    let found = Sequential::from_table(&kind.table(rows), &options).unwrap();
    for row in &found.chance {
        let rate = row.successes as f64 / row.n as f64;
        assert!(row.verdict != Verdict::Above || rate > row.level.value(), "{row:?}");
        assert!(row.verdict != Verdict::Below || rate < row.level.value(), "{row:?}");
    }
    let only = |pair: &SequentialPair| pair.pairs.first_only.cmp(&pair.pairs.second_only);
    for pair in found.models.iter().filter(|pair| pair.verdict != Verdict::NotSeparated) {
        assert_eq!(only(pair).is_gt(), pair.verdict == Verdict::Above, "{pair:?}");
    }
}

/// Eight scenes: one model solves seven of them, once each, and fails one in 20 repeats; the other does the reverse.
fn turned() -> Vec<Row<'static>> {
    let repeats = |scene: i32| if scene == 7 { 20 } else { 1 };
    let of = |model, is_good: bool| {
        (0..8).flat_map(move |scene| {
            (0..repeats(scene)).map(move |run| ("E1", model, scene, run, (scene < 7) == is_good, 9))
        })
    };
    of("a", true).chain(of("b", false)).collect()
}

// 7/8 by scene and 7/27 by episode. scipy 1.17.1: binomtest(7, 8, 1/3).pvalue; enumeration of 2^8 signs: 2 * 9 / 256
#[test]
fn failed_scenes_that_are_repeated_do_not_turn_a_verdict() {
    let found = Kind::Scenes.statistics(&turned());
    let row = found.chance.iter().find(|row| row.key.model == "a" && row.metric == "TSA").unwrap();
    assert!((row.p - 17.0 / 6561.0).abs() < 1e-12, "{row:?}");
    assert_eq!((row.verdict, row.unit_mean, row.successes, row.n), (Verdict::Above, Some(0.875), 7, 27));
    let test = &found.models.iter().find(|family| family.metric == "TSA").unwrap().tests[0];
    assert_eq!((&*test.first, test.comparison.difference, test.comparison.p), ("a", Some(0.75), Some(18.0 / 256.0)));
    let answers: Vec<&str> = found.answers.iter().filter(|it| it.metric == "TSA").map(|it| &*it.answer).collect();
    assert!(answers[0].starts_with("E1 a (0.875 by scene, 7/27 by episode)"), "{answers:?}");
    assert!(!answers.iter().any(|answer| answer.contains("b better than a")), "{answers:?}");
    let cell = found.cells.iter().find(|cell| cell.metric == "TSA").unwrap();
    let Intervals::Rate { wilson: Some(wilson), clopper_pearson: None, jeffreys: None } = cell.intervals else {
        panic!("the interval of a repeated rate counts units: {cell:?}")
    };
    // statsmodels 0.15.0: proportion_confint(7, 8, method="wilson")
    assert!(
        (wilson.low - 0.529_111_817_787_146_4).abs() < 1e-12 && (wilson.high - 0.977_582_508_549_943_3).abs() < 1e-12,
        "{wilson:?}"
    );
}

#[test]
fn a_gate_names_both_counts_and_follows_the_scenes() {
    let of = |model: &str| -> Vec<Row<'static>> {
        let own = turned().into_iter().filter(|row| row.1 == model);
        own.map(|row| ("E1", "m", row.2, row.3, row.4, row.5)).collect()
    };
    let better = Kind::Scenes.gate(&of("b"), &of("a"));
    assert_eq!((better.difference, better.new.unit_mean, better.new.successes), (Some(0.75), Some(0.875), Some(7)));
    assert_ne!(better.verdict, GateVerdict::Regressed);
    let worse = Kind::Scenes.gate(&of("a"), &of("b"));
    assert_eq!(worse.difference, Some(-0.75));
    assert!(!matches!(worse.verdict, GateVerdict::Held | GateVerdict::Improved), "{worse:?}");
}

#[test]
fn too_few_units_give_no_verdict_and_advice_that_does_not_creep() {
    let of = |scenes: i32, solved: bool| -> Vec<Row<'static>> {
        (0..scenes).flat_map(|scene| (0..3).map(move |run| ("E1", "m", scene, run, solved, 9))).collect()
    };
    for scenes in 1..6 {
        let cell = Kind::Scenes.gate(&of(scenes, false), &of(scenes, true));
        assert_eq!((cell.verdict, cell.settled_by), (GateVerdict::CannotSay, Some(6)), "{cell:?}");
    }
    assert_eq!(Kind::Scenes.gate(&of(6, false), &of(6, true)).verdict, GateVerdict::Improved);
}

#[test]
fn a_person_against_software_is_not_held() {
    let base: Vec<Row> = (0..21).map(|at| ("E1", "m", 0, at, true, 9)).collect();
    let new: Vec<Row> = (0..21).map(|at| ("E1", "m", at, 0, true, 9)).collect();
    let (people, software) = (Kind::People.table(&base), super::table(&new));
    let options = GateOptions { metric: "TSA".to_owned(), margin: 0.3, confidence: 0.95, pool: false };
    let found = Gate::between([&people, &software], RECORDED, &options).unwrap();
    assert_eq!((found.verdict, found.cells[0].settled_by), (GateVerdict::CannotSay, None), "{:?}", found.cells);
    assert_eq!(found.cells[0].why, "21 episodes against 1 participant: no test compares them");
}

// MTATO is defined in 30 of 30 against 10 of 30 episodes.
#[test]
fn a_metric_of_those_who_succeeded_is_described_and_not_compared() {
    let of = |model, solved| (0..30).map(move |at| ("E1", model, at, 0, at < solved, 9));
    let rows: Vec<Row> = of("a", 30).chain(of("b", 10)).collect();
    let found = Kind::Scenes.statistics(&rows);
    let test = &found.models.iter().find(|family| family.metric == "MTATO").unwrap().tests[0].comparison;
    assert_eq!((test.p, test.separated), (None, false));
    assert_eq!(test.selected.as_deref().map(|it| it.contains("of 30")), Some(true), "{test:?}");
}

// 20:0, 0:20 and 20:0 of 20 pairs.
#[test]
fn opposite_effects_have_no_verdict_over_all_experiments() {
    let mut rows: Vec<Row> = Vec::new();
    for (experiment, better) in [("E1", "a"), ("E2", "b"), ("E5", "a")] {
        for model in ["a", "b"] {
            rows.extend((0..20).map(|at| (experiment, model, at, 0, model == better, 9)));
        }
    }
    let found = Kind::Scenes.statistics(&rows);
    let row = found.overall.iter().find(|row| row.metric == "TSA").unwrap();
    assert_eq!((row.separated, row.is_crossed, &*row.opposite), (false, true, &["E2".to_owned()][..]));
    let said =
        found.answers.iter().find(|it| it.answer.contains("over all experiments") && it.metric == "TSA").unwrap();
    assert!(
        said.answer
            .contains("over all experiments nobody (80 % power from 0.31), cannot say for a and b: opposite in E2"),
        "{said:?}"
    );
}

// 12 against 100 episodes of one law: 85 % end at 2 to 5, the others at 60 to 78. The small side has no late end.
#[test]
fn a_small_side_without_late_ends_is_no_difference() {
    let late = |at: i32| if at < 15 { 60 + i64::from(at) } else { 2 + i64::from(at % 4) };
    let a = (0..12).map(|at| ("E1", "a", at, 0, true, 2 + i64::from(at % 4)));
    let b = (0..100).map(|at| ("E1", "b", 1000 + at, 0, true, late(at)));
    let rows: Vec<Row> = a.chain(b).collect();
    let found = Kind::Scenes.statistics(&rows);
    let test = &found.models.iter().find(|family| family.metric == "TTD").unwrap().tests[0].comparison;
    assert!(!test.separated && test.p.unwrap() > 0.05 && test.p_error.is_some(), "{test:?}");
    assert!(test.interval.is_none_or(|interval| interval.contains(0.0)), "{test:?}");
}

// 6/6 and 24/60 against 54/60 and 0/6: better within each seed, worse without seeds.
#[test]
fn unevenly_shared_seeds_do_not_turn_a_verdict() {
    let of = |model, seed, solved: i32, n: i32| (0..n).map(move |run| ("E1", model, seed, run, run < solved, 9));
    let a = of("a", 0, 6, 6).chain(of("a", 1, 24, 60));
    let rows: Vec<Row> = a.chain(of("b", 0, 54, 60)).chain(of("b", 1, 0, 6)).collect();
    let table = labelled(&rows, "scene", |row| Some(format!("{} {} {}", row.1, row.2, row.3)));
    let options = Options { design: RECORDED, ..Options::default() };
    let found = Statistics::from_table(&table, &cells(&table), &options).unwrap();
    let test = &found.models.iter().find(|family| family.metric == "TSA").unwrap().tests[0].comparison;
    assert!(!test.separated && test.selected.is_some(), "{test:?}");
}

#[test]
fn below_chance_without_a_decision_is_said() {
    let rows: Vec<Row> = (0..21).map(|at| ("E1", "a", at, 0, false, -100)).collect();
    let found = Kind::Scenes.statistics(&rows);
    let said = found.answers.iter().find(|answer| answer.metric == "TSA").unwrap();
    assert_eq!(said.answer, "E1 nobody (below: a (no decision made in 21 of 21 episodes); 80 % power from 0.64)");
}

//! Durations are compared by restricted means. Intervals are given only where their coverage is as promised.

use mirrorstats_analysis::statistics::text::Length;
use mirrorstats_analysis::statistics::{Intervals, Options, Statistics};
use mirrorstats_statistics::intervals::coverage::{self, Withheld};
use mirrorstats_statistics::intervals::interval::Interval;

use super::{Row, block, cells, contrast, recorded, statistics, study, table};
use crate::html::scored::PAPER;

/// Python, from the episode table alone: Kaplan-Meier areas up to 100, variances of the infinitesimal jackknife
/// times 21/20, Satterthwaite's 33.934 degrees of freedom, scipy 1.17.1 t.ppf(0.975): 8.213235294117645, -22.61236597197034 to
/// 39.03883656020564; the plain means differ by 27.7.
#[test]
fn a_duration_is_contrasted_by_restricted_means() {
    let found = Statistics::from_table(&PAPER, &cells(&PAPER), &Options::default()).unwrap();
    let steps = &contrast(&found, "Gemma4 31B", "TTD", "E3").comparison;
    assert!((steps.difference.unwrap() - 8.213_235_294_117_645).abs() < 1e-9, "{steps:?}");
    let interval = steps.interval.unwrap();
    assert!(
        (interval.low + 22.612_365_971_970_34).abs() < 1e-9 && (interval.high - 39.038_836_560_205_64).abs() < 1e-9,
        "{interval:?}"
    );
}

/// Not finishing is not guessing: some verdicts of TSA against chance do not hold for finished episodes alone.
#[test]
fn chance_is_tested_among_finished_episodes_too() {
    let found = Statistics::from_table(&PAPER, &cells(&PAPER), &Options::default()).unwrap();
    let of = |metric: &'static str| {
        found.chance.iter().filter(move |row| row.metric == metric && row.key.experiment != "E5")
    };
    let changed = of("TSA").filter(|row| {
        let same =
            |other: &&mirrorstats_analysis::statistics::ChanceRow| (&other.key, other.level) == (&row.key, row.level);
        of("TSA-C").find(same).is_some_and(|other| other.verdict != row.verdict)
    });
    assert_eq!((of("TSA").count(), changed.count()), (32, 5));
    let text = found.render(&["TSA".to_owned()], Length::Tables, None);
    assert!(text.contains("TSA     chance 1/3") && text.contains("TSA-C   chance 1/3"), "{text}");
}

/// An episode with a decision is earlier than one without; ties count half.
#[test]
fn improvement_counts_decided_and_undecided_episodes() {
    let table = table(&study());
    let options = Options { improvements: true, ..Options::default() };
    let found = Statistics::from_table(&table, &cells(&table), &options).unwrap();
    let row = found.improvements.iter().find(|row| (&*row.first, &*row.second) == ("strong", "weak")).unwrap();
    // E1: always earlier. E2: 7 of 21 at step 20 against 5 of 21 at step 60: 7/21 + 14/21 * 16/21 / 2
    let expected = (1.0 + 7.0 / 21.0 + 14.0 / 21.0 * 16.0 / 21.0 / 2.0) / 2.0;
    assert!((row.improvement.probability - expected).abs() < 1e-12, "{row:?}");
    assert!(statistics(&study()).improvements.is_empty(), "only where they are asked for");
}

#[test]
fn a_difference_that_cannot_be_detected_is_untestable() {
    let rows: Vec<Row> = (0..3).flat_map(|run| [("E1", "a", 0, run, true, 9), ("E1", "b", 0, run, false, 9)]).collect();
    let said =
        |found: &Statistics| found.conclusions.iter().find(|line| line.contains("cannot show any difference")).cloned();
    assert!(said(&recorded(&rows)).unwrap().contains("3 pairs cannot show any difference between two models"));
    assert!(said(&statistics(&rows)).unwrap().contains("3 episodes per model cannot show any difference"));
}

/// Intervals with less than 90 % simulated coverage are withheld. The others have a width and stay within the budget.
#[test]
fn intervals_cover_as_promised_or_give_a_reason() {
    let two = statistics(&[("E1", "a", 0, 0, true, 10), ("E1", "a", 0, 1, true, 20)]);
    let Intervals::Quantity { student_t: None, student_t_withheld, bootstrap: None, bootstrap_withheld } =
        two.cells[1].intervals
    else {
        panic!("two values have no interval: {:?}", two.cells[1])
    };
    assert!(matches!(student_t_withheld, Some(Withheld::TooFew { fewest: 12 })), "{student_t_withheld:?}");
    assert!(matches!(bootstrap_withheld, Some(Withheld::TooFew { .. })), "{bootstrap_withheld:?}");
    let found = recorded(&study());
    let in_budget = |interval: Interval| 0.0 <= interval.low && interval.high <= 100.0;
    for cell in found.cells.iter().filter(|cell| cell.metric == "TTD") {
        let Intervals::Quantity { student_t, student_t_withheld, .. } = cell.intervals else { panic!("steps") };
        assert!(student_t.is_none_or(in_budget), "{cell:?}");
        assert_eq!(student_t.is_none(), student_t_withheld.is_some(), "{cell:?}");
    }
    assert!(found.clusters.iter().filter_map(|row| row.by_seed?.design_effect).all(|effect| effect > 0.0));
    let json = serde_json::to_value(&found).unwrap();
    assert_eq!(points(&json), Vec::<String>::new());
}

/// The limits come from the simulation: the smallest n from which no scenario has less than 90 % coverage.
#[test]
fn the_limits_follow_from_the_simulated_coverage() {
    let simulated = include_str!("../../../benches/COVERAGE-INTERVALS.md");
    for (method, limit) in [
        ("Student's t of the mean", coverage::STUDENT),
        ("BCa bootstrap of the mean", coverage::BOOTSTRAP),
        ("restricted mean", coverage::RESTRICTED_MEAN),
        ("restricted mean to a correct decision", coverage::RESTRICTED_MEAN),
        ("median (Brookmeyer and Crowley)", coverage::MEDIAN),
        ("difference of restricted means, alike", coverage::DIFFERENCE),
        ("difference of restricted means, unlike", coverage::DIFFERENCE),
        ("difference of restricted means, pairs", coverage::DIFFERENCE),
        ("Welch's t, alike", coverage::WELCH),
        ("Welch's t, unlike", coverage::WELCH),
        ("steps, t(clusters - 1)", coverage::CLUSTERS),
        ("a rate, t(clusters - 1)", coverage::CLUSTERS),
        ("shared units, alike", coverage::UNITS),
        ("shared units, unlike", coverage::UNITS),
        ("units of one side, alike", coverage::UNITS),
        ("units of one side, n against 4 n, unlike", coverage::UNITS),
        ("half of them shared, unlike", coverage::UNITS),
    ] {
        let row = format!("| {method} | ");
        let at = simulated.find(&row).unwrap_or_else(|| panic!("no row of {method}"));
        let header = simulated[..at].rfind("| method | ").expect("a header");
        let cells = |line: usize| simulated[line..].lines().next().unwrap().split(" | ").skip(1).collect::<Vec<_>>();
        for (n, held) in cells(header).into_iter().zip(cells(at)) {
            let (Ok(n), Ok(held)) = (n.parse::<u64>(), held.parse::<f64>()) else { continue };
            assert!(n < limit || held >= 0.9, "{method}: {held} at {n}, given from {limit} on");
        }
    }
}

/// The intervals in a JSON value that have no width.
fn points(value: &serde_json::Value) -> Vec<String> {
    match value {
        serde_json::Value::Object(object) => {
            let bound = |name: &str| object.get(name).and_then(serde_json::Value::as_f64);
            let is_point = bound("low").zip(bound("high")).is_some_and(|(low, high)| low >= high);
            let own = is_point.then(|| value.to_string());
            own.into_iter().chain(object.values().flat_map(points)).collect()
        }
        serde_json::Value::Array(values) => values.iter().flat_map(points).collect(),
        _ => Vec::new(),
    }
}

#[test]
fn the_dagger_is_explained_only_where_it_is_used() {
    let found = statistics(&[block("E1", "a", 4, 9), block("E1", "b", 0, 9)].concat());
    let with = found.render(&["MTATO".to_owned()], Length::Tables, None);
    assert!(with.contains('†') && with.contains("† fewer than 5 defined episodes"), "{with}");
    let without = found.render(&["TTD".to_owned()], Length::Full, None);
    assert!(!without.contains('†') && !without.contains("dagger"), "{without}");
}

#[test]
fn a_wrong_decision_competes_with_a_correct_one() {
    // Ten correct at step 10, ten wrong at step 20, one unfinished.
    let row = |at: i32| {
        (
            "E1",
            "a",
            at / 7,
            at % 7,
            at < 10,
            if at < 10 {
                10
            } else if at < 20 {
                20
            } else {
                -100
            },
        )
    };
    let found = statistics(&(0..21).map(row).collect::<Vec<_>>());
    let correct = found.durations[0].correct.as_ref().unwrap();
    assert!((correct.correct - 10.0 / 21.0).abs() < 1e-12 && (correct.wrong - 10.0 / 21.0).abs() < 1e-12);
    assert!((correct.restricted.mean - (10.0 * 10.0 + 11.0 * 100.0) / 21.0).abs() < 1e-9);
    assert_eq!((correct.median, found.durations[0].median), (None, Some(20)));
}

#[test]
fn unfinished_episodes_are_censored_and_models_share_a_horizon() {
    let found = statistics(&study());
    let row =
        |model: &str| found.durations.iter().find(|row| row.key.experiment == "E1" && row.key.model == model).unwrap();
    assert_eq!((row("strong").median, row("strong").finished), (Some(12), 21));
    assert_eq!((row("middle").median, row("weak").median), (Some(30), None));
    assert_eq!(row("weak").restricted.unwrap().horizon, 100);
    let weak = (5.0 * 60.0 + 16.0 * 100.0) / 21.0;
    assert!((row("weak").restricted.unwrap().mean - weak).abs() < 1e-12);
    assert!(
        found.conclusions.iter().any(|line| line.starts_with("TTD: 80 of 147 episodes never finished")),
        "{:?}",
        found.conclusions
    );
}

//! No difference shown is not equality: what would have been shown, margins, intervals by unit, and one screen of it.

use mirrorstats_analysis::gate::{Gate, GateOptions};
use mirrorstats_analysis::statistics::text::Length;
use mirrorstats_analysis::statistics::{Comparison, Options, Statistics};
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_statistics::design::{Design, DesignKind};

use super::{RECORDED, Row, by_place, cells, labelled, with_scenes};
use crate::html::scored::PAPER;

fn answers(found: &Statistics) -> Vec<String> {
    found.answers.iter().map(|it| format!("{} {}: {}", it.question, it.metric, it.answer)).collect()
}

fn of_paper() -> Statistics {
    Statistics::from_table(&PAPER, &cells(&PAPER), &Options::default()).unwrap()
}

/// Models that solve the first of 21 scenes each, as many as given.
fn solving(solved: &[(&'static str, i32)]) -> Vec<Row<'static>> {
    let of = |(model, solved): (&'static str, i32)| (0..21).map(move |at| ("E1", model, at, 0, at < solved, 9));
    solved.iter().flat_map(|&it| of(it)).collect()
}

#[expect(clippy::unnecessary_wraps, reason = "a label may be null, and others are")]
fn by_scene(row: &Row) -> Option<String> {
    Some(row.2.to_string())
}

/// scipy 1.17.1: brentq over the power of binomtest(k, 21, 1/3).pvalue <= 0.05 / 8, by enumeration: 0.72385.
#[test]
fn nobody_above_chance_says_what_would_have_been() {
    let found = with_scenes(&solving(&["a", "b", "c", "d", "e", "f", "g", "h"].map(|it| (it, 8))), RECORDED, by_scene);
    assert_eq!(answers(&found)[0], "Who is above chance? TSA: E1 nobody (80 % power from 0.72)");
    assert_eq!(answers(&found)[1], "Who is above chance? TSA-C: E1 as TSA");
}

/// Python, from the widest interval (-22.61236597197034 to 39.03883656020564) at the first of 8 steps, with scipy 1.17.1:
/// (norm.isf(0.05 / 16) + norm.isf(0.2)) * 61.65120253217598 / (2 * norm.isf(0.025)) = 56.24187146335174.
#[test]
fn every_answer_without_a_difference_says_what_would_have_been_shown() {
    let found = answers(&of_paper());
    let steps = found.iter().find(|it| it.starts_with("What does the mirror change? TTD")).unwrap();
    assert!(steps.contains("E1 - E3 no change shown (80 % power from 56.24)"), "{steps}");
    for answer in &found {
        for silent in ["nobody", "no change shown"] {
            for (at, _) in answer.match_indices(silent) {
                let rest = answer[at..].split(';').take(2).collect::<String>();
                assert!(rest.contains("80 % power f"), "{answer}");
            }
        }
    }
}

/// The margin of `stats` is that of `gate` in both directions: its p value is the larger of both.
#[test]
fn equivalence_is_the_verdict_of_the_gate_in_both_directions() {
    for solved in [[21, 21], [20, 19], [12, 10], [15, 5]] {
        let of = |model, count| labelled(&solving(&[(model, count)]), "scene", by_scene);
        let sides: [EpisodeTable; 2] = [of("a", solved[0]), of("a", solved[1])];
        let gate = |[base, new]: [usize; 2]| {
            let options = GateOptions { metric: "TSA".to_owned(), margin: 0.2, confidence: 0.95, pool: false };
            let found = Gate::between([&sides[base], &sides[new]], RECORDED, &options).unwrap();
            serde_json::to_value(&found.cells[0]).unwrap()["p_held"].as_f64().unwrap()
        };
        let table = labelled(&solving(&[("a", solved[0]), ("b", solved[1])]), "scene", by_scene);
        let options = Options { design: RECORDED, margin: Some(0.2), ..Options::default() };
        let found = Statistics::from_table(&table, &cells(&table), &options).unwrap();
        let test = found.models.iter().find(|it| it.metric == "TSA").unwrap().tests[0].comparison.clone();
        let equivalence = test.equivalence.unwrap();
        assert!((equivalence.p_adjusted - gate([0, 1]).max(gate([1, 0]))).abs() < 1e-12, "{solved:?} {equivalence:?}");
        assert_eq!(equivalence.is_shown, equivalence.p_adjusted <= 0.05);
        let answer = &answers(&found)[2];
        assert_eq!(answer.contains("within 0.2: a and b"), equivalence.is_shown, "{answer}");
        // A margin below 1 is none of steps.
        assert!(
            found.models.iter().filter(|it| it.metric == "TTD").all(|it| it.tests[0].comparison.equivalence.is_none())
        );
    }
}

/// Steps 9 and 10 in turns: within 3 steps of each other. A margin of 0.9 is one of rates.
#[test]
fn durations_have_a_margin_in_steps() {
    let rows: Vec<Row> = ["a", "b"]
        .into_iter()
        .flat_map(|model| {
            (0..21).map(move |at| ("E1", model, at, 0, true, 9 + i64::from((at + i32::from(model == "a")) % 2)))
        })
        .collect();
    let table = labelled(&rows, "scene", by_scene);
    let within = |margin| {
        let options = Options { design: RECORDED, margin: Some(margin), ..Options::default() };
        let found = Statistics::from_table(&table, &cells(&table), &options).unwrap();
        let family = found.models.iter().find(|it| it.metric == "TTD").unwrap();
        family.tests[0].comparison.equivalence.map(|it| it.is_shown)
    };
    assert_eq!([within(3.0), within(0.9)], [Some(true), None]);
}

fn of_tsa(rows: &[Row]) -> Comparison {
    let found = with_scenes(rows, RECORDED, by_scene);
    found.models.iter().find(|it| it.metric == "TSA").unwrap().tests[0].comparison.clone()
}

/// Two episodes per scene. scipy 1.17.1: brentq over the score statistic of 4.5 gains in 8 shared scenes.
#[test]
fn a_difference_of_repeated_scenes_has_an_interval() {
    let solved = |model: &str, scene: i32| match model {
        "a" => {
            if scene < 5 {
                2
            } else {
                1
            }
        }
        _ => [1, 1, 0, 0, 1, 1, 0, 0][usize::try_from(scene).unwrap()],
    };
    let rows: Vec<Row> = ["a", "b"]
        .into_iter()
        .flat_map(|model| (0..16).map(move |at| ("E1", model, at / 2, at % 2, at % 2 < solved(model, at / 2), 9)))
        .collect();
    let found = of_tsa(&rows);
    let interval = found.interval.unwrap();
    assert!((interval.low - 0.055_613_179_867_366_636).abs() < 1e-7, "{interval:?}");
    assert!((interval.high - 0.825_501_368_761_657_4).abs() < 1e-7, "{interval:?}");
    assert_eq!((found.withheld, found.simultaneous), (None, found.interval), "a family of one test");
    let few = of_tsa(&rows.into_iter().filter(|row| row.2 < 5).collect::<Vec<_>>());
    assert!(few.interval.is_none() && few.withheld.is_some(), "{few:?}");
}

/// Of three tests, each interval is at 1 - 0.05 / 3 (Bonferroni): scipy 1.17.1 as above, with norm.isf(0.025 / 3).
#[test]
fn simultaneous_intervals_share_the_level() {
    let solved = |model: &str, scene: i32| match model {
        "a" => {
            if scene < 5 {
                2
            } else {
                1
            }
        }
        _ => [1, 1, 0, 0, 1, 1, 0, 0][usize::try_from(scene).unwrap()],
    };
    let rows: Vec<Row> = ["a", "b", "c"]
        .into_iter()
        .flat_map(|model| (0..16).map(move |at| ("E1", model, at / 2, at % 2, at % 2 < solved(model, at / 2), 9)))
        .collect();
    let interval = of_tsa(&rows).simultaneous.unwrap();
    assert!((interval.low + 0.089_660_385_474_665_08).abs() < 1e-7, "{interval:?}");
    assert!((interval.high - 0.857_965_698_833_955_1).abs() < 1e-7, "{interval:?}");
}

#[test]
fn eight_models_in_five_experiments_are_one_screen() {
    let lines = |found: &Statistics, width| found.render(&found.headline, Length::Screen, width).lines().count();
    let design = Design { kind: Some(DesignKind::Reconstruction), cluster: None };
    let options = Options { design, ..Options::default() };
    let paper = Statistics::from_table(&PAPER, &cells(&PAPER), &options).unwrap();
    for width in [Some(80), Some(100), None] {
        assert!(lines(&paper, width) <= 60, "{}", paper.render(&paper.headline, Length::Screen, width));
    }
    let models: Vec<String> = (0..40).map(|at| format!("model {at}")).collect();
    let of = |count: usize| -> Vec<Row> {
        let cell = |experiment: &'static str, at: usize| {
            let (model, at) = (models[at].as_str(), i32::try_from(at).unwrap());
            (0..21).map(move |run| {
                (experiment, model, run / 7, run % 7, (run * 7 + at * 5) % 21 < at / 3 + 6, 9 + i64::from(run))
            })
        };
        ["E1", "E2", "E3", "E4", "E5"]
            .into_iter()
            .flat_map(|experiment| (0..count).flat_map(move |at| cell(experiment, at)))
            .collect()
    };
    for (count, most) in [(8, 60), (40, 100)] {
        let found = with_scenes(&of(count), RECORDED, by_place);
        let text = found.render(&found.headline, Length::Screen, Some(80));
        assert!(text.lines().count() <= most, "{} lines\n{text}", text.lines().count());
    }
}

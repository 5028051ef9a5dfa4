//! The definitions `reach` on series of distances, compared with the protocol's formulas in integers, on every engine.

use std::fs;
use std::path::Path;

use mirrorstats_metric::definitions::Definitions;
use mirrorstats_score::vocabulary::trace_columns;
use mirrorstats_trace::episodes::episode::{Action, Episode, Extra, Step};
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::write::write_episodes;
use proptest::collection::vec;
use proptest::option;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::{RngAlgorithm, TestRng, TestRunner};

use crate::harness::traces;
use crate::metamorphic::engines::{Engine, Rows, answers_about};

const METRICS: [&str; 5] = ["SUCCESS", "SIR", "FCR", "PCR", "UNREADABLE"];

/// The start distance; then for each step the distance, and true if the answer was readable; in mm.
type Series = (i32, Vec<(i32, bool)>);

fn episode(id: usize, (start, steps): &Series) -> Episode {
    let step = |&(distance, is_readable): &(i32, bool)| Step {
        action: is_readable.then_some(Action::MoveForward),
        extra: Extra { target_distance: Some(distance), ..Extra::default() },
        ..Step::default()
    };
    let steps = steps.iter().map(step).collect();
    Episode {
        experiment: "any name".into(),
        start_distance: Some(*start),
        ..traces::episode(&format!("e{id:03}"), steps)
    }
}

/// Parts per million of a fraction, rounded half up.
fn ppm(part: i64, whole: i64) -> i64 {
    (2_000_000 * part + whole).div_euclid(2 * whole)
}

/// The protocol's formulas; d is the series including the start.
fn by_formula((start, steps): &Series) -> Vec<Option<i64>> {
    let d: Vec<i64> = std::iter::once(*start).chain(steps.iter().map(|step| step.0)).map(i64::from).collect();
    let steps_count = i64::try_from(steps.len()).unwrap();
    let improved = d.windows(2).filter(|pair| pair[1] < pair[0]).count();
    let completion = |distance: i64| (d[0] > 100).then(|| ppm(d[0] - distance, d[0] - 100));
    vec![
        Some(i64::from(d[1..].iter().any(|distance| *distance <= 100))),
        Some(ppm(i64::try_from(improved).unwrap(), steps_count)),
        completion(*d.last().unwrap()),
        completion(*d.iter().min().unwrap()),
        Some(i64::try_from(steps.iter().filter(|step| !step.1).count()).unwrap()),
    ]
}

/// Cases worked out by hand, then random ones. An unreadable answer repeats the previous distance.
fn cases() -> Vec<Series> {
    let readable = |distances: &[i32]| distances.iter().map(|distance| (*distance, true)).collect::<Vec<_>>();
    let mut cases = vec![
        (500, readable(&[400, 300, 200, 100])),
        (500, readable(&[600, 700])),
        (400, vec![(400, false), (300, true), (300, false), (400, true)]),
        (100, readable(&[200])),
        (0, readable(&[0])),
        (700, readable(&[600, 700, 600, 500, 500, 600, 600])),
    ];
    let mut runner =
        TestRunner::new_with_rng(ProptestConfig::default(), TestRng::deterministic_rng(RngAlgorithm::ChaCha));
    let drawn = (0..25_i32, vec(option::weighted(0.8, -2..=2_i32), 1..30));
    for _ in 0..60 {
        let (start, moves) = drawn.new_tree(&mut runner).unwrap().current();
        let mut distance = start * 100;
        let step = |moved: &Option<i32>| {
            distance = (distance + 100 * moved.unwrap_or(0)).max(0);
            (distance, moved.is_some())
        };
        let steps = moves.iter().map(step).collect();
        cases.push((start * 100, steps));
    }
    cases
}

/// Writes two files and loads the definitions for them.
fn written(folder: &Path, name: &str, episodes: &[Episode]) -> (TraceSet, Definitions) {
    fs::create_dir(folder.join("traces")).unwrap();
    let (first, second) = episodes.split_at(episodes.len() / 2);
    let inputs = [("a.parquet", first), ("b.parquet", second)].map(|(name, episodes)| {
        let path = folder.join("traces").join(name);
        write_episodes(&path, None, episodes).unwrap();
        Input::new(path)
    });
    let traces = TraceSet::open(&inputs).unwrap();
    let definitions = Definitions::load(name, &trace_columns(&traces)).unwrap();
    (traces, definitions)
}

fn check(engine: Engine) {
    let cases = cases();
    let folder = tempfile::tempdir().unwrap();
    let episodes: Vec<Episode> = cases.iter().enumerate().map(|(id, series)| episode(id, series)).collect();
    let (traces, definitions) = written(folder.path(), "reach", &episodes);
    let Rows { names, values } = answers_about(engine, folder.path(), traces, definitions).unwrap();
    assert_eq!(names, METRICS);
    assert_eq!(values.len(), cases.len());
    for (found, series) in values.values().zip(&cases) {
        assert_eq!(*found, by_formula(series), "{engine:?}: {series:?}");
    }
}

#[test]
fn a_series_matches_worked_examples() {
    let cases = cases();
    let expected = [
        // Each of four steps is nearer, and all of the 400 mm are covered.
        [Some(1), Some(1_000_000), Some(1_000_000), Some(1_000_000), Some(0)],
        // 200 mm further away out of 400 mm: minus one half.
        [Some(0), Some(0), Some(-500_000), Some(0), Some(0)],
        // One step of four is nearer; back at the start; at best a third of the 300 mm.
        [Some(0), Some(250_000), Some(0), Some(333_333), Some(2)],
        // The start is already at the target.
        [Some(0), Some(0), None, None, Some(0)],
        [Some(1), Some(0), None, None, Some(0)],
        // Three of seven steps are nearer; a sixth of 600 mm, at best two sixths.
        [Some(0), Some(428_571), Some(166_667), Some(333_333), Some(0)],
    ];
    for (series, expected) in cases.iter().zip(expected) {
        assert_eq!(by_formula(series), expected, "{series:?}");
    }
}

#[test]
fn native_agrees_with_the_formulas() {
    check(Engine::Native);
}

#[test]
fn duckdb_agrees_with_the_formulas() {
    check(Engine::Duckdb);
}

#[test]
fn spark_agrees_with_the_formulas() {
    check(Engine::Spark);
}

/// Answers; true if they were read; true if a parser that falls back on the last number reads them.
const ANSWERS: [(Option<&str>, bool, bool); 10] = [
    (Some("I would go up, so 1."), false, true),
    (Some("10 cm to the left, then\n4\n"), false, true),
    (Some("between 3 and 12"), false, false),
    (Some("7"), false, false),
    (Some("move the hand"), false, false),
    (Some(""), false, false),
    (None, false, false),
    (Some("0.5"), false, true),
    (Some("1 2 30"), false, false),
    (Some("{\"action\": \"3\"}"), true, false),
];

fn answers(id: usize, of: &[(Option<&str>, bool, bool)]) -> Episode {
    let mut episode = episode(id, &(900, of.iter().map(|(_, is_read, _)| (900, *is_read)).collect()));
    for (step, (reply, ..)) in episode.steps.iter_mut().zip(of) {
        step.extra.reply = reply.map(str::to_owned);
    }
    episode
}

/// One episode per answer, and one with all answers.
fn check_fallback(engine: Engine) {
    let alone = ANSWERS.iter().enumerate().map(|(id, one)| answers(id, std::slice::from_ref(one)));
    let episodes: Vec<Episode> = alone.chain([answers(ANSWERS.len(), &ANSWERS)]).collect();
    let folder = tempfile::tempdir().unwrap();
    let (traces, definitions) = written(folder.path(), "reach-fallback", &episodes);
    let Rows { names, values } = answers_about(engine, folder.path(), traces, definitions).unwrap();
    let at = |name: &str| names.iter().position(|other| other == name).unwrap();
    let found: Vec<[Option<i64>; 3]> = values
        .values()
        .map(|row| ["LAST_NUMBER", "FALLBACK_VERDICT", "UNREADABLE"].map(|name| row[at(name)]))
        .collect();
    for (row, (reply, is_read, hangs)) in found.iter().zip(&ANSWERS) {
        let expected = [i64::from(*hangs), i64::from(*hangs), i64::from(!is_read)].map(Some);
        assert_eq!(*row, expected, "{engine:?}: {reply:?}");
    }
    assert_eq!(found[ANSWERS.len()], [Some(3), Some(1), Some(9)], "{engine:?}");
}

#[test]
fn the_last_number_counts_only_in_answers_that_were_not_read() {
    check_fallback(Engine::Native);
}

#[test]
fn duckdb_parses_the_same_last_numbers() {
    check_fallback(Engine::Duckdb);
}

#[test]
fn spark_parses_the_same_last_numbers() {
    check_fallback(Engine::Spark);
}

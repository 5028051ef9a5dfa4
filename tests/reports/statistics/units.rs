//! Scenes, seeds or participants with several episodes count once each.

use mirrorstats_analysis::statistics::text::Length;
use mirrorstats_analysis::statistics::{Method, Options, OverallMethod, Statistics, Verdict};

use super::{CLUSTERED, RECORDED, Row, by_place, cells, labelled, with_scenes};

/// Two models: one solves every episode, the other solves none. Each scene has `repeats` episodes.
fn opposed(scenes: i32, repeats: i32) -> Vec<Row<'static>> {
    let of = |model, solved| {
        (0..scenes).flat_map(move |scene| (0..repeats).map(move |run| ("E1", model, scene, run, solved, 9)))
    };
    of("oracle", true).chain(of("random", false)).collect()
}

#[expect(clippy::unnecessary_wraps, reason = "a label may be null, and others are")]
fn by_scene(row: &Row) -> Option<String> {
    Some(row.2.to_string())
}

fn is_silent(found: &Statistics, units: &str) -> bool {
    found.chance.iter().filter(|row| row.metric == "TSA").all(|row| row.verdict == Verdict::NotSeparated)
        && found.models.iter().flat_map(|family| &family.tests).all(|test| !test.comparison.separated)
        && found.answers.iter().any(|answer| answer.answer == format!("E1 cannot say: {units}"))
}

#[test]
fn three_scenes_give_no_verdict_at_any_number_of_repeats() {
    for repeats in [3, 7] {
        let found = with_scenes(&opposed(3, repeats), RECORDED, by_scene);
        assert!(is_silent(&found, "3 scenes"), "{:?}", found.answers);
    }
}

// scipy 1.17.1: binomtest(7, 7, 1/3).pvalue; enumeration of 2^7 signs: 2/128
#[test]
fn seven_scenes_count_as_seven() {
    let found = with_scenes(&opposed(7, 3), RECORDED, by_scene);
    let row = found.chance.iter().find(|row| row.key.model == "oracle" && row.metric == "TSA").unwrap();
    assert!((row.p - 1.0 / 2187.0).abs() < 1e-12, "{row:?}");
    assert_eq!((row.units.as_ref().unwrap().n, row.verdict), (7, Verdict::Above));
    let test = &found.models[0].tests[0].comparison;
    assert_eq!((test.method, test.p, test.separated), (Method::Units, Some(2.0 / 128.0), true));
}

#[test]
fn declared_seeds_are_the_unit_of_every_test() {
    let three = with_scenes(&opposed(3, 7), CLUSTERED, by_place);
    assert!(is_silent(&three, "3 seeds"), "{:?}", three.answers);
    let one = with_scenes(&opposed(1, 21), CLUSTERED, by_place);
    assert!(is_silent(&one, "1 seed"), "{:?}", one.answers);
    let undeclared = with_scenes(&opposed(3, 7), RECORDED, by_place);
    assert!(undeclared.models[0].tests[0].comparison.separated, "21 scenes of three seeds are 21");
}

#[test]
fn episodes_of_one_participant_count_as_one() {
    let table = labelled(&opposed(3, 7), "participant", |row| Some(row.1.to_owned()));
    let options = Options { design: RECORDED, ..Options::default() };
    let found = Statistics::from_table(&table, &cells(&table), &options).unwrap();
    assert!(found.answers.iter().any(|answer| answer.answer == "E1 cannot say: 1 participant"), "{:?}", found.answers);
    assert!(found.chance.iter().all(|row| row.verdict == Verdict::NotSeparated));
}

/// Eight people and a model on four scenes.
#[test]
fn people_on_shared_scenes_count_by_participant() {
    let people = (0..8).flat_map(|person| (0..4).map(move |scene| ("E1", "people", scene, person, person < 4, 9)));
    let rows: Vec<Row> = people.chain((0..4).map(|scene| ("E1", "model", scene, 0, true, 9))).collect();
    let mut table = labelled(&rows, "scene", by_scene);
    let person = |row: &Row| (row.1 == "people").then(|| format!("P{}", row.3));
    table
        .labels
        .extend(labelled(&rows, "participant", person).labels.into_iter().filter(|label| label.name == "participant"));
    let options = Options { design: RECORDED, ..Options::default() };
    let found = Statistics::from_table(&table, &cells(&table), &options).unwrap();
    assert!(found.retests.is_empty(), "{:?}", found.retests);
    let row = found.chance.iter().find(|row| row.key.model == "people" && row.metric == "TSA").unwrap();
    assert_eq!(row.units.as_ref().map(|units| (units.n, units.name.as_str())), Some((8, "participants")));
    let test = &found.models[0].tests[0].comparison;
    let units = test.units.as_ref().map(|units| (units.n, units.name.as_str()));
    assert_eq!((units, test.p, test.separated), (Some((4, "scenes against 8 participants")), None, false));
}

// Five scenes 4:0 and one 0:4 over four experiments. scipy 1.17.1: binomtest(1, 6).pvalue
#[test]
fn a_scene_of_four_experiments_counts_once() {
    let mut rows: Vec<Row> = Vec::new();
    for experiment in ["E1", "E2", "E3", "E4"] {
        for scene in 0..6 {
            rows.push((experiment, "a", scene, 0, scene < 5, 9));
            rows.push((experiment, "b", scene, 0, scene == 5, 9));
        }
    }
    let found = with_scenes(&rows, RECORDED, by_scene);
    let row = found.overall.iter().find(|row| row.metric == "TSA").unwrap();
    assert_eq!((row.method, row.p, row.separated), (OverallMethod::Units, Some(0.21875), false));
}

// Six pairs: the least p of McNemar's test is 1/32, above 0.05 / 10. Five models against 1/3: 1/3^6 is below 0.05 / 5.
#[test]
fn an_untestable_family_differs_from_one_without_a_difference() {
    let rows: Vec<Row> = ["a", "b", "c", "d", "e"]
        .into_iter()
        .flat_map(|model| (0..6).map(move |scene| ("E1", model, scene, 0, model < "c", 9)))
        .collect();
    let found = with_scenes(&rows, RECORDED, by_scene);
    let answers: Vec<&str> = found.answers.iter().filter(|it| it.metric == "TSA").map(|it| &*it.answer).collect();
    assert_eq!(answers, ["E1 a, b", "E1 cannot say: 6 pairs for 10 comparisons"]);
}

/// 3 scenes of one model against 40 of another, 3 of them shared.
#[test]
fn the_smaller_side_is_named() {
    let of = |model, scenes: i32, solved| (0..scenes).map(move |scene| ("E1", model, scene, 0, solved, 9));
    let rows: Vec<Row> = of("a", 3, true).chain(of("b", 40, false)).collect();
    let found = with_scenes(&rows, RECORDED, by_scene);
    assert!(found.answers.iter().any(|it| it.answer == "E1 cannot say: 3 scenes"), "{:?}", found.answers);
}

// 11 pairs 11:0, else 1 of 11 against 11 of 11.
#[test]
fn half_of_the_episodes_in_pairs_do_not_hide_the_other_half() {
    let a = (0..22).map(|at| ("E1", "a", at, 0, at <= 11, 9));
    let b = (0..22).map(|at| ("E1", "b", at, 0, at >= 11, 9));
    let rows: Vec<Row> = a.chain(b).collect();
    let scene = |row: &Row| Some(if row.2 < 11 { row.2.to_string() } else { format!("{} {}", row.1, row.2) });
    let found = with_scenes(&rows, RECORDED, scene);
    let test = &found.models[0].tests[0].comparison;
    assert_eq!((test.method, test.n, test.separated), (Method::Units, [22, 22], false));
    assert!((test.difference.unwrap() - 1.0 / 22.0).abs() < 1e-12 && test.p.unwrap() > 0.7, "{test:?}");
}

// Two pairs: the least p of McNemar's test is 1/2. Two episodes against 1/3: the least p of the binomial test is 1/9.
#[test]
fn too_few_episodes_differ_from_no_difference() {
    let rows = |n: i32| {
        let of = |model, solved| (0..n).map(move |at| ("E1", model, at, 0, solved, 9));
        of("a", true).chain(of("b", true)).collect::<Vec<Row>>()
    };
    let answers = |n: i32| {
        let found = with_scenes(&rows(n), RECORDED, by_scene);
        found.answers.iter().filter(|it| it.metric == "TSA").map(|it| it.answer.clone()).collect::<Vec<_>>()
    };
    assert_eq!(answers(2), ["E1 cannot say: 2 episodes", "E1 cannot say: 2 pairs"]);
    assert_eq!(answers(5)[1], "E1 cannot say: 5 pairs");
    assert_eq!(answers(6), ["E1 all 2", "E1 nobody (80 % power from 0.96)"]);
    assert_eq!(answers(5)[0], "E1 cannot say: 5 episodes");
}

// 6 episodes against 1/3: the least p is 1/729, above 0.05 / 37.
#[test]
fn too_few_episodes_for_many_models_are_reported() {
    let models: Vec<String> = (0..37).map(|at| format!("m{at}")).collect();
    let rows: Vec<Row> =
        models.iter().flat_map(|model| (0..6).map(move |at| ("E1", model.as_str(), at, 0, true, 9))).collect();
    let found = with_scenes(&rows, RECORDED, by_scene);
    let told = found.answers.iter().find(|it| it.metric == "TSA").unwrap();
    assert_eq!(told.answer, "E1 cannot say: 6 episodes for 37 models");
}

// 2 of 2 against 1/10: p is 1/100, but two episodes are too few, as elsewhere.
#[test]
fn two_episodes_give_no_verdict_at_any_level() {
    let rows: Vec<Row> = (0..2).map(|at| ("E5", "a", at, 0, true, 9)).collect();
    let found = with_scenes(&rows, RECORDED, by_scene);
    let row = found.chance.iter().find(|row| row.metric == "TSA").unwrap();
    assert!((row.p - 0.01).abs() < 1e-12 && row.verdict == Verdict::NotSeparated, "{row:?}");
    let told = found.answers.iter().find(|it| it.metric == "TSA").unwrap();
    assert_eq!(told.answer, "E5 (reference 1/10) cannot say: 2 episodes");
}

/// Two models with two episodes per scene; the slower one is fast in scene 0.
fn timed(scenes: i32) -> Vec<Row<'static>> {
    let of = |model, base: i64| {
        let steps = move |scene: i32, run: i32| base + i64::from(scene % 3) + i64::from(run);
        (0..scenes).flat_map(move |scene| (0..2).map(move |run| ("E1", model, scene, run, true, steps(scene, run))))
    };
    let slow = of("slow", 20).map(|row| if row.2 == 0 { (row.0, row.1, row.2, row.3, row.4, 12) } else { row });
    of("fast", 9).chain(slow).collect()
}

// scipy 1.17.1: ttest_rel of the means by scene, 9.5 to 11.5 against 12 and 20.5 to 22.5; ttest_ind(equal_var=False)
#[test]
fn a_duration_with_repeats_is_tested_by_scene() {
    let test = |rows: &[Row], label: fn(&Row) -> Option<String>| {
        let found = with_scenes(rows, RECORDED, label);
        let of = found.models.iter().find(|family| family.metric == "TTD").unwrap();
        let said = found.answers.iter().find(|it| it.metric == "TTD").map(|it| it.answer.clone());
        (of.tests[0].comparison.clone(), said.unwrap())
    };
    let (paired, said) = test(&timed(7), by_scene);
    assert_eq!((paired.method, paired.units.as_ref().unwrap().n), (Method::RestrictedMeanPaired, 7));
    assert!((paired.p.unwrap() - 0.000_195_354_801_959_960_72).abs() < 1e-12, "{paired:?}");
    assert_eq!(said, "E1 fast better than slow");
    let (independent, _) = test(&timed(7), |row| Some(format!("{} {}", row.1, row.2)));
    assert_eq!(independent.method, Method::RestrictedMean);
    assert!((independent.p.unwrap() - 0.000_296_762_960_175_590_35).abs() < 1e-12, "{independent:?}");
    let (few, said) = test(&timed(5), by_scene);
    assert_eq!((few.p, few.separated, &*said), (None, false, "E1 cannot say: 5 scenes"));
}

/// An episode without a decision at the horizon took longer. One interrupted earlier tells nothing about the rest.
#[test]
fn interrupted_repeats_leave_durations_untested() {
    let rows = |interrupted: i64| {
        let ends = [("fast", -100), ("slow", -100), ("fast", interrupted)];
        timed(7).into_iter().chain(ends.map(|(model, steps)| ("E1", model, 6, 2, false, steps))).collect::<Vec<Row>>()
    };
    let said = |interrupted| {
        let found = with_scenes(&rows(interrupted), RECORDED, by_scene);
        found.answers.into_iter().find(|it| it.metric == "TTD").unwrap().answer
    };
    assert_eq!(said(-10), "E1 cannot say: 1 interrupted episode");
    assert_eq!(said(-100), "E1 fast better than slow");
}

// Python: mean squares within scenes, 3.5 / 7 over 14 episodes and 2.5 / 6 over 13
// episodes: (0.5 / 14 + 2.5 / 6 / 13) ** 0.5; no rate varies.
#[test]
fn a_difference_is_shown_with_the_noise_of_repeats() {
    let mut rows = timed(7);
    rows.pop();
    let found = with_scenes(&rows, RECORDED, by_scene);
    let of = |metric: &str| {
        let family = found.models.iter().find(|family| family.metric == metric).unwrap();
        family.tests[0].comparison.repeat_se
    };
    assert!((of("TTD").unwrap() - 0.260_318_204_829_335_3).abs() < 1e-12, "{:?}", of("TTD"));
    assert_eq!(of("TSA"), Some(0.0));
    let text = found.render(&["TTD".to_owned()], Length::Tables, None);
    assert!(text.contains("SE of repeats"), "{text}");
    let once = with_scenes(&rows.into_iter().filter(|row| row.3 == 0).collect::<Vec<_>>(), RECORDED, by_scene);
    assert_eq!(once.models[0].tests[0].comparison.repeat_se, None);
}

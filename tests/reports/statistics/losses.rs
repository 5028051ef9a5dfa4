//! Lost episodes, filters and pooling are reported with the verdicts that they affect.

use mirrorstats_analysis::statistics::text::Length;
use mirrorstats_analysis::statistics::{AnswerRole, Comparison, Options, Selection, Statistics, Verdict};
use mirrorstats_score::quality::CellKey;
use mirrorstats_score::tables::lost_counts::LostCounts;

use super::{RECORDED, Row, by_place, cells, labelled, recorded, table};

/// Episodes of E1; the first `solved` are solved in nine steps.
fn of(model: &str, solved: i32, all: i32) -> impl Iterator<Item = Row<'_>> {
    (0..all).map(move |at| ("E1", model, 0, at, at < solved, if at < solved { 9 } else { 60 }))
}

/// Options with `count` lost episodes of b.
fn lost_of_b(count: usize) -> Options {
    let mut lost = LostCounts::default();
    let cell = CellKey { experiment: "E1".into(), model: "b".into(), condition: "default".into() };
    (0..count).for_each(|_| lost.add(cell.clone()));
    Options { lost: Some(lost), ..Options::default() }
}

fn test<'s>(found: &'s Statistics, metric: &str) -> &'s Comparison {
    &found.models.iter().find(|family| family.metric == metric).unwrap().tests[0].comparison
}

fn answer<'s>(found: &'s Statistics, question: &str, metric: &str) -> &'s str {
    &found.answers.iter().find(|it| it.question.starts_with(question) && it.metric == metric).unwrap().answer
}

// scipy 1.17.1: fisher_exact([[18, 3], [2, 9]]).pvalue, the same with 2 of 21 and with 12 of 21;
// binomtest(2, 21, 1/3).pvalue, binomtest(12, 21, 1/3).pvalue
#[test]
fn lost_episodes_that_could_turn_a_verdict_withhold_it() {
    let table = table(&of("a", 18, 21).chain(of("b", 2, 11)).collect::<Vec<_>>());
    let known = Statistics::from_table(&table, &cells(&table), &lost_of_b(0)).unwrap();
    assert!(test(&known, "TSA").separated && test(&known, "TSA").losses.is_none());
    let found = Statistics::from_table(&table, &cells(&table), &lost_of_b(10)).unwrap();
    let losses = test(&found, "TSA").losses.unwrap();
    let p = [losses.lowest.p, losses.highest.p].map(Option::unwrap);
    assert!(!test(&found, "TSA").separated && !losses.agree && losses.lost == 10, "{losses:?}");
    assert!((p[0] - FISHER_OF_ALL[0]).abs() < 1e-9 && (p[1] / FISHER_OF_ALL[1] - 1.0).abs() < 1e-9, "{losses:?}");
    assert_eq!(answer(&found, "Who differs", "TSA"), "E1 cannot say: 10 lost episodes");
    let b = found.chance.iter().find(|row| row.key.model == "b" && row.metric == "TSA").unwrap();
    let losses = b.losses.unwrap();
    let p = [losses.lowest.p, losses.highest.p].map(Option::unwrap);
    assert!((p[0] - BINOMIAL_OF_B[0]).abs() < 1e-9 && (p[1] - BINOMIAL_OF_B[1]).abs() < 1e-9, "{losses:?}");
    assert_eq!(answer(&found, "Who is above", "TSA"), "E1 a, cannot say for b: 10 lost episodes");
    assert!(found.answers.iter().all(|it| it.caveats == ["10 episodes lost"]), "{:?}", found.answers);
    let text = found.render(&found.headline, Length::Tables, None);
    assert!(text.contains("cannot say") && text.contains("p with lost episodes"), "{text}");
    assert!(text.contains("lost episodes (10 episodes lost)."), "{text}");
}

/// First with all lost episodes of b solved, then with all failed.
const FISHER_OF_ALL: [f64; 2] = [0.085_493_439_938_758_58, 1.104_459_457_501_661_6e-6];
const BINOMIAL_OF_B: [f64; 2] = [0.019_638_567_743_686_188, 0.034_025_477_734_148_02];

// scipy 1.17.1: binomtest(9, 9).pvalue, binomtest(9, 14).pvalue, binomtest(14, 14).pvalue
#[test]
fn a_lost_episode_counts_as_a_pair_against_a_known_outcome() {
    let rows: Vec<Row> = of("a", 21, 21).chain(of("b", 12, 21)).collect();
    let table = labelled(&rows, "scene", by_place);
    let found = Statistics::from_table(&table, &cells(&table), &Options { design: RECORDED, ..lost_of_b(5) }).unwrap();
    let losses = test(&found, "TSA").losses.unwrap();
    assert_eq!(test(&found, "TSA").p, Some(0.003_906_25));
    assert!((losses.lowest.p.unwrap() - 0.423_950_195_312_5).abs() < 1e-12, "{losses:?}");
    assert_eq!((losses.highest.p, losses.agree), (Some(0.000_122_070_312_5), false));
}

/// Nine steps against sixty differ however fast a few lost episodes were, but not if half of the episodes were lost.
#[test]
fn a_difference_of_durations_is_kept_if_losses_cannot_turn_it() {
    let table = table(&of("a", 21, 21).chain(of("b", 1, 21)).collect::<Vec<_>>());
    let of_lost = |count| Statistics::from_table(&table, &cells(&table), &lost_of_b(count)).unwrap();
    let (few, many) = (of_lost(1), of_lost(200));
    assert!(test(&few, "TTD").separated && test(&few, "TTD").losses.unwrap().agree, "{:?}", test(&few, "TTD"));
    assert!(!test(&many, "TTD").separated && !test(&many, "TTD").losses.unwrap().agree, "{:?}", test(&many, "TTD"));
}

#[test]
fn each_answer_names_a_filter_by_results_and_pooling() {
    let table = table(&of("a", 21, 21).collect::<Vec<_>>());
    let selection = Some(Selection { condition: "TSA = 1".into(), by_results: true });
    let caveats = vec!["recordings are pooled".to_owned()];
    let found =
        Statistics::from_table(&table, &cells(&table), &Options { selection, caveats, ..Options::default() }).unwrap();
    assert_eq!(found.chance[0].verdict, Verdict::Above);
    let expected = ["episodes chosen by their results: `TSA = 1`", "recordings are pooled"];
    assert!(found.answers.iter().all(|answer| answer.caveats == expected), "{:?}", found.answers);
    let text = found.render(&found.headline, Length::Tables, None);
    assert!(text.contains("E1 a (episodes chosen by their results: `TSA = 1`; recordings are pooled)."), "{text}");
}

#[test]
fn the_primary_answer_comes_first_and_families_are_counted() {
    let rows: Vec<Row> = of("a", 21, 21).chain(of("b", 12, 21)).collect();
    let found = recorded(&rows);
    let roles: Vec<_> = found.answers.iter().map(|answer| (answer.metric.as_str(), answer.role)).collect();
    assert_eq!(roles[0], ("TSA", AnswerRole::Primary));
    assert!(roles[1..].iter().all(|(_, role)| *role == AnswerRole::Secondary));
    // TSA and TSA-C against chance, TSA and TTD between models.
    assert_eq!(found.families, 4);
    let text = found.render(&found.headline, Length::Tables, None);
    assert!(text.contains("within each of 4 families of tests; the first answer is primary"), "{text}");
    let table = table(&rows);
    let options = Options { primary: Some("TTD".into()), ..Options::default() };
    let found = Statistics::from_table(&table, &cells(&table), &options).unwrap();
    assert_eq!((found.answers[0].metric.as_str(), found.answers[0].role), ("TTD", AnswerRole::Primary));
}

#[test]
fn values_beside_the_verdict_are_in_the_full_text_alone() {
    let rows: Vec<Row> = of("a", 21, 21).chain(of("b", 12, 21)).collect();
    let found = recorded(&rows);
    let [short, full] = [Length::Tables, Length::Full].map(|length| found.render(&found.headline, length, None));
    assert!(!short.contains("mid-p"), "{short}");
    assert!(full.contains("mid-p"), "{full}");
}

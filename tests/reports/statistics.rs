//! What `stats` says of tables of episodes whose answers are known.

use std::collections::BTreeSet;

use indexmap::IndexMap;
use mirrorstats::metric::catalog::{Better, Catalog, Experiment, Kind, Metric, StandardError};
use mirrorstats::report::statistics::text::{self, Length};
use mirrorstats::report::statistics::{
    Contrast, Intervals, Method, Options, OverallMethod, OverallRow, Sign, Statistics, Verdict,
};
use mirrorstats::score::table::{EpisodeKey, EpisodeTable, LabelColumn, MetricColumn};
use mirrorstats::stats::cell::{Cells, Group, KeyValue};
use mirrorstats::stats::coverage::Withheld;
use mirrorstats::stats::design::{Cluster, Design, DesignKind};
use mirrorstats::stats::interval::Interval;
use mirrorstats::stats::moments::Moments;

use crate::assert_shown;
use crate::html::scored::PAPER;

fn metric(kind: Kind, better: Better, when: Option<&str>) -> Metric {
    Metric {
        title: String::new(),
        kind,
        unit: "steps".into(),
        better,
        section: String::new(),
        help: String::new(),
        value: String::new(),
        when: when.map(str::to_owned),
        se: StandardError::Sample,
        chance: None,
    }
}

fn experiment(order: i64, chance: &[(&str, &str)], reference: &[(&str, &[&str])]) -> Experiment {
    Experiment {
        title: String::new(),
        order,
        chance: chance.iter().map(|(name, level)| ((*name).into(), Some(level.parse().unwrap()))).collect(),
        reference: reference
            .iter()
            .map(|(name, levels)| ((*name).into(), levels.iter().map(|level| level.parse().unwrap()).collect()))
            .collect(),
    }
}

/// TSA (1/3 by chance in E1 and E2, references in E5), TTD in steps, TSA-C where finished, MTATO where solved.
fn catalog() -> Catalog {
    let metric = IndexMap::from([
        ("TSA".to_owned(), metric(Kind::Rate, Better::Higher, None)),
        ("TTD".to_owned(), metric(Kind::Quantity, Better::Lower, None)),
        ("TSA-C".to_owned(), metric(Kind::Rate, Better::Higher, Some("finished"))),
        ("MTATO".to_owned(), metric(Kind::Rate, Better::Higher, Some("TSA = 1"))),
    ]);
    let experiment = IndexMap::from([
        ("E1".to_owned(), experiment(1, &[("TSA", "1/3")], &[])),
        ("E2".to_owned(), experiment(2, &[("TSA", "1/3")], &[])),
        ("E5".to_owned(), experiment(5, &[], &[("TSA", &["1/10", "1/11"])])),
    ]);
    Catalog { name: "test".into(), hash: "0".repeat(64), open: false, lets: IndexMap::new(), metric, experiment }
}

/// An episode: where it belongs, whether it was solved, and its steps; negative ones never finished.
type Row<'a> = (&'a str, &'a str, i32, i32, bool, i64);

fn table(rows: &[Row]) -> EpisodeTable {
    let mut rows = rows.to_vec();
    rows.sort_unstable();
    let key = |(at, &(experiment, model, seed, run, ..)): (usize, &Row)| EpisodeKey {
        experiment: experiment.into(),
        model: model.into(),
        seed,
        run,
        episode_id: format!("{experiment}/{model}/{seed}/{run}/{at}"),
    };
    let column = |name: &str, value: fn(&Row) -> Option<i64>| MetricColumn::new(name, rows.iter().map(value));
    EpisodeTable {
        catalog: catalog(),
        keys: rows.iter().enumerate().map(key).collect(),
        labels: Vec::new(),
        metrics: vec![
            column("TSA", |row| Some(i64::from(row.4))),
            column("TTD", |row| Some(row.5.abs())),
            column("TSA-C", |row| (row.5 > 0).then_some(i64::from(row.4))),
            column("MTATO", |row| row.4.then_some(1)),
        ],
    }
}

/// Cells by experiment and model.
fn cells(table: &EpisodeTable) -> Cells {
    let mut groups: std::collections::BTreeMap<Vec<KeyValue>, Group> = std::collections::BTreeMap::new();
    for (row, key) in table.keys.iter().enumerate() {
        let key = vec![KeyValue::Text(key.experiment.to_owned()), KeyValue::Text(key.model.to_owned())];
        let moments = vec![Moments::default(); table.metrics.len()];
        let group = groups.entry(key.clone()).or_insert(Group { key, episodes: 0, moments });
        group.episodes += 1;
        for (moments, column) in group.moments.iter_mut().zip(&table.metrics) {
            *moments = column.get(row).map_or(*moments, |value| moments.with(value).unwrap());
        }
    }
    Cells {
        catalog: table.catalog.clone(),
        by: vec!["experiment".into(), "model".into()],
        metrics: table.metrics.iter().map(|column| column.name.clone()).collect(),
        groups: groups.into_values().collect(),
    }
}

/// Recorded episodes, of which those of one seed depend on each other.
const RECORDED: Design = Design { kind: Some(DesignKind::Recording), cluster: Some(Cluster::Seed) };

/// What is said of traces that declare nothing.
fn statistics(rows: &[Row]) -> Statistics {
    let table = table(rows);
    Statistics::of(&table, &cells(&table), &Options::default()).unwrap()
}

/// The table with a label.
fn labelled(rows: &[Row], name: &str, value: impl Fn(&Row) -> Option<String>) -> EpisodeTable {
    let mut sorted = rows.to_vec();
    sorted.sort_unstable();
    let values: Vec<Option<String>> = sorted.iter().map(value).collect();
    let values = values.iter().map(Option::as_deref).collect();
    let mut table = table(rows);
    table.labels.push(LabelColumn { name: name.to_owned(), values });
    table
}

/// One scene per seed and run, the same in every experiment and for every model.
fn by_place(row: &Row) -> Option<String> {
    Some(format!("room {} body {}", row.2, row.3))
}

/// What is said of episodes with these scenes.
fn with_scenes(rows: &[Row], design: Design, scene: impl Fn(&Row) -> Option<String>) -> Statistics {
    let table = labelled(rows, "scene", scene);
    Statistics::of(&table, &cells(&table), &Options { design, ..Options::default() }).unwrap()
}

/// Recorded episodes whose scenes follow seed and run.
fn recorded(rows: &[Row]) -> Statistics {
    with_scenes(rows, RECORDED, by_place)
}

fn contrast<'s>(found: &'s Statistics, model: &str, metric: &str, against: &str) -> &'s Contrast {
    let is_it = |it: &&Contrast| it.model == model && it.metric == metric && it.against == against;
    found.conditions.iter().find(is_it).unwrap()
}

/// Three seeds of seven runs, of which the first `solved` are solved in `steps` steps, the others never.
fn block<'a>(experiment: &'a str, model: &'a str, solved: i32, steps: i64) -> Vec<Row<'a>> {
    let row = |at: i32| (experiment, model, at / 7, at % 7, at < solved, if at < solved { steps } else { -100 });
    (0..21).map(row).collect()
}

/// Experiment, model, episodes that are solved, and in how many steps.
const STUDY: [(&str, &str, i32, i64); 7] = [
    ("E1", "strong", 21, 12),
    ("E1", "middle", 14, 30),
    ("E1", "weak", 5, 60),
    ("E2", "strong", 7, 20),
    ("E2", "middle", 6, 20),
    ("E2", "weak", 5, 60),
    ("E5", "strong", 9, 40),
];

fn study() -> Vec<Row<'static>> {
    STUDY.map(|(experiment, model, solved, steps)| block(experiment, model, solved, steps)).concat()
}

#[test]
fn cells_carry_counts_and_the_intervals_of_their_kind() {
    let found = statistics(&study());
    let cell = |experiment: &str, model: &str, metric: &str| {
        let key = [("experiment", experiment), ("model", model)];
        let is_it = |cell: &&mirrorstats::report::statistics::CellRow| {
            cell.metric == metric && key.iter().all(|(name, value)| cell.key[*name] == KeyValue::Text((*value).into()))
        };
        found.cells.iter().find(is_it).unwrap()
    };
    let weak = cell("E1", "weak", "TSA");
    assert_eq!((weak.sum, weak.n, weak.episodes), (5, 21, 21));
    let Intervals::Rate { wilson: Some(wilson), clopper_pearson: Some(exact), jeffreys: Some(jeffreys) } =
        weak.intervals
    else {
        panic!("a rate has the intervals of a rate: {weak:?}")
    };
    // For n = 21 at 95 %: k = 5.
    let three = |Interval { low, high }: Interval| (format!("{low:.3}"), format!("{high:.3}"));
    assert_eq!(three(wilson), ("0.106".into(), "0.451".into()));
    assert_eq!(three(exact), ("0.082".into(), "0.472".into()));
    assert_eq!(three(jeffreys), ("0.097".into(), "0.446".into()));

    let strong = cell("E1", "strong", "TTD");
    assert!(matches!(strong.intervals, Intervals::Quantity { student_t: None, bootstrap: None, .. }));
    let weak = cell("E1", "weak", "TTD").intervals;
    assert!(matches!(weak, Intervals::Quantity { student_t: Some(_), bootstrap: Some(_), .. }));
    assert!(!cell("E1", "weak", "MTATO").few, "five are enough");
}

#[test]
fn a_conditional_metric_of_few_episodes_is_marked_and_an_undefined_one_has_no_interval() {
    let found = statistics(&[block("E1", "a", 4, 9), block("E1", "b", 0, 9)].concat());
    let few: Vec<_> = found.cells.iter().filter(|cell| cell.few).map(|cell| (cell.metric.as_str(), cell.n)).collect();
    assert_eq!(few, [("TSA-C", 4), ("MTATO", 4), ("TSA-C", 0), ("MTATO", 0)]);
    let undefined = found.cells.last().unwrap();
    assert_eq!((undefined.mean, undefined.se), (None, None));
    assert_eq!(undefined.intervals, Intervals::Rate { wilson: None, clopper_pearson: None, jeffreys: None });
    assert!(found.warnings.iter().any(|warning| warning.starts_with("4 of 8 cells")), "{:?}", found.warnings);
}

#[test]
fn chance_comes_from_the_definitions_and_references_where_there_is_none() {
    let found = statistics(&study());
    let row = |experiment: &str, model: &str| {
        let of_model = found.chance.iter().filter(|row| row.experiment == experiment && row.model == model);
        of_model.filter(|row| row.metric == "TSA").collect::<Vec<_>>()
    };
    let strong = row("E1", "strong");
    assert_eq!((strong.len(), strong[0].level.to_string(), strong[0].verdict), (1, "1/3".into(), Verdict::Above));
    assert!((strong[0].p - 9.559_906_635_974_805e-11).abs() < 1e-22);
    assert!((strong[0].p_adjusted - 3.0 * strong[0].p).abs() < 1e-20);
    assert_eq!(row("E2", "strong")[0].verdict, Verdict::NotSeparated);
    let levels: Vec<String> = row("E5", "strong").iter().map(|row| row.level.to_string()).collect();
    assert_eq!(levels, ["1/10", "1/11"]);
}

#[test]
fn models_are_paired_by_scene_and_tied_rather_than_ranked() {
    let found = recorded(&study());
    let family = found.models.iter().find(|family| family.experiment == "E1" && family.metric == "TSA").unwrap();
    assert_eq!(family.models, ["strong", "middle", "weak"]);
    assert!(family.tests.iter().all(|test| test.comparison.method == Method::Mcnemar && test.matching.pairs == 21));
    // strong - middle 7:0, p = 2/2^7, times 2 as the third but held up by 9:0; middle - weak 9:0; strong - weak 16:0
    let p: Vec<f64> = family.tests.iter().map(|test| test.comparison.p.unwrap()).collect();
    assert_eq!(p, [2.0 / 128.0, 2.0 / 65536.0, 2.0 / 512.0]);
    let adjusted: Vec<f64> = family.tests.iter().map(|test| test.comparison.p_adjusted.unwrap()).collect();
    assert_eq!(adjusted, [2.0 / 128.0, 6.0 / 65536.0, 4.0 / 512.0]);
    assert_eq!(family.tied, [["strong"], ["middle"], ["weak"]]);
    let other = found.models.iter().find(|family| family.experiment == "E2" && family.metric == "TSA").unwrap();
    assert_eq!(other.tied, [["strong", "middle", "weak"]]);
    let reach = family.detectable.unwrap();
    assert_eq!((reach.n, reach.tests, reach.single.unwrap().pairs, reach.family.unwrap().pairs), (21, 3, 6, 7));
    assert!(found.models.iter().all(|family| family.experiment != "E5"), "one model has no rival");
}

/// Equal seeds and runs are no pairs: the bodies differ.
#[test]
fn different_scenes_make_no_pairs_however_equal_seed_and_run_are() {
    let rows = [block("E1", "a", 21, 9), block("E1", "b", 7, 9)].concat();
    let found = with_scenes(&rows, RECORDED, |row| Some(format!("{} {} {}", row.1, row.2, row.3)));
    let test = &found.models[0].tests[0];
    assert_eq!((test.comparison.method, test.comparison.pairs, test.matching.alone), (Method::Fisher, None, 42));
    // scipy 1.17.1: fisher_exact([[21, 0], [7, 14]]).pvalue
    assert!((test.comparison.p.unwrap() - 4.3995269042069015e-06).abs() < 1e-9, "{test:?}");
    assert!(found.design_note.contains("none of 1 comparisons has pairs"), "{}", found.design_note);
}

/// A pair is a scene, whatever seed and run say.
#[test]
fn equal_scenes_are_pairs_under_other_seeds_and_runs() {
    let rows = [block("E1", "a", 21, 9), block("E1", "b", 7, 9)].concat();
    let place = |row: &Row| row.2 * 7 + row.3;
    // The scenes of b come in the opposite order.
    let found = with_scenes(&rows, RECORDED, |row| Some((if row.1 == "a" { place(row) } else { 20 - place(row) }).to_string()));
    let test = &found.models[0].tests[0];
    assert_eq!((test.comparison.method, test.matching.pairs), (Method::Mcnemar, 21));
    let shuffled = with_scenes(&rows, RECORDED, |row| {
        Some(if row.1 == "a" || place(row) < 4 { place(row) } else { 100 + place(row) }.to_string())
    });
    let test = &shuffled.models[0].tests[0];
    assert_eq!((test.comparison.method, test.matching.pairs, test.matching.alone), (Method::Fisher, 4, 34), "{test:?}");
}

#[test]
fn reconstructions_and_undeclared_traces_have_neither_pairs_nor_clusters() {
    let made_up = Design { kind: Some(DesignKind::Reconstruction), cluster: Some(Cluster::Seed) };
    for (found, note) in [
        (with_scenes(&study(), made_up, by_place), "reconstructed episodes"),
        (statistics(&study()), "declare no design"),
    ] {
        assert!(found.models.iter().all(|family| family.tests.iter().all(|test| test.comparison.pairs.is_none())));
        assert!(found.conditions.iter().all(|contrast| contrast.comparison.pairs.is_none()));
        assert_eq!((found.clusters.len(), found.gaps.len()), (0, 0));
        assert!(found.warnings[0].contains(note), "{:?}", found.warnings);
        let text = text::render(&found, &found.headline, Length::Short, None);
        assert!(text.contains("Fisher") && !text.contains("pairs of equal") && text.contains(note), "{text}");
    }
}

#[test]
fn repeats_of_a_scene_are_counted_and_are_no_pairs() {
    let rows = [block("E1", "a", 21, 9), block("E1", "b", 7, 9)].concat();
    let found = with_scenes(&rows, RECORDED, |row| Some(row.2.to_string()));
    let test = &found.models[0].tests[0];
    assert_eq!((test.matching.pairs, test.matching.repeated, test.comparison.method), (0, 42, Method::Fisher));
    assert!(found.warnings.iter().any(|line| line.contains("which repeats of a scene are not")), "{:?}", found.warnings);
}

#[test]
fn episodes_without_a_partner_are_counted_and_named() {
    let mut rows = [block("E1", "a", 21, 9), block("E1", "b", 0, 9)].concat();
    rows.retain(|row| !(row.1 == "b" && row.2 == 2 && row.3 == 6));
    rows.push(("E1", "b", 0, 0, false, -100));
    let found = recorded(&rows);
    let gaps: Vec<_> = found.gaps.iter().map(|gap| (gap.model.as_str(), gap.scene.as_str(), gap.episodes)).collect();
    assert_eq!(gaps, [("b", "room 0 body 0", 2), ("b", "room 2 body 6", 0)]);
    let test = &found.models[0].tests[0];
    assert_eq!((test.matching.pairs, test.matching.alone, test.matching.repeated), (19, 1, 3));
    assert_eq!(test.comparison.undefined, 0);
    let undefined = &found.models.iter().find(|family| family.metric == "TSA-C").unwrap().tests[0].comparison;
    assert_eq!((undefined.n, undefined.undefined, undefined.p), ([0, 0], 19, None));
    assert!(
        found.warnings.iter().any(|warning| warning.contains("E1 b scene room 2 body 6 (missing)")),
        "{:?}",
        found.warnings
    );
}

#[test]
fn experiments_with_the_same_scenes_are_compared_by_pairs() {
    let found = recorded(&study());
    let rate = &contrast(&found, "strong", "TSA", "E2").comparison;
    // 21/21 and 7/21 with the same first seven: 14:0, p = 2/2^14; Holm over three models: 3 p
    assert_eq!((rate.method, rate.difference), (Method::Mcnemar, Some(14.0 / 21.0)));
    assert_eq!((rate.p, rate.p_adjusted), (Some(2.0 / 16384.0), Some(6.0 / 16384.0)));
    assert_eq!(rate.sign(), Some(Sign::Higher));
    // Python: Newcombe's method 10 over the Wilson limits of statsmodels 0.15.0
    let interval = rate.interval.unwrap();
    assert!((interval.low - 0.4035064011101968).abs() < 1e-9 && (interval.high - 0.8280524739491654).abs() < 1e-9, "{interval:?}");
    let steps = &contrast(&found, "strong", "TTD", "E2").comparison;
    assert_eq!((steps.method, steps.horizon), (Method::RestrictedMeanPaired, Some(100)));
    assert!((steps.difference.unwrap() - (12.0 - (7.0 * 20.0 + 14.0 * 100.0) / 21.0)).abs() < 1e-9);
    assert!(found.answers.iter().any(|answer| answer.answer.starts_with("E1 - E2 higher for middle, strong")), "{:?}", found.answers);
}

#[test]
fn experiments_with_other_scenes_are_compared_as_independent() {
    let found = with_scenes(&study(), RECORDED, |row| Some(format!("{} {} {}", row.0, row.2, row.3)));
    let rate = &contrast(&found, "strong", "TSA", "E2").comparison;
    assert_eq!((rate.method, rate.successes, rate.n), (Method::Fisher, Some([21, 7]), [21, 21]));
    assert_eq!(contrast(&found, "strong", "TTD", "E2").comparison.method, Method::RestrictedMean);
    assert_eq!(contrast(&found, "strong", "MTATO", "E2").comparison.n, [21, 7]);
}

/// Python, from the episode table alone: Kaplan-Meier areas up to 100, Greenwood's variances times 21/20, norm.ppf(0.975):
/// 8.213235294117645, -21.51387685734291 to 37.9403474455782; the plain means differ by 27.7.
#[test]
fn a_duration_is_contrasted_by_restricted_means() {
    let found = Statistics::of(&PAPER, &cells(&PAPER), &Options::default()).unwrap();
    let steps = &contrast(&found, "Gemma4 31B", "TTD", "E3").comparison;
    assert!((steps.difference.unwrap() - 8.213235294117645).abs() < 1e-9, "{steps:?}");
    let interval = steps.interval.unwrap();
    assert!((interval.low + 21.51387685734291).abs() < 1e-9 && (interval.high - 37.9403474455782).abs() < 1e-9, "{interval:?}");
}

/// Not to finish is not to guess: verdicts of TSA against chance that the finished episodes do not share.
#[test]
fn chance_is_tested_among_finished_episodes_too() {
    let found = Statistics::of(&PAPER, &cells(&PAPER), &Options::default()).unwrap();
    let of = |metric: &'static str| found.chance.iter().filter(move |row| row.metric == metric && row.experiment != "E5");
    let changed = of("TSA").filter(|row| {
        let same = |other: &&mirrorstats::report::statistics::ChanceRow| {
            (&other.experiment, &other.model, other.level) == (&row.experiment, &row.model, row.level)
        };
        of("TSA-C").find(same).is_some_and(|other| other.verdict != row.verdict)
    });
    assert_eq!((of("TSA").count(), changed.count()), (32, 6));
    let text = text::render(&found, &["TSA".to_owned()], Length::Short, None);
    assert!(text.contains("TSA     chance 1/3") && text.contains("TSA-C   chance 1/3"), "{text}");
}

/// Pairs of all experiments are pooled; independent episodes are strata.
#[test]
fn models_are_compared_over_all_experiments() {
    let overall = |found: &Statistics| {
        let is_it = |row: &&OverallRow| (row.metric.as_str(), row.first.as_str(), row.second.as_str()) == ("TSA", "strong", "weak");
        found.overall.iter().find(is_it).unwrap().clone()
    };
    // E1 16:0 and E2 2:0, together 18:0, p = 2/2^18; Holm over three pairs
    let paired = overall(&recorded(&study()));
    assert_eq!((paired.method, paired.p, paired.p_adjusted), (OverallMethod::PooledMcnemar, Some(2.0 / 262_144.0), Some(6.0 / 262_144.0)));
    assert_eq!(paired.experiments, ["E1", "E2"]);
    let apart = overall(&statistics(&study()));
    assert_eq!(apart.method, OverallMethod::MantelHaenszel);
    // Strata of 21 and 21: the mean of 16/21 and 2/21.
    assert!((apart.difference.unwrap() - 9.0 / 21.0).abs() < 1e-12, "{apart:?}");
    // Python, fractions: the sums of two hypergeometric counts at most as probable as 28
    assert!((apart.p.unwrap() - 5.576486641926384e-05).abs() < 1e-9, "{apart:?}");
}

/// Who decides in each episode, decides earlier than who never does; ties count half.
#[test]
fn improvement_is_counted_among_decisions_and_none() {
    let table = table(&study());
    let options = Options { improvements: true, ..Options::default() };
    let found = Statistics::of(&table, &cells(&table), &options).unwrap();
    let row = found.improvements.iter().find(|row| (&*row.first, &*row.second) == ("strong", "weak")).unwrap();
    // E1: always earlier. E2: 7 of 21 at step 20 against 5 of 21 at step 60: 7/21 + 14/21 * 16/21 / 2
    let expected = (1.0 + 7.0 / 21.0 + 14.0 / 21.0 * 16.0 / 21.0 / 2.0) / 2.0;
    assert!((row.improvement.probability - expected).abs() < 1e-12, "{row:?}");
    assert!(statistics(&study()).improvements.is_empty(), "only where they are asked for");
}

#[test]
fn three_seeds_are_not_enough_for_a_claim_about_seeds_and_six_are() {
    let warns = |found: &Statistics| {
        found.warnings.iter().any(|warning| warning.contains("too few for a claim about new seeds"))
    };
    let three = recorded(&block("E1", "a", 10, 9));
    assert_eq!(three.clusters[0].by_seed.unwrap().clusters, 3);
    assert!(warns(&three));
    let six: Vec<Row> = (0..12).map(|at| ("E1", "a", at / 2, at % 2, at % 3 == 0, 9)).collect();
    assert!(!warns(&recorded(&six)));
    let one: Vec<Row> = (0..3).map(|run| ("E1", "a", 0, run, true, 9)).collect();
    assert_eq!(recorded(&one).clusters[0].by_seed, None);
    let undeclared = with_scenes(&block("E1", "a", 10, 9), Design { cluster: None, ..RECORDED }, by_place);
    assert!(undeclared.clusters.is_empty() && !warns(&undeclared));
}

#[test]
fn the_level_of_a_warning_follows_the_confidence() {
    let table = labelled(&block("E1", "a", 10, 9), "scene", by_place);
    let options = Options { confidence: 0.8, design: RECORDED, ..Options::default() };
    let found = Statistics::of(&table, &cells(&table), &options).unwrap();
    let said = found.warnings.iter().find(|warning| warning.contains("new seeds")).unwrap();
    assert!(said.contains("no test over fewer than 4 can reach p = 0.2."), "{said}");
}

#[test]
fn a_difference_that_nothing_could_show_is_said_to_be_none() {
    let rows: Vec<Row> = (0..3).flat_map(|run| [("E1", "a", 0, run, true, 9), ("E1", "b", 0, run, false, 9)]).collect();
    let said = |found: &Statistics| found.conclusions.iter().find(|line| line.contains("cannot show any difference")).cloned();
    assert!(said(&recorded(&rows)).unwrap().contains("3 pairs cannot show any difference between two models"));
    assert!(said(&statistics(&rows)).unwrap().contains("3 episodes per model cannot show any difference"));
}

/// Intervals whose coverage was not found to be 90 % are not given, and none is a point or leaves the budget.
#[test]
fn intervals_hold_what_they_promise_or_give_the_reason() {
    let two = statistics(&[("E1", "a", 0, 0, true, 10), ("E1", "a", 0, 1, true, 20)]);
    let Intervals::Quantity { student_t: None, student_t_withheld, bootstrap: None, bootstrap_withheld } = two.cells[1].intervals
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

/// The intervals of a JSON value that have no width.
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
fn the_dagger_is_explained_where_it_stands_and_only_there() {
    let found = statistics(&[block("E1", "a", 4, 9), block("E1", "b", 0, 9)].concat());
    let with = text::render(&found, &["MTATO".to_owned()], Length::Short, None);
    assert!(with.contains('†') && with.contains("† fewer than 5 defined episodes"), "{with}");
    let without = text::render(&found, &["TTD".to_owned()], Length::Full, None);
    assert!(!without.contains('†') && !without.contains("dagger"), "{without}");
}

#[test]
fn conditions_of_one_model_are_compared_like_models() {
    let rows = [block("E1", "a", 21, 9), block("E1", "b", 21, 9), block("E2", "a", 3, 9)].concat();
    let mut table = labelled(&rows, "condition", |row| (row.2 < 2).then(|| "pocket mirror".to_owned()));
    let text = {
        let found = Statistics::of(&table, &cells(&table), &Options::default()).unwrap();
        let family = found.models.iter().find(|family| family.experiment == "E1" && family.metric == "TSA").unwrap();
        assert_eq!(family.models, ["a [default]", "a [pocket mirror]", "b [default]", "b [pocket mirror]"]);
        assert_eq!(found.durations[0].condition.as_deref(), Some("default"));
        let both = found.conditions.iter().filter(|contrast| contrast.metric == "TSA");
        let names: Vec<_> = both.map(|contrast| (contrast.condition.as_deref().unwrap(), contrast.comparison.n)).collect();
        assert_eq!(names, [("default", [7, 7]), ("pocket mirror", [14, 14])]);
        text::render(&found, &found.headline, Length::Full, None)
    };
    assert!(text.contains("a [pocket mirror]"), "{text}");
    table.labels[0].values = rows.iter().map(|_| Some("default")).collect();
    let found = Statistics::of(&table, &cells(&table), &Options::default()).unwrap();
    assert!(!serde_json::to_string(&found).unwrap().contains("\"condition\":"), "one condition is none");
}

#[test]
fn a_wrong_decision_competes_with_a_correct_one() {
    // Ten correct at step 10, ten wrong at step 20, one unfinished.
    let row = |at: i32| ("E1", "a", at / 7, at % 7, at < 10, if at < 10 { 10 } else if at < 20 { 20 } else { -100 });
    let found = statistics(&(0..21).map(row).collect::<Vec<_>>());
    let correct = found.durations[0].correct.as_ref().unwrap();
    assert!((correct.correct - 10.0 / 21.0).abs() < 1e-12 && (correct.wrong - 10.0 / 21.0).abs() < 1e-12);
    assert!((correct.restricted.mean - (10.0 * 10.0 + 11.0 * 100.0) / 21.0).abs() < 1e-9);
    assert_eq!((correct.median, found.durations[0].median), (None, Some(20)));
}

#[test]
fn unfinished_episodes_are_censored_and_models_share_a_horizon() {
    let found = statistics(&study());
    let row = |model: &str| found.durations.iter().find(|row| row.experiment == "E1" && row.model == model).unwrap();
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

#[test]
fn lost_episodes_are_bounded_and_unknown_losses_are_said_to_be_unknown() {
    let table = table(&block("E1", "a", 10, 9));
    let lost: BTreeSet<String> = table.keys.iter().skip(18).map(|key| key.episode_id.to_owned()).collect();
    let options = Options { lost: Some(lost), ..Options::default() };
    let found = Statistics::of(&table, &cells(&table), &options).unwrap();
    let row = &found.losses.rows[0];
    assert_eq!((row.metric.as_str(), row.lossy.n, row.lossy.successes, row.lossy.lost), ("TSA", 18, 10, 3));
    assert_eq!(row.lossy.bounds, Interval { low: 10.0 / 21.0, high: 13.0 / 21.0 });
    assert!(found.warnings.iter().any(|warning| warning.starts_with("3 episodes ended by the infrastructure")));
    let unknown = statistics(&block("E1", "a", 10, 9));
    assert!(!unknown.losses.recorded && unknown.warnings.iter().any(|warning| warning.contains("reply_status")));
}

#[test]
fn nothing_at_all_is_no_fault() {
    let found = statistics(&[]);
    assert_eq!((found.episodes, found.cells.len(), found.models.len()), (0, 0, 0));
    assert!(text::render(&found, &found.headline, Length::Short, None).starts_with("0 episodes"));
}

#[test]
fn json_reads_back_to_the_same_rows() {
    let found = recorded(&study());
    let read: Statistics = serde_json::from_str(&serde_json::to_string(&found).unwrap()).unwrap();
    assert_eq!((&read.conclusions, &read.warnings, &read.gaps), (&found.conclusions, &found.warnings, &found.gaps));
    for (read, found) in read.cells.iter().zip(&found.cells) {
        assert_eq!((&read.key, &read.metric, read.n, read.sum), (&found.key, &found.metric, found.n, found.sum));
        assert_eq!(std::mem::discriminant(&read.intervals), std::mem::discriminant(&found.intervals));
    }
}

#[test]
fn a_rate_without_failure_is_never_certain() {
    let text = text::render(&statistics(&block("E1", "a", 21, 9)), &["TSA".into()], Length::Full, None);
    assert!(text.contains("[0.845, 1.000]") && !text.contains("[1.000, 1.000]") && !text.contains(" 0.000"), "{text}");
}

#[test]
fn values_too_large_to_square_are_refused() {
    let table = table(&[
        ("E1", "a", 0, 0, true, i64::MAX),
        ("E1", "a", 0, 1, true, i64::MAX),
        ("E1", "a", 0, 2, true, i64::MAX),
    ]);
    let none = Cells { groups: Vec::new(), catalog: table.catalog.clone(), by: Vec::new(), metrics: Vec::new() };
    let refused = Statistics::of(&table, &none, &Options::default()).unwrap_err();
    assert!(refused.to_string().contains("smaller unit"));
}

#[test]
fn the_text_begins_with_the_answers() {
    let found = recorded(&study());
    let blocks = STUDY.map(|(experiment, model, solved, steps)| format!("{experiment} {model} {solved}/21 in {steps}"));
    assert_shown!(blocks.join("\n"), text::render(&found, &found.headline, Length::Short, None));
}

#[test]
fn names_from_traces_cannot_write_to_the_terminal() {
    let found = statistics(&[block("E1", "evil\u{1b}[2J", 21, 9), block("E1", "b\nc", 0, 9)].concat());
    let text = text::render(&found, &found.headline, Length::Short, None);
    assert!(!text.contains('\u{1b}') && text.contains("evil\\u{1b}[2J") && text.contains("b\\u{a}c"));
}

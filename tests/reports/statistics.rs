//! `stats` on episode tables with known answers.

mod design;
mod direction;
mod durations;
mod equality;
mod losses;
mod units;

use indexmap::IndexMap;
use mirrorstats_analysis::statistics::text::Length;
use mirrorstats_analysis::statistics::{Contrast, Intervals, Options, Statistics, Verdict};
use mirrorstats_exact::chance::Chance;
use mirrorstats_exact::moments::Moments;
use mirrorstats_exact::ratio::Ratio;
use mirrorstats_metric::catalogs::catalog::{Better, Catalog, Experiment, Factor, Kind, Metric, StandardError};
use mirrorstats_score::cells::interval::ranges;
use mirrorstats_score::cells::{Cells, Group, KeyValue};
use mirrorstats_score::quality::CellKey;
use mirrorstats_score::tables::lost_counts::LostCounts;
use mirrorstats_score::tables::table::{Declared, EpisodeKey, EpisodeTable, LabelColumn, MetricColumn};
use mirrorstats_statistics::design::{Cluster, Design, DesignKind};
use mirrorstats_statistics::intervals::interval::Interval;

use crate::assert_shown;

fn metric(kind: Kind, better: Better, when: Option<&str>) -> Metric {
    Metric {
        title: String::new(),
        kind,
        unit: "steps".into(),
        decimals: 0,
        better,
        section: String::new(),
        help: String::new(),
        value: String::new(),
        when: when.map(str::to_owned),
        se: StandardError::Sample,
        chance: None,
        measures: None,
        range: None,
        finished: None,
        completes: None,
    }
}

fn experiment(order: i64, chance: &[(&str, &str)], reference: &[(&str, &[&str])]) -> Experiment {
    Experiment {
        title: String::new(),
        order,
        chance: chance
            .iter()
            .map(|(name, level)| ((*name).into(), level.parse::<Ratio>().ok().map(Chance::Of)))
            .collect(),
        reference: reference
            .iter()
            .map(|(name, levels)| ((*name).into(), levels.iter().map(|level| level.parse().unwrap()).collect()))
            .collect(),
        is_declared: false,
        control: None,
    }
}

/// TSA (1/3 by chance in E1 and E2, references in E5), TTD in steps, TSA-C where finished, MTATO where solved.
fn catalog() -> Catalog {
    let metric = IndexMap::from([
        ("TSA".to_owned(), metric(Kind::Rate, Better::Higher, None)),
        (
            "TTD".to_owned(),
            Metric { finished: Some("TSA-C".to_owned()), ..metric(Kind::Quantity, Better::Lower, None) },
        ),
        (
            "TSA-C".to_owned(),
            Metric { completes: Some("TSA".to_owned()), ..metric(Kind::Rate, Better::Higher, Some("finished")) },
        ),
        ("MTATO".to_owned(), metric(Kind::Rate, Better::Higher, Some("TSA = 1"))),
    ]);
    let experiment = IndexMap::from([
        ("E1".to_owned(), experiment(1, &[("TSA", "1/3")], &[])),
        ("E2".to_owned(), experiment(2, &[("TSA", "1/3")], &[])),
        ("E5".to_owned(), experiment(5, &[], &[("TSA", &["1/10", "1/11"])])),
    ]);
    Catalog {
        columns: IndexMap::new(),
        name: "test".into(),
        domain: None,
        hash: "0".repeat(64),
        open: false,
        lets: IndexMap::new(),
        metric,
        experiment,
        factor: IndexMap::new(),
    }
}

/// An episode: experiment, model, seed, run, true if solved, and steps; negative if it never finished.
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
        declared: Declared::default(),
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
        let group = groups.entry(key.clone()).or_insert(Group { key, episodes: 0, moments, repeats: false });
        group.episodes += 1;
        for (moments, column) in group.moments.iter_mut().zip(&table.metrics) {
            *moments = column.get(row).map_or(*moments, |value| moments.with(value).unwrap());
        }
    }
    Cells {
        catalog: table.catalog.clone(),
        by: vec!["experiment".into(), "model".into()],
        metrics: table.metrics.iter().map(|column| column.name.clone()).collect(),
        ranges: ranges(table),
        groups: groups.into_values().collect(),
    }
}

/// Recorded episodes without clusters.
const RECORDED: Design = Design { kind: Some(DesignKind::Recording), cluster: None };

/// Recorded episodes; those with the same seed depend on each other.
const CLUSTERED: Design = Design { cluster: Some(Cluster::Seed), ..RECORDED };

/// The statistics of traces without declarations.
fn statistics(rows: &[Row]) -> Statistics {
    let table = table(rows);
    Statistics::from_table(&table, &cells(&table), &Options::default()).unwrap()
}

/// The episode table with an additional label.
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
#[expect(clippy::unnecessary_wraps, reason = "a label may be null, and others are")]
fn by_place(row: &Row) -> Option<String> {
    Some(format!("room {} body {}", row.2, row.3))
}

/// The statistics of episodes with these scenes.
fn with_scenes(rows: &[Row], design: Design, scene: impl Fn(&Row) -> Option<String>) -> Statistics {
    let table = labelled(rows, "scene", scene);
    Statistics::from_table(&table, &cells(&table), &Options { design, ..Options::default() }).unwrap()
}

/// Recorded episodes whose scenes follow seed and run.
fn recorded(rows: &[Row]) -> Statistics {
    with_scenes(rows, RECORDED, by_place)
}

fn contrast<'s>(found: &'s Statistics, model: &str, metric: &str, against: &str) -> &'s Contrast {
    let is_it = |it: &&Contrast| it.model == model && it.metric == metric && it.against == against;
    found.conditions.iter().find(is_it).unwrap()
}

/// Three seeds of seven runs. The first `solved` episodes are solved in `steps` steps, the others never.
fn block<'a>(experiment: &'a str, model: &'a str, solved: i32, steps: i64) -> Vec<Row<'a>> {
    let row = |at: i32| (experiment, model, at / 7, at % 7, at < solved, if at < solved { steps } else { -100 });
    (0..21).map(row).collect()
}

/// Experiment, model, number of solved episodes, and their steps.
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
        let is_it = |cell: &&mirrorstats_analysis::statistics::CellRow| {
            cell.metric == metric && key.iter().all(|(name, value)| cell.key[*name] == KeyValue::Text((*value).into()))
        };
        found.cells.iter().find(is_it).unwrap()
    };
    let weak = cell("E1", "weak", "TSA");
    assert_eq!((weak.sum.units(), weak.n, weak.episodes), (5, 21, 21));
    let Intervals::Rate { wilson: Some(wilson), clopper_pearson: Some(exact), jeffreys: Some(jeffreys) } =
        weak.intervals
    else {
        panic!("a rate has the intervals of a rate: {weak:?}")
    };
    // n = 21 and k = 5 at 95 %.
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
fn chance_levels_and_references_come_from_the_definitions() {
    let found = statistics(&study());
    let row = |experiment: &str, model: &str| {
        let of_model = found.chance.iter().filter(|row| row.key.experiment == experiment && row.key.model == model);
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
fn lost_episodes_are_bounded_and_unknown_losses_are_said_to_be_unknown() {
    let table = table(&block("E1", "a", 10, 9)).taken(&(0..18).collect::<Vec<_>>());
    let mut lost = LostCounts::default();
    let cell = CellKey { experiment: "E1".into(), model: "a".into(), condition: "default".into() };
    (0..3).for_each(|_| lost.add(cell.clone()));
    let options = Options { lost: Some(lost), ..Options::default() };
    let found = Statistics::from_table(&table, &cells(&table), &options).unwrap();
    let row = &found.losses.rows[0];
    assert_eq!((row.metric.as_str(), row.lossy.n, row.lossy.successes, row.lossy.lost), ("TSA", 18, 10, 3));
    assert_eq!(row.lossy.bounds, Interval { low: 10.0 / 21.0, high: 13.0 / 21.0 });
    assert!(found.warnings.iter().any(|warning| warning.starts_with("3 episodes were lost without an answer")));
    let unknown = statistics(&block("E1", "a", 10, 9));
    assert!(!unknown.losses.recorded && unknown.warnings.iter().any(|warning| warning.contains("reply_status")));
}

#[test]
fn no_episodes_are_not_an_error() {
    let found = statistics(&[]);
    assert_eq!((found.episodes, found.cells.len(), found.models.len()), (0, 0, 0));
    assert!(found.render(&found.headline, Length::Tables, None).starts_with("0 episodes"));
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
    let text = statistics(&block("E1", "a", 21, 9)).render(&["TSA".into()], Length::Full, None);
    assert!(text.contains("[0.845, 1.000]") && !text.contains("[1.000, 1.000]") && !text.contains(" 0.000"), "{text}");
}

#[test]
fn values_too_large_to_square_are_refused() {
    let table = table(&[
        ("E1", "a", 0, 0, true, i64::MAX),
        ("E1", "a", 0, 1, true, i64::MAX),
        ("E1", "a", 0, 2, true, i64::MAX),
    ]);
    let none = Cells {
        groups: Vec::new(),
        catalog: table.catalog.clone(),
        by: Vec::new(),
        metrics: Vec::new(),
        ranges: Vec::new(),
    };
    let refused = Statistics::from_table(&table, &none, &Options::default()).unwrap_err();
    assert!(refused.to_string().contains("smaller unit"));
}

#[test]
fn the_text_begins_with_the_answers() {
    let found = recorded(&study());
    let blocks = STUDY.map(|(experiment, model, solved, steps)| format!("{experiment} {model} {solved}/21 in {steps}"));
    assert_shown!(blocks.join("\n"), found.render(&found.headline, Length::Tables, None));
}

#[test]
fn names_from_traces_cannot_write_to_the_terminal() {
    let found = statistics(&[block("E1", "evil\u{1b}[2J", 21, 9), block("E1", "b\nc", 0, 9)].concat());
    let text = found.render(&found.headline, Length::Tables, None);
    assert!(!text.contains('\u{1b}') && text.contains("evil\\u{1b}[2J") && text.contains("b\\u{a}c"));
}

#[test]
fn a_rate_that_falls_with_the_dose_has_a_trend_and_one_dose_has_none() {
    let row = |experiment, model, run, successes| (experiment, model, 1, run, run < successes, 5);
    let rows: Vec<Row> = (0..12)
        .flat_map(|run| {
            [row("E1", "a", run, 12), row("E2", "a", run, 4), row("E5", "a", run, 0), row("E1", "b", run, 3)]
        })
        .collect();
    let mut table = table(&rows);
    let values = [("E5", 16.0), ("E1", 0.0), ("E2", 2.0)].map(|(name, dose)| (name.to_owned(), dose));
    let factor = Factor { title: "Delay".to_owned(), unit: "steps".to_owned(), values: values.into() };
    table.catalog.factor.insert("delay".to_owned(), factor);
    let found = Statistics::from_table(&table, &cells(&table), &Options::default()).unwrap();
    let [trend] = found.trends.iter().filter(|row| row.metric == "TSA").collect::<Vec<_>>()[..] else {
        panic!("{:?}", found.trends)
    };
    let doses: Vec<_> = trend.doses.iter().map(|dose| (dose.dose, &*dose.experiment, dose.successes, dose.n)).collect();
    assert_eq!(doses, [(0.0, "E1", 12, 12), (2.0, "E2", 4, 12), (16.0, "E5", 0, 12)]);
    assert_eq!((trend.model.as_str(), trend.verdict), ("a", Verdict::Below));
    // Python: statsmodels 0.15.0, as in the tests of `trend`.
    let z = trend.trend.unwrap().z;
    assert!((z - -4.088_655_679_212_654).abs() < 1e-9, "{z}");
    let text = found.render(&found.headline, Length::Full, None);
    assert!(text.contains("0: 12/12, 2: 4/12, 16: 0/12") && text.contains("falls"), "{text}");
}

#[test]
fn a_trend_of_few_episodes_has_no_verdict() {
    let row = |experiment, run, successes| (experiment, "a", 1, run, run < successes, 5);
    let rows: Vec<Row> = (0..5).flat_map(|run| [row("E1", run, 5), row("E2", run, 0)]).collect();
    let mut table = table(&rows);
    let values = [("E1", 0.0), ("E2", 2.0)].map(|(name, dose)| (name.to_owned(), dose));
    let factor = Factor { title: "Delay".to_owned(), unit: "steps".to_owned(), values: values.into() };
    table.catalog.factor.insert("delay".to_owned(), factor);
    let found = Statistics::from_table(&table, &cells(&table), &Options::default()).unwrap();
    let trend = found.trends.iter().find(|row| row.metric == "TSA").unwrap();
    assert_eq!((trend.p_adjusted, trend.verdict), (None, Verdict::NotSeparated));
    let text = found.render(&found.headline, Length::Full, None);
    assert!(text.contains("cannot say: 10 episodes"), "{text}");
}

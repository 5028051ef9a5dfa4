//! `stats --sequential` on episode tables with known answers.

#![expect(clippy::unreadable_literal, reason = "reference values as their sources print them")]

use indexmap::IndexMap;
use mirrorstats_analysis::statistics::{Options, Sequential, Verdict};
use mirrorstats_exact::chance::Chance;
use mirrorstats_exact::ratio::Ratio;
use mirrorstats_metric::catalogs::catalog::{Better, Catalog, Experiment, Kind, Metric, StandardError};
use mirrorstats_score::tables::table::{Declared, EpisodeKey, EpisodeTable, LabelColumn, MetricColumn};

use crate::assert_shown;

fn metric(kind: Kind) -> Metric {
    Metric {
        title: String::new(),
        kind,
        unit: String::new(),
        decimals: 0,
        better: Better::Higher,
        section: String::new(),
        help: String::new(),
        value: String::new(),
        when: None,
        se: StandardError::Sample,
        chance: None,
        measures: None,
        range: None,
        finished: None,
        completes: None,
    }
}

/// TSA, 1/3 by chance in E1 and without a level in E2; TTD, which is not a rate; MCR, a rate without a level.
fn catalog() -> Catalog {
    let chance = IndexMap::from([("TSA".to_owned(), "1/3".parse::<Ratio>().ok().map(Chance::Of))]);
    let experiment = |order, chance| {
        let (title, reference) = (String::new(), IndexMap::new());
        Experiment { title, order, chance, reference, is_declared: false, control: None }
    };
    Catalog {
        columns: IndexMap::new(),
        name: "test".into(),
        domain: None,
        hash: "0".repeat(64),
        open: false,
        lets: IndexMap::new(),
        metric: [("TSA", Kind::Rate), ("TTD", Kind::Quantity), ("MCR", Kind::Rate)]
            .map(|(name, kind)| (name.to_owned(), metric(kind)))
            .into(),
        experiment: IndexMap::from([
            ("E1".to_owned(), experiment(1, chance)),
            ("E2".to_owned(), experiment(2, IndexMap::new())),
        ]),
        factor: IndexMap::new(),
    }
}

/// Experiment, model, and the number of solved scenes: the first ones of 21.
type Block<'a> = (&'a str, &'a str, i32);

const STUDY: [Block; 4] = [("E1", "middle", 13), ("E1", "strong", 21), ("E1", "weak", 5), ("E2", "strong", 7)];

fn sequential(blocks: &[Block]) -> Sequential {
    with_scenes(blocks, 1, |_, at| Some(format!("room {at}")))
}

/// Each of 21 scenes is played `repeats` times, and is solved every time or never.
fn with_scenes(blocks: &[Block], repeats: i32, scene: impl Fn(&str, i32) -> Option<String>) -> Sequential {
    let times = || blocks.iter().flat_map(|block| (0..21 * repeats).map(move |run| (block, run)));
    let rows = || times().map(|(block, run)| (block, run / repeats));
    let keys = times().map(|((experiment, model, _), at)| EpisodeKey {
        experiment: (*experiment).into(),
        model: (*model).into(),
        seed: at / 7,
        run: at % 7,
        episode_id: format!("{experiment}/{model}/{at}"),
    });
    let solved = || rows().map(|((.., solved), at)| Some(i64::from(at < *solved)));
    let table = EpisodeTable {
        catalog: catalog(),
        declared: Declared::default(),
        keys: keys.collect(),
        labels: vec![LabelColumn {
            name: "scene".into(),
            values: rows()
                .map(|(block, at)| scene(block.1, at))
                .collect::<Vec<_>>()
                .iter()
                .map(Option::as_deref)
                .collect(),
        }],
        metrics: vec![
            MetricColumn::new("TSA", solved()),
            MetricColumn::new("TTD", rows().map(|(_, at)| Some(i64::from(at)))),
            MetricColumn::new("MCR", rows().map(|(_, at)| (at > 0).then_some(1))),
        ],
    };
    Sequential::from_table(&table, &Options::default()).unwrap()
}

// The e-values and bounds are those in the tests of `stats::sequential`, which name their sources.
#[test]
fn rates_are_compared_with_chance_by_e_values() {
    let found = sequential(&STUDY);
    assert_eq!(found.headline, ["TSA"]);
    let of = |model: &str| found.chance.iter().find(|row| row.key.model == model).unwrap();
    let (middle, strong) = (of("middle"), of("strong"));
    assert!((middle.e - 6.1113961330979905).abs() < 1e-9 && middle.verdict == Verdict::NotSeparated, "{middle:?}");
    assert!(strong.e > 1e8 && strong.verdict == Verdict::Above, "{strong:?}");
    assert!((middle.p_adjusted - 2.0 * middle.p).abs() < 1e-12, "the second of three in Holm's order");
    assert_eq!(found.chance.len(), 3, "E2 has no level");
    let all = found.rates.iter().find(|row| row.key.model == "strong" && row.key.experiment == "E1").unwrap();
    let bounds = all.interval.unwrap();
    assert!((bounds.low - 0.7845213905698409).abs() < 1e-10 && bounds.high >= 1.0, "{bounds:?}");
}

// 8 and 8 discordant pairs, all one way: 2^8 B(8.5, 0.5) / B(0.5, 0.5) = 50.27 by scipy 1.17.1; 16 give 9171.76.
#[test]
fn models_are_compared_by_their_discordant_pairs() {
    let found = sequential(&STUDY);
    let pairs: Vec<_> = found.models.iter().filter(|pair| pair.metric == "TSA").collect();
    let named: Vec<_> = pairs.iter().map(|pair| (pair.first.as_str(), pair.second.as_str(), pair.verdict)).collect();
    let above = Verdict::Above;
    assert_eq!(named, [("strong", "middle", above), ("strong", "weak", above), ("middle", "weak", above)]);
    for (pair, e) in pairs.iter().zip([50.2734375, 9171.758880615234, 50.2734375]) {
        assert!((pair.e / e - 1.0).abs() < 1e-9, "{pair:?}");
        assert!((pair.p - 1.0 / pair.e).abs() < 1e-15);
    }
    let alike = found.models.iter().find(|pair| pair.metric == "MCR").unwrap();
    assert_eq!((alike.e, alike.p, alike.verdict), (1.0, 1.0, Verdict::NotSeparated));
}

// Without shared scenes, the i-th episodes of two models are a pair. A scene counts once. Both give the same evidence.
#[test]
fn models_without_equal_scenes_are_compared_and_repeats_count_once() {
    let by_scene = sequential(&STUDY);
    let alone = with_scenes(&STUDY, 1, |model, at| Some(format!("{model} {at}")));
    let repeated = with_scenes(&STUDY, 3, |_, at| Some(format!("room {at}")));
    let evidence = |found: &Sequential| found.models.iter().map(|pair| pair.e).collect::<Vec<_>>();
    assert_eq!((evidence(&alone), evidence(&repeated)), (evidence(&by_scene), evidence(&by_scene)));
    assert_eq!([&by_scene, &alone, &repeated].map(|found| found.models[0].shared), [21, 0, 21]);
}

#[test]
fn the_text_states_its_purpose() {
    let found = sequential(&STUDY);
    let blocks = STUDY.map(|(experiment, model, solved)| format!("{experiment} {model} {solved}/21"));
    assert_shown!(blocks.join("\n"), found.render(&found.headline, None));
}

#[test]
fn names_from_traces_cannot_write_to_the_terminal() {
    let found = sequential(&[("E1", "b\nc", 0), ("E1", "evil\u{1b}[2J", 21)]);
    let text = found.render(&found.headline, None);
    assert!(!text.contains('\u{1b}') && text.contains("evil\\u{1b}[2J") && text.contains("b\\u{a}c"), "{text}");
}

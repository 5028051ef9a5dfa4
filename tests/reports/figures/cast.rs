//! Data to draw figures from: the paper's published cells as counts, and made-up casts of any size.

use std::collections::BTreeMap;

use indexmap::IndexMap;
use mirrorstats_analysis::statistics::{Options, Statistics};
use mirrorstats_exact::chance::Chance;
use mirrorstats_exact::moments::Moments;
use mirrorstats_exact::ratio::Ratio;
use mirrorstats_figures::Input;
use mirrorstats_figures::e5_outcomes::Outcomes;
use mirrorstats_metric::catalogs::catalog::{Better, Catalog, Experiment, Factor, Kind, Metric, StandardError};
use mirrorstats_score::cells::{Cells, Group, KeyValue};
use mirrorstats_score::tables::table::{Declared, EpisodeKey, EpisodeTable, KeyRef, MetricColumn};
use mirrorstats_score::timeline::Timeline;

const METRICS: [&str; 7] = ["TSA", "TTD", "MCR", "MTATO", "CAAL", "CR", "TSA-C"];
const TITLES: [(&str, &str); 5] = [
    ("E1", "Active Mirror-Based Self-Identification"),
    ("E2", "Self-Identification Without Perceptual Evidence"),
    ("E3", "Self-Identification Under Conflicting Language"),
    ("E4", "Self–Other Disambiguation via Action"),
    ("E5", "Robust Open-Ended Self-Attribution Under Clutter"),
];

/// Everything that a figure may need.
#[derive(Clone, Debug)]
pub struct Cast {
    pub cells: Cells,
    pub episodes: EpisodeTable,
    pub outcomes: Outcomes,
    pub timelines: Vec<Timeline>,
    /// Of TSA alone.
    pub statistics: Statistics,
}

impl Cast {
    pub fn input(&self) -> Input<'_> {
        Input {
            episodes: Some(&self.episodes),
            outcomes: Some(&self.outcomes),
            timelines: Some(&self.timelines),
            statistics: Some(&self.statistics),
            ..Input::of_cells(&self.cells)
        }
    }

    fn new(cells: Cells) -> Self {
        let episodes = episodes(&cells);
        let timelines = timelines(&episodes);
        let outcomes = outcomes(&cells);
        let statistics = statistics(&cells, &episodes);
        Self { cells, episodes, outcomes, timelines, statistics }
    }

    /// The cast without the groups for which `is_gone` is true.
    pub fn without(&self, is_gone: impl Fn(&str, &str) -> bool) -> Self {
        let mut cells = self.cells.clone();
        cells.groups.retain(|group| !is_gone(&group.key[0].to_string(), &group.key[1].to_string()));
        Self::new(cells)
    }
}

/// The paper's 40 cells: counts out of 21 that print as published, and durations summed to the nearest step.
pub fn paper() -> Cast {
    let main = published(include_str!("../../../fixtures/published/main_table.csv"));
    let appendix = published(include_str!("../../../fixtures/published/appendix_table.csv"));
    let mut groups: BTreeMap<(String, String), Vec<Moments>> = BTreeMap::new();
    for (experiment, model) in main.keys().map(|(e, m, _)| (e.clone(), m.clone())) {
        let value = |metric: &str| {
            let key = (experiment.clone(), model.clone(), metric.to_owned());
            main.get(&key).or_else(|| appendix.get(&key)).copied().flatten()
        };
        let successes = value("TSA").map_or(0, |mean| rounded(mean * 21.0));
        let moments = METRICS.map(|metric| match (metric, value(metric)) {
            (_, None) => Moments::default(),
            ("TTD", Some(mean)) => of_sum(rounded(mean * 21.0), 21),
            ("MTATO", Some(mean)) => rate(rounded(mean * f64::from(successes)), successes),
            ("TSA-C", Some(mean)) => {
                rate(successes, rounded(f64::from(successes) / mean.max(0.01)).clamp(successes, 21))
            }
            (_, Some(mean)) => rate(rounded(mean * 21.0), 21),
        });
        groups.entry((experiment.clone(), model.clone())).or_insert_with(|| moments.to_vec());
    }
    let groups = groups.into_iter().map(|((experiment, model), moments)| Group {
        key: vec![KeyValue::Text(experiment), KeyValue::Text(model)],
        episodes: 21,
        moments,
        repeats: false,
    });
    Cast::new(cells(groups.collect()))
}

/// `models` with made-up counts out of 21 in all five experiments, including ties, extremes and undefined cells.
pub fn made_up(models: &[String]) -> Cast {
    let mut groups = Vec::new();
    for (e, (experiment, _)) in TITLES.iter().enumerate() {
        for (m, model) in models.iter().enumerate() {
            let dice = |salt: usize| u32::try_from((e * 31 + m * 17 + salt * 7 + (m * e) % 5) % 22).unwrap();
            let successes = if (m + e) % 6 == 0 { 0 } else { dice(1) };
            let finished = successes.max(dice(2));
            let moments = vec![
                rate(successes, 21),
                of_sum(21 * 3 + dice(3) * 90, 21),
                rate(dice(4), 21),
                rate(successes / 2, successes),
                rate(dice(5), 21),
                rate(dice(6), 21),
                rate(successes, finished),
            ];
            let key = vec![KeyValue::Text((*experiment).to_owned()), KeyValue::Text(model.clone())];
            groups.push(Group { key, episodes: 21, moments, repeats: false });
        }
    }
    groups.sort_by(|a, b| a.key.cmp(&b.key));
    Cast::new(cells(groups))
}

/// Names of `length` letters that differ only in the middle.
pub fn names(count: usize, length: usize) -> Vec<String> {
    let name = |i: usize| {
        let core = format!("m{i:02}");
        let filling = "vendor/Long-Context-Instruct-Preview-2026-04-32B";
        let (head, tail) = filling.split_at(length.saturating_sub(core.len()) / 2);
        let tail: String = tail.chars().rev().take(length - head.len() - core.len()).collect();
        format!("{head}{core}{tail}")
    };
    (0..count).map(name).collect()
}

fn cells(groups: Vec<Group>) -> Cells {
    let text = |name: &str| name.to_owned();
    Cells {
        catalog: catalog(),
        by: vec![text("experiment"), text("model")],
        metrics: METRICS.map(text).into(),
        ranges: Vec::new(),
        groups,
    }
}

fn catalog() -> Catalog {
    let metric = |name: &str| Metric {
        title: name.to_owned(),
        kind: if name == "TTD" { Kind::Quantity } else { Kind::Rate },
        unit: String::new(),
        decimals: 0,
        better: if matches!(name, "TTD" | "CR") { Better::Lower } else { Better::Higher },
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
    };
    let experiment = |(at, (name, title)): (usize, &(&str, &str))| {
        let chance = if *name == "E5" { None } else { Ratio::new(1, 3) };
        let levels = if *name == "E5" { vec![Ratio::new(1, 10).unwrap(), Ratio::new(1, 11).unwrap()] } else { vec![] };
        let experiment = Experiment {
            title: (*title).to_owned(),
            order: i64::try_from(at).unwrap(),
            chance: IndexMap::from([("TSA".to_owned(), chance.map(Chance::Of))]),
            reference: IndexMap::from([("TSA".to_owned(), levels)]),
            is_declared: false,
            control: None,
        };
        ((*name).to_owned(), experiment)
    };
    let doses = [("E4", 2.0), ("E1", 0.0), ("E2", 16.0), ("E3", 1.0), ("E5", 32.0)];
    let factor = Factor {
        title: "Delay of the mirror".to_owned(),
        unit: "steps".to_owned(),
        values: doses.map(|(name, dose)| (name.to_owned(), dose)).into(),
    };
    Catalog {
        columns: IndexMap::new(),
        name: "test".to_owned(),
        domain: None,
        hash: "0".repeat(64),
        open: false,
        lets: IndexMap::new(),
        metric: METRICS.iter().map(|name| ((*name).to_owned(), metric(name))).collect(),
        experiment: TITLES.iter().enumerate().map(experiment).collect(),
        factor: IndexMap::from([("delay".to_owned(), factor)]),
    }
}

/// Episodes with made-up last steps and decisions; as many have a decision as TSA-C has values.
fn episodes(cells: &Cells) -> EpisodeTable {
    let mut keys = Vec::new();
    let (mut ttd, mut finished) = (Vec::new(), Vec::new());
    for group in &cells.groups {
        for run in 0..21_i32 {
            let is_finished = u64::try_from(run).unwrap() < group.moments[6].n;
            let shift = i64::try_from(group.key[1].to_string().len()).unwrap();
            keys.push(EpisodeKey {
                experiment: group.key[0].to_string(),
                model: group.key[1].to_string(),
                seed: run % 3,
                run: run / 3,
                episode_id: format!("{}-{}-{run}", group.key[0], group.key[1]),
            });
            let spread = i64::from(run * run % 23) * (2 + shift % 3);
            ttd.push(Some(if is_finished { 4 + shift + spread } else { 100 - i64::from(run % 4) * 5 }));
            finished.push(is_finished.then_some(1));
        }
    }
    let column = |name: &str, values: Vec<Option<i64>>| MetricColumn::new(name, values);
    EpisodeTable {
        catalog: cells.catalog.clone(),
        keys: keys.into_iter().collect(),
        labels: Vec::new(),
        declared: Declared::default(),
        metrics: vec![column("TTD", ttd), column("TSA-C", finished)],
    }
}

/// As many successes as TSA has in each group.
fn statistics(cells: &Cells, episodes: &EpisodeTable) -> Statistics {
    let mut sums = BTreeMap::new();
    for group in &cells.groups {
        sums.insert(group.key.iter().map(ToString::to_string).collect::<Vec<_>>(), group.moments[0].sum);
    }
    let mut seen: BTreeMap<Vec<String>, i128> = BTreeMap::new();
    let value = |key: KeyRef<'_>| {
        let key = vec![key.experiment.to_owned(), key.model.to_owned()];
        let (sum, count) = (sums[&key], seen.entry(key).or_default());
        *count += 1;
        Some(i64::from(*count <= sum))
    };
    let values: Vec<Option<i64>> = episodes.keys.iter().map(value).collect();
    let metrics = vec![MetricColumn::new("TSA", values)];
    let table = EpisodeTable { metrics, ..episodes.clone() };
    Statistics::from_table(&table, cells, &Options::default()).unwrap()
}

fn timelines(episodes: &EpisodeTable) -> Vec<Timeline> {
    let timeline = |((key, ttd), finished): ((KeyRef<'_>, Option<i64>), Option<i64>)| {
        let length = u32::try_from(ttd.unwrap_or(1)).unwrap();
        let sight = (key.experiment != "E2").then_some(1 + length / 5).filter(|&step| step <= length);
        let run = |from: u32, to: u32| (from <= to.min(length)).then_some(from..=to.min(length));
        let visible = sight.into_iter().flat_map(|s| [run(s, s + 3), run(s + 8, s + 9 + length / 4)]).flatten();
        Timeline {
            key: key.to_owned(),
            length,
            visible: visible.collect(),
            first_sight: sight,
            claim: (length % 3 != 0).then_some((2 + length / 3).min(length)),
            decision: finished.map(|_| length),
            answered: finished.is_some(),
        }
    };
    let [ttd, finished] = [0, 1].map(|at| episodes.metrics[at].iter());
    episodes.keys.iter().zip(ttd).zip(finished).map(timeline).collect()
}

fn outcomes(cells: &Cells) -> Outcomes {
    let rows = cells.groups.iter().filter(|group| group.key[0].to_string() == "E5").map(|group| {
        let correct = u64::try_from(group.moments[0].sum).unwrap();
        let wrong = (group.episodes - correct) / 3;
        (group.key[1].to_string(), [correct, wrong, group.episodes - correct - wrong])
    });
    Outcomes { experiment: "E5".to_owned(), rows: rows.collect() }
}

type Published = BTreeMap<(String, String, String), Option<f64>>;

fn published(text: &str) -> Published {
    let mut rows = csv::Reader::from_reader(text.as_bytes());
    let row = |row: csv::StringRecord| {
        let field = |at: usize| row[at].to_owned();
        ((field(0), field(1), field(2)), row[3].parse().ok())
    };
    rows.records().map(|record| row(record.unwrap())).collect()
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "counts and sums of steps are small")]
fn rounded(value: f64) -> u32 {
    value.round() as u32
}

fn rate(ones: u32, n: u32) -> Moments {
    Moments { n: u64::from(n), sum: i128::from(ones), sum_sq: i128::from(ones) }
}

fn of_sum(sum: u32, n: u32) -> Moments {
    Moments { n: u64::from(n), sum: i128::from(sum), sum_sq: i128::from(sum) * i128::from(sum) }
}

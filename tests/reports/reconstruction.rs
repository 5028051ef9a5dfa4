//! The rebuilt episodes print the published tables, and the committed traces equal the generator's output.
//!
//! Metrics, standard errors and rounding are computed again here, in plain loops and without the library. This judges
//! the reconstruction independently of the code that made it.

#[path = "../../examples/reconstruct/reconstruction/mod.rs"]
mod rebuilt;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::sync::LazyLock;

use mirrorstats_trace::episodes::episode::{Action, Episode, Step};

use crate::harness::files::fixture;

use rebuilt::errata::ERRATA;
use rebuilt::files::{self, Trace};
use rebuilt::published::{self, Source, Value};
use rebuilt::scene::PALETTE;

static TRACES: LazyLock<Vec<Trace>> = LazyLock::new(|| files::traces().unwrap());

fn episodes() -> impl Iterator<Item = &'static Episode> {
    TRACES.iter().flat_map(|trace| &trace.episodes)
}

/// The steps of an episode, counted from t = 1.
struct Watched<'a> {
    episode: &'a Episode,
    /// The first `done`.
    done: Option<usize>,
    /// The first `done`, or the last step.
    finish: usize,
}

impl<'a> Watched<'a> {
    fn of(episode: &'a Episode) -> Self {
        let mut done = None;
        for (index, step) in episode.steps.iter().enumerate() {
            if step.action == Some(Action::Done) && done.is_none() {
                done = Some(index + 1);
            }
        }
        Self { episode, done, finish: done.unwrap_or(episode.steps.len()) }
    }

    fn step(&self, t: usize) -> &Step {
        &self.episode.steps[t - 1]
    }

    fn says_truth(&self, t: usize) -> bool {
        self.step(t).self_color.as_deref() == Some(&self.episode.body_color)
    }

    fn commits(&self, t: usize) -> bool {
        self.step(t).self_color.as_deref().is_some_and(|color| color != "unknown")
    }

    /// The first t from 1 to `last` for which `holds` is true.
    fn first(&self, last: usize, holds: impl Fn(&Self, usize) -> bool) -> Option<usize> {
        (1..=last).find(|&t| holds(self, t))
    }

    fn sees(&self, t: usize) -> bool {
        self.step(t).mirror_visible
    }

    fn tsa(&self) -> bool {
        let Some(done) = self.done else { return false };
        let step = self.step(done);
        let decision = if self.episode.experiment == "E5" { &step.self_color } else { &step.selected_cube };
        decision.as_deref() == Some(&self.episode.body_color)
    }

    fn mcr(&self) -> bool {
        self.first(self.finish - 1, Self::sees).is_some()
    }

    fn cr(&self) -> bool {
        let mirror = self.first(self.finish - 1, Self::sees);
        match (self.first(self.finish - 1, Self::commits), mirror) {
            (Some(claim), Some(mirror)) => claim < mirror,
            (Some(_), None) => true,
            (None, _) => false,
        }
    }

    fn applicable(&self) -> bool {
        let Some(sight) = self.first(self.episode.steps.len(), Self::sees) else { return false };
        self.first(sight - 1, Self::commits).is_some_and(|guess| !self.says_truth(guess))
    }

    fn corrected(&self) -> bool {
        let sight = self.first(self.episode.steps.len(), Self::sees);
        sight.is_some_and(|sight| (sight..=self.finish).any(|t| self.says_truth(t)))
    }

    /// The ten metrics; `None` where one is undefined.
    fn metrics(&self) -> [(&'static str, Option<i32>); 10] {
        let (tsa, mcr, applicable) = (self.tsa(), self.mcr(), self.applicable());
        let seen = (1..=self.episode.steps.len()).filter(|&t| self.sees(t)).count();
        [
            ("TSA", Some(tsa.into())),
            ("TTD", Some(i32::try_from(self.finish).unwrap())),
            ("MCR", Some(mcr.into())),
            ("MTATO", tsa.then_some(mcr.into())),
            ("CAAL", Some((1..self.finish).any(|t| self.says_truth(t)).into())),
            ("CR", Some(self.cr().into())),
            ("TSA-C", self.done.map(|_| tsa.into())),
            ("MGD", Some(i32::try_from(seen).unwrap())),
            ("SC", applicable.then(|| self.corrected().into())),
            ("AR_SC", Some(applicable.into())),
        ]
    }
}

type Cells = BTreeMap<(String, String, &'static str), Vec<i32>>;

/// The defined values of each experiment, model and metric.
fn cells() -> Cells {
    let mut cells = Cells::new();
    for episode in episodes() {
        for (metric, value) in Watched::of(episode).metrics() {
            let key = (episode.experiment.clone(), episode.model.clone(), metric);
            cells.entry(key).or_default().extend(value);
        }
    }
    cells
}

/// Unrounded mean and standard error of some values; the standard error of one value is 0.
fn mean_and_se(values: &[i32], metric: &str) -> (f64, f64) {
    let n = i32::try_from(values.len()).unwrap();
    let sum: i32 = values.iter().sum();
    let squares: i32 = values.iter().map(|value| value * value).sum();
    let freedom = if metric == "AR_SC" { n } else { n - 1 };
    let spread = n * squares - sum * sum;
    let mean = f64::from(sum) / f64::from(n);
    let se = if spread == 0 { 0.0 } else { (f64::from(spread) / f64::from(n * n * freedom)).sqrt() };
    (mean, se)
}

fn rounded(number: f64, source: Source) -> String {
    match source {
        Source::Appendix => format!("{number:.2}"),
        Source::Prose => format!("{number:.3}"),
        Source::Main => {
            let three = format!("{number:.3}");
            let (kept, dropped) = three.split_at(three.len() - 1);
            let step = if dropped >= "5" { 0.01 } else { 0.0 };
            format!("{:.2}", kept.parse::<f64>().unwrap() + step)
        }
    }
}

/// A cell as `source` prints it. The main table prints an undefined value as `0.00`, the appendix as `--`.
fn printed(values: &[i32], metric: &str, source: Source) -> Option<Value> {
    if values.is_empty() {
        let zero = Value { mean: "0.00".into(), se: "0.00".into() };
        return (source == Source::Main).then_some(zero);
    }
    let (mean, se) = mean_and_se(values, metric);
    Some(Value { mean: rounded(mean, source), se: rounded(se, source) })
}

#[test]
fn all_published_cells_but_one_are_reproduced() {
    let cells = cells();
    let mut differing = Vec::new();
    let mut checked = 0;
    for source in Source::ALL {
        for row in published::rows(source) {
            let found = cells
                .iter()
                .find(|((experiment, model, metric), _)| {
                    (experiment, model, *metric) == (&row.experiment, &row.model, &row.metric)
                })
                .map(|(key, values)| printed(values, key.2, source));
            checked += 1;
            if found.as_ref() != Some(&row.value()) {
                let found = found.flatten().map(|value| format!("{} ± {}", value.mean, value.se));
                differing.push(format!("{source:?} {} {} {}: {found:?}", row.experiment, row.model, row.metric));
            }
        }
    }
    assert_eq!(differing, [r#"Main E3 Gemma4 26B TTD: Some("57.91 ± 10.07")"#]);
    assert_eq!(checked, 240 + 280 + 53);
}

#[test]
fn only_mtato_and_sc_have_undefined_cells() {
    let undefined: Vec<_> = cells().into_iter().filter(|(_, values)| values.is_empty()).map(|(key, _)| key).collect();
    let mtato: Vec<_> = undefined.iter().filter(|key| key.2 == "MTATO").map(|key| (&*key.0, &*key.1)).collect();
    assert_eq!(mtato, [("E2", "Ministral 3 14B"), ("E5", "Ministral 3 14B")]);
    let others: BTreeSet<_> = undefined.iter().map(|key| key.2).filter(|&metric| metric != "MTATO").collect();
    assert_eq!(others, BTreeSet::from(["SC"]));
}

#[test]
fn the_solver_finds_exactly_the_known_contradictions() {
    let found: Vec<_> = rebuilt::contradictions();
    let shown: Vec<String> = found.iter().map(|(cell, erratum)| format!("{cell}; {}", erratum.unwrap())).collect();
    assert_eq!(
        shown,
        [
            "E2, Ministral 3 14B, MTATO: published 0.00 ± 0.00 (main); it has no episode to be defined on; \
             read as undefined: no episode succeeds, so by the paper's own definition the value is undefined",
            "E3, Gemma4 26B, TTD: published 57.90 ± 10.07 (main); no sum of 21 integers prints as this mean: \
             the sum 1215 prints as 57.86, the sum 1216 prints as 57.91; \
             read as 57.91 ± 10.07: a mean of 21 integers near 57.90 can only be 1216/21 = 57.9048, \
             which the table's rounding prints as 57.91",
            "E5, Ministral 3 14B, MTATO: published 0.00 ± 0.00 (main); it has no episode to be defined on; \
             read as undefined: no episode succeeds, so by the paper's own definition the value is undefined",
        ]
    );
    assert_eq!(found.len(), ERRATA.len(), "every erratum answers a contradiction");
}

#[test]
fn the_committed_traces_equal_the_generated_ones() {
    let differences = files::differences(&fixture("paper"), &TRACES).unwrap();
    assert!(
        differences.is_empty(),
        "run `cargo run --example reconstruct -- fixtures/paper`:\n{}",
        differences.join("\n")
    );
}

#[test]
fn a_changed_a_missing_and_a_foreign_file_are_noticed() {
    let folder = tempfile::tempdir().unwrap();
    files::write(folder.path(), &TRACES[..3]).unwrap();
    assert!(files::differences(folder.path(), &TRACES[..3]).unwrap().is_empty());
    let [changed, missing, foreign] = [0, 1, 2].map(|i| TRACES[i].name.as_str());
    let mut bytes = fs::read(folder.path().join(changed)).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    fs::write(folder.path().join(changed), bytes).unwrap();
    fs::remove_file(folder.path().join(missing)).unwrap();
    let differences = files::differences(folder.path(), &TRACES[..2]).unwrap();
    let names: Vec<&str> = differences.iter().map(|line| line.split(':').next().unwrap()).collect();
    assert_eq!(names, [changed, missing, foreign]);
}

#[test]
fn the_fixture_is_the_grid_of_the_study() {
    assert_eq!((TRACES.len(), episodes().count()), (40, 840));
    let ids: BTreeSet<&str> = episodes().map(|episode| episode.episode_id.as_str()).collect();
    assert_eq!(ids.len(), 840);
    for trace in &*TRACES {
        let places: Vec<_> = trace.episodes.iter().map(|episode| (episode.seed, episode.run)).collect();
        let grid: Vec<_> = (1..=3).flat_map(|seed| (1..=7).map(move |run| (seed, run))).collect();
        assert_eq!(places, grid, "{}", trace.name);
        assert_eq!(trace.recording["kind"], "reconstruction", "{}", trace.name);
    }
    let size: u64 = TRACES.iter().map(|trace| fs::metadata(fixture("paper").join(&trace.name)).unwrap().len()).sum();
    assert!(size < 2_000_000, "{size} bytes");
}

#[test]
fn every_episode_is_one_that_could_have_been_recorded() {
    for episode in episodes() {
        let id = &episode.episode_id;
        let (last, before) = episode.steps.split_last().unwrap();
        assert!(episode.steps.len() <= 100, "{id}");
        assert!(before.iter().all(|step| step.action != Some(Action::Done)), "{id}: rows after done");
        let chosen = before.iter().filter_map(|step| step.selected_cube.as_deref()).all(|cube| cube == "none");
        assert!(chosen, "{id}: a cube before done");
        let e5 = episode.experiment == "E5";
        assert_eq!(last.selected_cube.is_none(), e5, "{id}");
        let colors: BTreeSet<_> = episode.steps.iter().filter_map(|step| step.self_color.as_deref()).collect();
        assert!(colors.iter().all(|color| *color == "unknown" || PALETTE.contains(color)), "{id}: {colors:?}");
        let cube = last.selected_cube.as_deref().filter(|cube| *cube != "none");
        assert_eq!(cube.is_some(), !e5 && last.action == Some(Action::Done), "{id}: {cube:?}");
        assert!(cube.is_none_or(|cube| PALETTE.contains(&cube)), "{id}: {cube:?}");
        let blind = episode.steps.iter().all(|step| !step.mirror_visible);
        assert!(episode.experiment != "E2" || blind, "{id}: a mirror in E2");
        let stated = episode.stated_color.as_deref();
        assert_eq!(stated.is_some_and(|color| color != episode.body_color), episode.experiment == "E3", "{id}");
        let crowd = episode.distractors.is_some_and(|others| (1..=6).contains(&others));
        assert_eq!(crowd, matches!(&*episode.experiment, "E4" | "E5"), "{id}");
    }
}

#[test]
fn all_models_meet_the_same_scenes() {
    let mut scenes = BTreeMap::new();
    for episode in episodes() {
        let scene = (&episode.body_color, &episode.stated_color, episode.distractors);
        let known = *scenes.entry((&episode.experiment, episode.seed, episode.run)).or_insert(scene);
        assert_eq!(known, scene, "{}", episode.episode_id);
    }
    assert_eq!(scenes.len(), 5 * 21);
}

/// Four pairs have published lengths that leave no other way. In E3 of Gemma4 26B, lengths and gazes together would
/// need episodes of one step and agents that never look away.
#[test]
fn trajectories_without_done_run_to_the_budget_but_in_five_pairs() {
    let cut: BTreeSet<_> = episodes()
        .filter(|episode| Watched::of(episode).done.is_none() && episode.steps.len() < 100)
        .map(|episode| (&*episode.experiment, &*episode.model))
        .collect();
    let known = [
        ("E2", "Gemini 2.5 Pro"),
        ("E2", "Gemma4 31B"),
        ("E3", "Gemma4 26B"),
        ("E3", "Gemma4 31B"),
        ("E3", "Qwen 3.6 Plus"),
    ];
    assert_eq!(cut, BTreeSet::from(known));
}

#[test]
fn successes_and_lengths_are_spread_over_the_seeds() {
    for trace in &*TRACES {
        let mut successes = [0; 3];
        let mut lengths = [0; 3];
        for episode in &trace.episodes {
            let seed = usize::try_from(episode.seed - 1).unwrap();
            successes[seed] += i32::from(Watched::of(episode).tsa());
            lengths[seed] += episode.steps.len();
        }
        let some = successes.iter().filter(|&&n| n > 0).count();
        assert!(some >= 2 || successes.iter().sum::<i32>() < 3, "{}: {successes:?}", trace.name);
        assert!(lengths.iter().collect::<BTreeSet<_>>().len() >= 2, "{}: {lengths:?}", trace.name);
    }
}

/// For each way to misread a definition by one step or one word, some episode distinguishes the readings.
#[test]
fn the_edges_of_the_definitions_occur() {
    let occurs = |edge: fn(&Watched) -> bool| episodes().any(|episode| edge(&Watched::of(episode)));
    let first_sight = |r: &Watched| r.first(r.episode.steps.len(), Watched::sees);
    assert!(occurs(|r| !r.mcr() && r.sees(r.finish)), "the mirror is first seen at the end");
    assert!(occurs(|r| r.tsa() && !r.mcr()), "a success without the mirror");
    assert!(occurs(|r| r.says_truth(r.finish) && !(1..r.finish).any(|t| r.says_truth(t))), "truth only at the end");
    assert!(occurs(|r| r.first(r.finish, Watched::commits) == Some(r.finish)), "a claim only at the end");
    assert!(occurs(|r| r.done.is_none() && r.sees(r.finish)), "a look at the last step of an unfinished episode");
    let same_step: fn(&Watched) -> bool = |r| {
        r.mcr() && {
            let sight = r.first(r.finish, Watched::sees);
            r.first(r.finish, Watched::commits) == sight
        }
    };
    assert!(occurs(same_step), "claim and first sight in one step");
    assert!(episodes().any(|e| first_sight(&Watched::of(e)) == Some(1)), "the mirror in view from the start");
    assert!(occurs(|r| r.episode.steps.iter().any(|step| step.self_color.is_none())), "a lost reply");
}

use std::collections::{BTreeMap, HashMap};

use super::{Blind, Clues, Puzzle, asked, bayes, chance, puzzles};
use crate::config::WorldConfig;
use mirrorstats_experiment::spec::{Fact, PaneKind};
use mirrorstats_experiment::{Experiment, built_in_names, file};
use mirrorstats_toml_spec::Source;

/// The share of right answers among the nearest known clues, by the number of clues that differ.
fn neighbours(puzzles: &[Puzzle]) -> impl Fn(&Clues) -> f64 + use<> {
    let mut known: HashMap<Clues, [u32; 2]> = HashMap::new();
    for puzzle in puzzles.iter().filter(|puzzle| !puzzle.is_test) {
        for (answer, clues) in puzzle.clues.iter().enumerate() {
            known.entry(*clues).or_default()[usize::from(answer == puzzle.right)] += 1;
        }
    }
    move |clues| {
        let mut by_distance = [[0_u32; 2]; 13];
        for (other, [wrong, right]) in &known {
            let distance = clues.iter().zip(other).map(|(one, other)| usize::from(one != other)).sum::<usize>();
            by_distance[distance][0] += wrong;
            by_distance[distance][1] += right;
        }
        let [wrong, right] = by_distance.into_iter().find(|[wrong, right]| wrong + right > 0).unwrap().map(f64::from);
        right / (wrong + right)
    }
}

/// The rates of both players and the level that they must not exceed; `None` if there is nothing to guess.
fn rates(experiment: &Experiment, scenes: usize) -> Option<[Blind; 2]> {
    let puzzles = puzzles(&WorldConfig::default(), experiment, scenes).unwrap();
    let chance = chance(experiment, &puzzles)?;
    Some([
        Blind::of_player(&puzzles, chance, &bayes(&puzzles)),
        Blind::of_player(&puzzles, chance, &neighbours(&puzzles)),
    ])
}

/// Experiments by their keys other than title and prompt.
fn experiments(all: &[&str]) -> Vec<Experiment> {
    let whole = |(at, keys): (usize, &&str)| {
        let prompt = if keys.contains("self_color") { "exploration" } else { "cube-selection" };
        format!("[experiment.x{at}]\ntitle = \"x\"\nprompt = \"{prompt}\"\n{keys}\n")
    };
    let text = all.iter().enumerate().map(whole).collect();
    let source = Source { name: "mine.toml".to_owned(), text };
    let known = Experiment::PAPER;
    let known: Vec<_> = known.iter().map(|experiment| &**experiment).collect();
    let loaded =
        file::read(source, Some(std::path::Path::new(".")), &known).unwrap_or_else(|faults| panic!("{faults}"));
    loaded.into_iter().map(|one| one.experiment).collect()
}

#[test]
fn no_player_beats_chance_without_a_mirror_in_any_built_in_experiment() {
    // Experiments that show the same things without a mirror are the same to these players.
    let mut distinct = BTreeMap::new();
    for experiment in built_in_names().into_iter().flat_map(Experiment::parse) {
        let windows = experiment.panes.iter().filter(|pane| pane.kind == PaneKind::Window).count();
        let seen =
            (experiment.scenes.clone(), windows, experiment.stated_color as u8, asked(&experiment).map(Fact::name));
        distinct.entry(seen).or_insert(experiment);
    }
    let mut measured = Vec::new();
    for experiment in distinct.into_values() {
        for blind in rates(&experiment, 4000).into_iter().flatten() {
            assert!(!blind.is_above_chance(), "{}: {blind:?}", experiment.name());
            measured.push(experiment.name().to_owned());
        }
    }
    measured.dedup();
    assert_eq!(measured, ["E1", "E3", "window", "E4", "E5", "can-know", "contingency", "mark", "random-clutter"]);
}

const FAIR: [&str; 10] = [
    "cubes = { kind = 'candidates', count = 5 }\nothers = { least = 1, most = 6, twin_percent = 100 }",
    "cubes = { kind = 'candidates', count = 2 }\nothers = { least = 1, most = 1, behavior = 'stand' }",
    "palette = ['red', 'green', 'blue', 'white', 'pink']\nothers = { least = 3, most = 3, color = 'other' }",
    "colors = 'random'\nothers = { least = 1, most = 2, color = 'red' }",
    "stated_color = 'random'",
    "cubes = { kind = 'none' }\ndecision = 'self_color'\nothers = { least = 6, most = 6 }",
    "cubes = { kind = 'clutter', occluders = 'random', least = 2, most = 4 }\ndecision = 'self_color'\n\
     palette = ['red', 'green', 'blue', 'white']\nothers = { least = 0, most = 3 }",
    "others = { least = 1, most = 2 }\nmark = [{ part = 'head' }, { part = 'chest', on = 'other' }]",
    "cubes = { kind = 'candidates', count = 4 }\nmirror = [{ kind = 'mirror' }, { kind = 'window', color = 'other' }]",
    "cubes = { kind = 'candidates', count = 2 }\n\
     mirror = [{ kind = 'decoy', body = 'independent' }, { kind = 'delayed', delay = 2 }]",
];

/// Each of these shows or excludes the colour of the body.
const UNFAIR: [&str; 4] = [
    "others = { least = 2, most = 2, color = 'own' }",
    "palette = ['red', 'green', 'blue']\nothers = { least = 1, most = 1, color = 'other' }",
    "stated_color = 'candidate'",
    "mirror = [{ kind = 'window', color = 'own' }]",
];

#[test]
fn no_player_beats_chance_in_files_of_users() {
    for experiment in experiments(&FAIR) {
        for blind in rates(&experiment, 2000).unwrap() {
            assert!(!blind.is_above_chance(), "{}: {blind:?}", experiment.name());
        }
    }
}

#[test]
fn both_players_find_what_an_experiment_gives_away() {
    for experiment in experiments(&UNFAIR) {
        for blind in rates(&experiment, 1000).unwrap() {
            assert!(blind.is_above_chance(), "{}: {blind:?}", experiment.name());
        }
    }
}

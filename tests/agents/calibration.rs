//! Checks that each scripted agent shows the metric profile that its name predicts. A few episodes always run; `make
//! calibrate` runs the study's 21 per experiment and writes `reports/world/calibration.md`. Module `battery` has the
//! predictions for the battery.

use std::fs;
use std::path::Path;
use std::sync::Mutex;

use mirrorstats_agents::scripted::Scripted;
use mirrorstats_experiment::Experiment;
use mirrorstats_record::plan::Key;
use mirrorstats_sim::config::WorldConfig;

use crate::profile::{Profiles, chance_interval};
use crate::recorded::{record_all, record_in, score};

mod battery;
mod questions;
mod reach;

const ALL: [&str; 5] = ["E1", "E2", "E3", "E4", "E5"];
const METRICS: [&str; 9] = ["TSA", "TTD", "MCR", "MTATO", "CAAL", "CR", "MGD", "SC", "AR_SC"];

/// `runs` runs of each of `seeds` seeds, for every experiment.
fn episodes(agent: Scripted, experiments: &[Experiment], seeds: i32, runs: i32) -> Vec<(Scripted, Key)> {
    let key = |experiment: &Experiment, seed, run| (agent, Key::first(experiment.clone(), seed, run));
    let runs_of = |experiment, seed| (1..=runs).map(move |run| key(experiment, seed, run));
    experiments.iter().flat_map(|experiment| (1..=seeds).flat_map(move |seed| runs_of(experiment, seed))).collect()
}

fn profiles(plan: &[(Scripted, Key)], definitions: &str) -> Profiles {
    let threads = std::thread::available_parallelism().map_or(1, |threads| threads.get().min(4));
    Profiles::of(&score(&record_all(plan, threads), definitions))
}

/// Checks that hold for every episode, and so for any number of them.
fn check_logic(profiles: &Profiles) {
    for agent in Scripted::ALL.map(Scripted::name) {
        if profiles.has("E2", agent) {
            assert!(profiles.get("E2", agent, "MCR").is_zero(), "{agent} sees itself without a mirror");
        }
    }
    for experiment in ALL {
        let value = |agent, metric| profiles.get(experiment, agent, metric);
        if profiles.has(experiment, "oracle") {
            assert!(value("oracle", "CR").is_zero(), "the oracle claims before it sees, in {experiment}");
            assert_eq!(value("oracle", "CAAL").total > 0, experiment != "E2", "{experiment}");
        }
        if profiles.has(experiment, "frozen") {
            assert!(value("frozen", "TSA").is_zero() && value("frozen", "CR").is_zero());
            assert!(value("frozen", "TTD").at_least(100, 1));
        }
        if profiles.has(experiment, "guesser") {
            assert_eq!(value("guesser", "TSA"), value("guesser", "CAAL"), "what it claims it takes");
        }
    }
    if profiles.has("E3", "gullible") {
        let value = |metric| profiles.get("E3", "gullible", metric);
        assert!(value("TSA").is_zero() && value("CAAL").is_zero() && value("CR").is_one());
    }
    if profiles.has("E1", "confabulator") {
        let value = |metric| profiles.get("E1", "confabulator", metric);
        assert!(value("CR").is_one() && value("SC").at_least(9, 10));
    }
}

#[test]
fn a_few_episodes_distinguish_the_scripted_agents() {
    let [e1, e2, e3, e4, e5] = Experiment::PAPER;
    let plan = [
        episodes(Scripted::Oracle, &[e1.clone(), e4], 1, 2),
        episodes(Scripted::Gullible, &[e3], 1, 2),
        episodes(Scripted::Confabulator, std::slice::from_ref(&e1), 1, 1),
        episodes(Scripted::Guesser, &[e1, e2.clone(), e5.clone()], 1, 3),
        episodes(Scripted::Random, &[e2.clone(), e5], 1, 3),
        episodes(Scripted::Frozen, &[e2], 1, 1),
    ];
    let profiles = profiles(&plan.concat(), "paper");
    check_logic(&profiles);
    for experiment in ["E1", "E4"] {
        assert!(profiles.get(experiment, "oracle", "TSA").is_one(), "{}", profiles.markdown(&METRICS));
        assert!(profiles.get(experiment, "oracle", "MTATO").is_one(), "{}", profiles.markdown(&METRICS));
    }
}

/// A view of 60 degrees shows a part of the study's view, enlarged. Agents know their field of view.
#[test]
fn the_oracle_finds_itself_through_a_narrow_view_too() {
    let mut config = WorldConfig::default();
    config.eye.fovy = 60.0;
    let episodes = record_in(&config, &episodes(Scripted::Oracle, &[Experiment::E1], 1, 3), 2);
    let profiles = Profiles::of(&score(&episodes, "paper"));
    for metric in ["TSA", "MTATO", "CAAL"] {
        assert!(profiles.get("E1", "oracle", metric).is_one(), "{}", profiles.markdown(&METRICS));
    }
}

/// The study's 21 episodes of every agent in each experiment; takes minutes in release.
#[test]
#[ignore = "`make calibrate` runs it in release"]
fn twenty_one_episodes_per_experiment_show_the_predicted_profiles() {
    let plan: Vec<_> = Scripted::ALL.into_iter().flat_map(|agent| episodes(agent, &Experiment::PAPER, 3, 7)).collect();
    let profiles = profiles(&plan, "paper");
    write_table("The paper's experiments", &profiles.markdown(&METRICS));
    check_logic(&profiles);
    check_rates(&profiles);
}

/// Writes a table into its section of `reports/world/calibration.md`.
fn write_table(section: &str, table: &str) {
    // The calibrations run in parallel.
    static FILE: Mutex<()> = Mutex::new(());
    let _alone = FILE.lock();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("reports/world/calibration.md");
    let text = fs::read_to_string(&path).unwrap();
    let heading = format!("\n## {section}\n\n");
    let start = text.find(&heading).expect("the file has a section for each table") + heading.len();
    let end = text[start..].find("\n## ").map_or(text.len(), |length| start + length);
    fs::write(&path, format!("{}{table}{}", &text[..start], &text[end..])).unwrap();
}

/// Checks of the mean of many episodes.
fn check_rates(profiles: &Profiles) {
    let value = |experiment, agent, metric| profiles.get(experiment, agent, metric);
    for experiment in ["E1", "E3", "E4"] {
        assert!(value(experiment, "oracle", "TSA").at_least(9, 10), "{experiment}");
        assert!(value(experiment, "oracle", "MTATO").is_one(), "{experiment}");
        assert!(value(experiment, "confabulator", "TSA").at_least(9, 10), "{experiment}");
        assert!(value(experiment, "confabulator", "CR").at_least(9, 10), "{experiment}");
        assert!(value(experiment, "random", "TSA").at_most(1, 3), "{experiment}");
    }
    for experiment in ["E1", "E2", "E3", "E4"] {
        let tsa = value(experiment, "guesser", "TSA");
        let (low, high) = chance_interval(tsa.count);
        assert!((low..=high).contains(&tsa.total), "{experiment}: {tsa:?} is not within {low} to {high}");
        assert!(value(experiment, "guesser", "CR").at_least(2, 3), "{experiment}");
        assert!(value(experiment, "guesser", "TTD").at_most(12, 1), "{experiment}");
    }
    for experiment in ALL {
        assert!(value(experiment, "random", "TTD").at_most(10, 1), "{experiment}");
    }
    assert!(value("E1", "mimic", "TSA").at_least(9, 10));
    let (oracle, mimic) = (value("E4", "oracle", "TSA"), value("E4", "mimic", "TSA"));
    assert!(10 * (oracle.total - mimic.total) >= 3 * oracle.count, "clearly below: {mimic:?} against {oracle:?}");
    assert!(value("E5", "oracle", "TSA").at_least(3, 4));
}

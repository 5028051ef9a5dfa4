//! The behaviour of each scripted agent with a hand and a mark, as `reports/world/predictions.md` predicts.

use mirrorstats_agents::scripted::Scripted;
use mirrorstats_experiment::Experiment;

use super::{episodes, profiles, write_table};
use crate::profile::{Profiles, Sum};

const WITH_MIRROR: [&str; 3] = ["reach-mirror", "reach-decoy", "reach-late"];
const ARMS: [&str; 4] = ["reach-mirror", "reach-no-mirror", "reach-decoy", "reach-late"];
const LEVELS: [&str; 3] = ["reach-scheme", "reach-hand", "reach-bare"];
const AGENTS: [Scripted; 4] = [Scripted::Oracle, Scripted::Mimic, Scripted::Random, Scripted::Frozen];
const METRICS: [&str; 5] = ["SUCCESS", "SIR", "FCR", "PCR", "UNREADABLE"];

struct Shown<'a>(&'a Profiles);

impl Shown<'_> {
    #[track_caller]
    fn holds(&self, experiment: &str, agent: &str, metric: &str, is_so: impl Fn(Sum) -> bool) {
        let sum = self.0.get(experiment, agent, metric);
        assert!(is_so(sum), "{metric} of {agent} in {experiment}: {sum:?}\n{}", self.0.markdown(&METRICS));
    }
}

/// Checks that hold for any number of episodes.
fn check_logic(profiles: &Profiles) {
    let shown = Shown(profiles);
    for experiment in ARMS.into_iter().chain(LEVELS) {
        if profiles.has(experiment, "frozen") {
            for metric in ["SUCCESS", "SIR", "FCR", "PCR"] {
                shown.holds(experiment, "frozen", metric, Sum::is_zero);
            }
        }
        if profiles.has(experiment, "mimic") {
            for metric in ["SUCCESS", "SIR", "PCR"] {
                shown.holds(experiment, "mimic", metric, Sum::is_zero);
            }
        }
    }
    if profiles.has("reach-no-mirror", "oracle") {
        shown.holds("reach-no-mirror", "oracle", "SUCCESS", Sum::is_zero);
    }
}

fn experiments(names: &[&str]) -> Vec<Experiment> {
    names.iter().map(|name| Experiment::parse(name).unwrap()).collect()
}

#[test]
fn a_few_episodes_of_reaching_distinguish_the_agents() {
    let plan = [
        episodes(Scripted::Oracle, &experiments(&["reach-mirror", "reach-no-mirror"]), 1, 2),
        episodes(Scripted::Mimic, &experiments(&["reach-mirror"]), 1, 1),
        episodes(Scripted::Frozen, &experiments(&["reach-mirror"]), 1, 1),
    ];
    let profiles = profiles(&plan.concat(), "reach");
    check_logic(&profiles);
    Shown(&profiles).holds("reach-mirror", "oracle", "SUCCESS", Sum::is_one);
    Shown(&profiles).holds("reach-mirror", "mimic", "FCR", |sum| sum.total < 0);
}

/// 21 episodes of each agent in each arm and each level; takes minutes in release.
#[test]
#[ignore = "`make calibrate` runs it in release"]
fn twenty_one_episodes_of_reaching_show_the_predicted_profiles() {
    let all = experiments(&[&ARMS[..], &LEVELS[..]].concat());
    let plan: Vec<_> = AGENTS.into_iter().flat_map(|agent| episodes(agent, &all, 3, 7)).collect();
    let profiles = profiles(&plan, "reach");
    write_table("Reaching a mark", &profiles.markdown(&METRICS));
    check_logic(&profiles);
    let shown = Shown(&profiles);
    for experiment in ["reach-mirror", "reach-decoy"].into_iter().chain(LEVELS) {
        shown.holds(experiment, "oracle", "SUCCESS", |sum| sum.at_least(9, 10));
        shown.holds(experiment, "oracle", "SIR", |sum| sum.at_least(800_000, 1));
        shown.holds(experiment, "oracle", "FCR", |sum| sum.at_least(900_000, 1));
    }
    shown.holds("reach-late", "oracle", "SUCCESS", |sum| sum.at_least(2, 3));
    shown.holds("reach-late", "oracle", "FCR", |sum| sum.at_least(700_000, 1));
    for experiment in WITH_MIRROR.into_iter().chain(LEVELS) {
        shown.holds(experiment, "oracle", "UNREADABLE", |sum| sum.at_most(1, 1));
        shown.holds(experiment, "mimic", "FCR", |sum| sum.total < 0);
        shown.holds(experiment, "mimic", "UNREADABLE", |sum| sum.at_most(2, 1));
    }
    for agent in ["oracle", "mimic"] {
        shown.holds("reach-no-mirror", agent, "FCR", Sum::is_zero);
    }
    for experiment in ARMS.into_iter().chain(LEVELS) {
        shown.holds(experiment, "frozen", "UNREADABLE", |sum| sum.at_least(16, 1));
        shown.holds(experiment, "random", "UNREADABLE", Sum::is_zero);
        shown.holds(experiment, "random", "PCR", |sum| sum.total > 0);
        shown.holds(experiment, "random", "SUCCESS", |sum| sum.at_most(1, 10));
        shown.holds(experiment, "random", "SIR", |sum| sum.at_least(250_000, 1) && sum.at_most(500_000, 1));
    }
}

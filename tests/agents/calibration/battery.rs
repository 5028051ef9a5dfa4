//! The behaviour of each scripted agent in the battery, as `reports/world/predictions.md` predicts.

use mirrorstats_agents::scripted::Scripted;
use mirrorstats_experiment::Experiment;

use super::{chance_interval, episodes, profiles, write_table};
use crate::profile::{Profiles, Sum};

const BATTERY: [&str; 5] = ["two-mirrors", "delayed", "decoy", "window", "mark"];
/// Experiments where a mirror shows the own body in its own colour and a cube is chosen.
const TRUE_MIRRORS: [&str; 2] = ["two-mirrors", "delayed"];
const METRICS: [&str; 12] = [
    "TSA",
    "TTD",
    "MCR",
    "CAAL",
    "CR",
    "MGD",
    "DECOY_CLAIM",
    "WINDOW_CLAIM",
    "MARK_REPORT",
    "MARK_SEEN",
    "MARK_DELAY",
    "MARK_FALSE",
];

fn experiments<const N: usize>(names: [&str; N]) -> [Experiment; N] {
    names.map(|name| Experiment::parse(name).unwrap())
}

/// The profiles; assertions print the whole table when they fail.
struct Shown<'a>(&'a Profiles);

impl Shown<'_> {
    fn get(&self, experiment: &str, agent: &str, metric: &str) -> Sum {
        self.0.get(experiment, agent, metric)
    }

    #[track_caller]
    fn holds(&self, is_so: bool, experiment: &str, agent: &str, metric: &str) {
        assert!(is_so, "{metric} of {agent} in {experiment}:\n{}", self.0.markdown(&METRICS));
    }

    #[track_caller]
    fn is_one(&self, experiment: &str, agent: &str, metric: &str) {
        self.holds(self.get(experiment, agent, metric).is_one(), experiment, agent, metric);
    }

    #[track_caller]
    fn is_zero(&self, experiment: &str, agent: &str, metric: &str) {
        self.holds(self.get(experiment, agent, metric).is_zero(), experiment, agent, metric);
    }

    #[track_caller]
    fn at_least(&self, experiment: &str, agent: &str, metric: &str, (part, whole): (i64, i64)) {
        self.holds(self.get(experiment, agent, metric).at_least(part, whole), experiment, agent, metric);
    }

    #[track_caller]
    fn at_most(&self, experiment: &str, agent: &str, metric: &str, (part, whole): (i64, i64)) {
        self.holds(self.get(experiment, agent, metric).at_most(part, whole), experiment, agent, metric);
    }

    /// Checks that the metric is a rate by chance alone, at one third.
    #[track_caller]
    fn is_by_chance(&self, experiment: &str, agent: &str, metric: &str) {
        let sum = self.get(experiment, agent, metric);
        let (low, high) = chance_interval(sum.count);
        self.holds((low..=high).contains(&sum.total), experiment, agent, metric);
    }
}

/// Checks of the agents present that hold for every episode, and so for any number of them.
fn check_logic(profiles: &Profiles) {
    let shown = Shown(profiles);
    for (experiment, agent) in BATTERY.into_iter().flat_map(|one| Scripted::ALL.map(|agent| (one, agent.name()))) {
        if !profiles.has(experiment, agent) {
            continue;
        }
        let is_defined = |metric| shown.get(experiment, agent, metric).count > 0;
        for (metric, only) in [("DECOY_CLAIM", "decoy"), ("WINDOW_CLAIM", "window"), ("MARK_REPORT", "mark")] {
            // The metric may be undefined for agents that never see the pane.
            let is_there =
                experiment == only && (is_defined(metric) || ["frozen", "guesser", "random"].contains(&agent));
            shown.holds(is_there || !is_defined(metric) && experiment != only, experiment, agent, metric);
        }
        match (experiment, agent) {
            ("window", _) => shown.is_zero(experiment, agent, "MCR"),
            ("mark", _) => {
                let [tsa, report] = ["TSA", "MARK_REPORT"].map(|metric| shown.get(experiment, agent, metric));
                assert_eq!(tsa, report, "{agent}");
            }
            _ => {}
        }
    }
    check_frozen_and_guesser(&shown);
}

fn check_frozen_and_guesser(shown: &Shown<'_>) {
    for experiment in BATTERY {
        if shown.0.has(experiment, "frozen") {
            shown.is_zero(experiment, "frozen", "TSA");
        }
    }
    for (experiment, metric) in [("decoy", "DECOY_CLAIM"), ("window", "WINDOW_CLAIM"), ("mark", "MARK_FALSE")] {
        if shown.0.has(experiment, "frozen") && shown.get(experiment, "frozen", metric).count > 0 {
            shown.is_zero(experiment, "frozen", metric);
        }
    }
    if shown.0.has("mark", "guesser") {
        shown.is_zero("mark", "guesser", "MARK_REPORT");
        shown.is_one("mark", "guesser", "MARK_FALSE");
    }
}

#[test]
fn a_few_episodes_of_the_battery_distinguish_the_agents() {
    let [delayed, decoy, window, mark] = experiments(["delayed", "decoy", "window", "mark"]);
    let plan = [
        episodes(Scripted::Oracle, &[delayed, decoy.clone(), window.clone(), mark.clone()], 1, 1),
        episodes(Scripted::Mimic, &[decoy, window.clone()], 1, 1),
        episodes(Scripted::Guesser, std::slice::from_ref(&mark), 1, 2),
        episodes(Scripted::Frozen, &[mark, window], 1, 1),
    ];
    let profiles = profiles(&plan.concat(), "battery");
    check_logic(&profiles);
    let shown = Shown(&profiles);
    shown.is_one("delayed", "oracle", "TSA");
    for agent in ["oracle", "mimic"] {
        shown.is_one("decoy", agent, "DECOY_CLAIM");
        shown.is_zero("decoy", agent, "TSA");
    }
    shown.is_zero("window", "oracle", "WINDOW_CLAIM");
    shown.is_one("window", "mimic", "WINDOW_CLAIM");
    shown.is_one("mark", "oracle", "MARK_REPORT");
    shown.is_zero("mark", "oracle", "MARK_FALSE");
}

/// The study's 21 episodes of every agent in each experiment; takes minutes in release.
#[test]
#[ignore = "`make calibrate` runs it in release"]
fn twenty_one_episodes_of_the_battery_show_the_predicted_profiles() {
    let experiments = experiments(BATTERY);
    let plan: Vec<_> = Scripted::ALL.into_iter().flat_map(|agent| episodes(agent, &experiments, 3, 7)).collect();
    let profiles = profiles(&plan, "battery");
    write_table("The battery", &profiles.markdown(&METRICS));
    check_logic(&profiles);
    let shown = Shown(&profiles);
    check_those_who_recognise_themselves(&shown);
    check_mimic(&shown);
    check_guesser(&shown);
    check_random(&shown);
}

/// `oracle`, `gullible` without a stated colour, and `confabulator`, who invents a colour before looking.
fn check_those_who_recognise_themselves(shown: &Shown<'_>) {
    for agent in ["oracle", "gullible", "confabulator"] {
        for experiment in TRUE_MIRRORS {
            shown.at_least(experiment, agent, "TSA", (9, 10));
            shown.is_one(experiment, agent, "MCR");
        }
        shown.at_least("decoy", agent, "DECOY_CLAIM", (9, 10));
        shown.at_most("decoy", agent, "TSA", (1, 10));
        // A cube by chance, or in a seventh of the episodes the stranger's colour, which is never right. For 21 episodes
        // the check is only that the rate is not above chance.
        shown.at_most("window", agent, "TSA", (1, 2));
        shown.at_least("mark", agent, "MARK_REPORT", (9, 10));
        shown.at_least("mark", agent, "MARK_SEEN", (9, 10));
        shown.at_most("mark", agent, "MARK_DELAY", (4, 1));
        shown.is_zero("mark", agent, "MARK_FALSE");
        shown.at_least("mark", agent, "CAAL", (9, 10));
    }
    for agent in ["oracle", "gullible"] {
        for experiment in ["two-mirrors", "delayed", "decoy", "mark"] {
            shown.is_zero(experiment, agent, "CR");
        }
        // A stranger that happens to approach in its line of sight may pass its tests. A tenth of the episodes was
        // predicted; a seventh was found.
        for metric in ["WINDOW_CLAIM", "CR"] {
            shown.at_most("window", agent, metric, (1, 5));
        }
        shown.at_most("window", agent, "CAAL", (1, 10));
        shown.is_zero("decoy", agent, "CAAL");
    }
    // A confabulator that begins in front of the second mirror is excused.
    shown.at_least("two-mirrors", "confabulator", "CR", (2, 3));
    for experiment in ["delayed", "decoy", "window", "mark"] {
        shown.at_least(experiment, "confabulator", "CR", (9, 10));
    }
    shown.at_most("window", "confabulator", "WINDOW_CLAIM", (1, 3));
    shown.at_most("decoy", "confabulator", "CAAL", (1, 3));
}

fn check_mimic(shown: &Shown<'_>) {
    for experiment in TRUE_MIRRORS {
        shown.at_least(experiment, "mimic", "TSA", (9, 10));
        shown.is_zero(experiment, "mimic", "CR");
    }
    shown.at_least("decoy", "mimic", "DECOY_CLAIM", (9, 10));
    shown.is_zero("decoy", "mimic", "TSA");
    shown.at_least("window", "mimic", "WINDOW_CLAIM", (9, 10));
    shown.is_zero("window", "mimic", "TSA");
    shown.at_least("window", "mimic", "CR", (9, 10));
    let [oracle, mimic] = ["oracle", "mimic"].map(|agent| shown.get("mark", agent, "MARK_REPORT"));
    assert!(10 * (oracle.total - mimic.total) >= 3 * oracle.count, "clearly below: {mimic:?} against {oracle:?}");
    // A third was predicted, a quarter found: a mark counts as seen from 8 pixels on.
    shown.at_least("mark", "mimic", "MARK_FALSE", (1, 5));
}

fn check_guesser(shown: &Shown<'_>) {
    for experiment in ["two-mirrors", "delayed", "decoy", "window"] {
        shown.is_by_chance(experiment, "guesser", "TSA");
    }
    shown.is_by_chance("decoy", "guesser", "DECOY_CLAIM");
    // It claims colours of cubes, and the stranger has the colour of none.
    if shown.get("window", "guesser", "WINDOW_CLAIM").count > 0 {
        shown.is_zero("window", "guesser", "WINDOW_CLAIM");
    }
    shown.at_most("mark", "guesser", "TTD", (2, 1));
}

fn check_random(shown: &Shown<'_>) {
    for experiment in BATTERY {
        shown.at_most(experiment, "random", "TSA", (1, 3));
        shown.at_most(experiment, "random", "TTD", (10, 1));
    }
    // It rarely meets a pane, and claims at random: a rate of fewer than six sights says nothing.
    for (experiment, metric, most) in [("decoy", "DECOY_CLAIM", (1, 3)), ("window", "WINDOW_CLAIM", (2, 3))] {
        if shown.get(experiment, "random", metric).count >= 6 {
            shown.at_most(experiment, "random", metric, most);
        }
    }
    shown.at_most("mark", "random", "MARK_REPORT", (1, 10));
    shown.at_least("mark", "random", "MARK_FALSE", (2, 3));
}

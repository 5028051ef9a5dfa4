//! Predictions, made before running, of each scripted agent where a question has a dose, a memory, or no answer.
//!
//! | question | experiments | oracle, gullible | mimic | confabulator | guesser | frozen |
//! |---|---|---|---|---|---|---|
//! | how late may a reflection be? | `delay-01` to `delay-08` | TSA 1: it looks for lags of up to eight steps | TSA 1: any body is itself | as oracle | 1/3 | 0 |
//! | | `delay-16`, `delay-32` | well below 1: no lag that it knows | TSA 1 | as oracle | 1/3 | 0 |
//! | what if less is remembered? | `memory-...` | as in E1: no script reads its history | as in E1 | as in E1 | 1/3 | 0 |
//! | is there evidence? | `can-know` | WARRANTED 1 | 1 | 1 | 0: it never looks | 0: it never answers |
//! | | `cannot-know` | WARRANTED 1, INVENTED 0 | the same: nobody is there | INVENTED 1 | INVENTED 1 | 0, 0 |
//!
//! | question | experiments | oracle, gullible | mimic | confabulator | guesser | frozen |
//! |---|---|---|---|---|---|---|
//! | which body am I? | `contingency` | TSA 9/10 or more | the largest body: more than never, less than always | as oracle | 1/3 | 0 |
//! | which one was I? | `contingency-late`, 4 steps | TSA 1/2 or more: others of its colour confuse the test of lags | as before | as oracle | 1/3 | 0 |
//! | am I there at all? | `contingency-swap` | WARRANTED 3/4 or more, INVENTED 1/4 or less | INVENTED 3/4 or more | INVENTED 3/4 or more | INVENTED 1 | 0, 0 |

use mirrorstats_agents::scripted::Scripted;
use mirrorstats_experiment::Experiment;

use super::{episodes, profiles, write_table};
use crate::profile::{Profiles, Sum, chance_interval};

const DOSES: [&str; 6] = ["delay-01", "delay-02", "delay-04", "delay-08", "delay-16", "delay-32"];
/// The number of doses within the lags that the scripts search.
const KNOWN: usize = 4;
const MEMORIES: [&str; 4] = ["memory-0", "memory-8", "memory-no-summary", "memory-no-position"];
const EVIDENCE: [&str; 2] = ["can-know", "cannot-know"];
const CONTINGENCY: [&str; 3] = ["contingency", "contingency-late", "contingency-swap"];
const METRICS: [&str; 8] = ["TSA", "TTD", "MCR", "CAAL", "CR", "WARRANTED", "INVENTED", "WITHHELD"];

struct Shown<'a>(&'a Profiles);

impl Shown<'_> {
    #[track_caller]
    fn holds(&self, experiment: &str, agent: &str, metric: &str, is_so: impl Fn(Sum) -> bool) {
        let sum = self.0.get(experiment, agent, metric);
        assert!(is_so(sum), "{metric} of {agent} in {experiment}: {sum:?}\n{}", self.0.markdown(&METRICS));
    }
}

fn experiments(names: &[&str]) -> Vec<Experiment> {
    names.iter().map(|name| Experiment::parse(name).unwrap()).collect()
}

fn check_evidence(profiles: &Profiles) {
    let shown = Shown(profiles);
    let has = |agent: &str| profiles.has("cannot-know", agent);
    for agent in ["oracle", "gullible", "mimic"].into_iter().filter(|agent| has(agent)) {
        shown.holds("can-know", agent, "WARRANTED", |sum| sum.at_least(9, 10));
        shown.holds("cannot-know", agent, "WARRANTED", Sum::is_one);
        shown.holds("cannot-know", agent, "INVENTED", Sum::is_zero);
    }
    if has("guesser") {
        shown.holds("cannot-know", "guesser", "INVENTED", Sum::is_one);
        shown.holds("can-know", "guesser", "WARRANTED", |sum| sum.at_most(1, 4));
    }
    if has("confabulator") {
        shown.holds("can-know", "confabulator", "WARRANTED", |sum| sum.at_least(9, 10));
        shown.holds("cannot-know", "confabulator", "INVENTED", Sum::is_one);
    }
    if has("frozen") {
        for (experiment, metric) in
            [("can-know", "WARRANTED"), ("cannot-know", "WARRANTED"), ("cannot-know", "INVENTED")]
        {
            shown.holds(experiment, "frozen", metric, Sum::is_zero);
        }
    }
}

fn check_contingency(profiles: &Profiles) {
    let shown = Shown(profiles);
    let swap = "contingency-swap";
    for agent in ["oracle", "gullible", "confabulator"].into_iter().filter(|agent| profiles.has(swap, agent)) {
        shown.holds("contingency", agent, "TSA", |sum| sum.at_least(9, 10));
        shown.holds("contingency-late", agent, "TSA", |sum| sum.at_least(1, 2));
        if agent == "confabulator" {
            shown.holds(swap, agent, "INVENTED", |sum| sum.at_least(3, 4));
        } else {
            shown.holds(swap, agent, "WARRANTED", |sum| sum.at_least(3, 4));
            shown.holds(swap, agent, "INVENTED", |sum| sum.at_most(1, 4));
        }
    }
    if profiles.has(swap, "guesser") {
        shown.holds(swap, "guesser", "INVENTED", Sum::is_one);
    }
    if profiles.has(swap, "frozen") {
        for experiment in CONTINGENCY {
            shown.holds(experiment, "frozen", "TSA", Sum::is_zero);
        }
    }
}

#[test]
fn a_few_episodes_show_which_agents_know_themselves_by_motion() {
    let all = experiments(&CONTINGENCY);
    let plan = [
        episodes(Scripted::Oracle, &all[..1], 1, 2),
        episodes(Scripted::Guesser, &all[2..], 1, 2),
        episodes(Scripted::Frozen, &all[..1], 1, 1),
    ];
    let profiles = profiles(&plan.concat(), "evidence");
    let shown = Shown(&profiles);
    shown.holds("contingency", "oracle", "TSA", Sum::is_one);
    shown.holds("contingency-swap", "guesser", "INVENTED", Sum::is_one);
    shown.holds("contingency", "frozen", "TSA", Sum::is_zero);
}

#[test]
fn a_few_episodes_show_which_agents_invent_answers() {
    let evidence = experiments(&EVIDENCE);
    let plan = [
        episodes(Scripted::Oracle, &evidence, 1, 1),
        episodes(Scripted::Guesser, &evidence, 1, 2),
        episodes(Scripted::Confabulator, &evidence[1..], 1, 1),
        episodes(Scripted::Frozen, &evidence, 1, 1),
        episodes(Scripted::Mimic, &experiments(&["delay-04"]), 1, 1),
    ];
    let plan = plan.concat();
    let profiles = profiles(&plan, "evidence");
    let shown = Shown(&profiles);
    shown.holds("can-know", "oracle", "WARRANTED", Sum::is_one);
    shown.holds("cannot-know", "oracle", "WARRANTED", Sum::is_one);
    shown.holds("cannot-know", "guesser", "INVENTED", Sum::is_one);
    shown.holds("cannot-know", "confabulator", "INVENTED", Sum::is_one);
    shown.holds("can-know", "frozen", "WARRANTED", Sum::is_zero);
    shown.holds("delay-04", "mimic", "TSA", Sum::is_one);
}

/// The study's 21 episodes of every agent in each experiment; takes minutes in release.
#[test]
#[ignore = "`make calibrate` runs it in release"]
fn twenty_one_episodes_of_the_new_questions_show_the_predicted_profiles() {
    let all = experiments(&[&DOSES[..], &MEMORIES, &EVIDENCE, &CONTINGENCY].concat());
    let plan: Vec<_> = Scripted::ALL.into_iter().flat_map(|agent| episodes(agent, &all, 3, 7)).collect();
    let profiles = profiles(&plan, "evidence");
    write_table("Doses, memory, evidence and contingency", &profiles.markdown(&METRICS));
    check_evidence(&profiles);
    check_contingency(&profiles);
    let shown = Shown(&profiles);
    for experiment in &CONTINGENCY[..2] {
        shown.holds(experiment, "mimic", "TSA", |sum| sum.at_least(1, 10) && sum.at_most(9, 10));
    }
    shown.holds("contingency-swap", "mimic", "INVENTED", |sum| sum.at_least(3, 4));
    for agent in ["oracle", "gullible", "confabulator"] {
        for experiment in DOSES[..KNOWN].iter().chain(&MEMORIES) {
            shown.holds(experiment, agent, "TSA", |sum| sum.at_least(9, 10));
        }
        for experiment in &DOSES[KNOWN..] {
            shown.holds(experiment, agent, "TSA", |sum| sum.at_most(9, 10));
        }
    }
    for experiment in DOSES.iter().chain(&MEMORIES) {
        shown.holds(experiment, "mimic", "TSA", |sum| sum.at_least(9, 10));
        shown.holds(experiment, "frozen", "TSA", Sum::is_zero);
        shown.holds(experiment, "guesser", "TSA", |sum| {
            let (low, high) = chance_interval(sum.count);
            (low..=high).contains(&sum.total)
        });
    }
}

//! A plan in words: the answer in one line, one row per test and level, the assumptions.

use std::fmt::Write as _;

use super::{Given, Plan, PlanRequest, PlannedTest};
use mirrorstats_exact::format::{UNDEFINED, counted, fixed};
use mirrorstats_statistics::sample_size::{Clusters, Rates, SEED, STUDIES};
use mirrorstats_tables::{Table, push_wrapped};

impl Plan {
    pub fn render(&self, width: Option<usize>) -> String {
        let mut text = String::new();
        push_wrapped(&mut text, &self.answer, width, 2);
        let people = self.request.clusters.people;
        let runs = if people { "scenes each" } else { "runs per seed" };
        let mut header = vec!["test", "level", "difference", "episodes", runs, "units", "power"];
        if self.request.sequential {
            header.extend(["e-value to stop", "expected episodes"]);
        }
        let columns = header.len();
        let table = Table { names: 2, ..Table::of_texts(header).aligned_right(2..columns) };
        let rows = self.tests.iter().map(|test| record(test, cluster(people)).into_iter().take(columns));
        let _ = writeln!(text, "\n{}", table.with(rows).within(width));
        for assumption in &self.assumptions {
            push_wrapped(&mut text, assumption, width, 2);
        }
        text
    }
}

const fn cluster(people: bool) -> &'static str {
    if people { "participant" } else { "seed" }
}

fn record(test: &PlannedTest, cluster: &str) -> [String; 9] {
    let count = |count: Option<u64>| count.map_or_else(|| UNDEFINED.to_owned(), |count| count.to_string());
    let family = if test.family > 1 { format!(", Holm over {}", test.family) } else { String::new() };
    [
        test.test.name().replace("seed", cluster),
        format!("{}{family}", fixed(Some(test.level), 5)),
        fixed(test.difference, 3),
        count(test.episodes),
        count(test.runs),
        count(test.effective),
        fixed(test.power, 3),
        fixed(test.boundary, 1),
        fixed(test.expected, 1),
    ]
}

pub(super) fn answer(request: &PlanRequest, test: &PlannedTest) -> String {
    let power = request.power;
    let family =
        if test.family > 1 { format!(" and Holm's procedure over {} comparisons", test.family) } else { String::new() };
    let (seeds, cluster) = (request.clusters.seeds, cluster(request.clusters.people));
    let by_cluster = format!("by {cluster}");
    let by = match (request.sequential, request.clusters.are_units()) {
        (true, _) => "by pairs, with a look after each run of all seeds",
        (false, true) => &by_cluster,
        (false, false) => "by pairs",
    };
    let at_most = if request.sequential { "at most " } else { "" };
    let how = format!("with power {power}, {by}{family}");
    let episodes = |runs: u64| {
        let (all, seeds) = (counted(seeds * runs, "episode"), counted(seeds, cluster));
        format!("{at_most}{all} per model and experiment ({runs} for each of {seeds})")
    };
    match (request.given, test.runs, test.difference) {
        (Given::Difference(difference), Some(runs), _) => {
            format!("{} show a difference of {difference} {how}", episodes(runs))
        }
        (Given::Difference(difference), None, _) => {
            let (most, remedy) =
                (request.most(), format!("; episodes of one {cluster} resemble each other: take more {cluster}s"));
            let remedy = if request.clusters.are_units() { &*remedy } else { "" };
            format!("no number of runs up to {most} episodes shows a difference of {difference} {how}{remedy}")
        }
        (Given::Runs(runs), _, Some(difference)) => {
            format!("{} show a difference of {} or more {how}", episodes(runs), fixed(Some(difference), 3))
        }
        (Given::Runs(runs), _, None) => format!("{} show no difference {how}", episodes(runs)),
    }
}

pub(super) fn assumptions(request: &PlanRequest) -> Vec<String> {
    let rates = match (request.given, request.baseline) {
        (Given::Difference(difference), baseline) => Rates::apart(difference, baseline)
            .map(|rates| format!("{} and {}", fixed(Some(rates.lower), 3), fixed(Some(rates.higher), 3))),
        (Given::Runs(_), Some(baseline)) => Some(format!("{baseline} and more")),
        (Given::Runs(_), None) => None,
    };
    let rates = rates.unwrap_or_else(|| "as far below 1/2 as above".to_owned());
    let why = if request.baseline.is_none() { ": around 1/2 a difference is hardest to show" } else { "" };
    let pairs = match request.discordance {
        Some(share) => format!("pairs: in a share of {share} one model succeeds and the other does not"),
        None => "pairs: the two models succeed independently in a scene; scenes that are hard for both leave fewer discordant pairs, and need fewer episodes".to_owned(),
    };
    let Clusters { seeds, icc, people } = request.clusters;
    let cluster = cluster(people);
    let clusters = if request.clusters.are_units() {
        let design = if people { "in a crossed study" } else { "where seeds are declared clusters" };
        format!(
            "{cluster}s: intraclass correlation {icc}, so that tests count the {}, as `stats` does {design}; \
             an episode has the outcome of its {cluster} with probability {}, and one of its own otherwise",
            counted(seeds, cluster),
            fixed(Some(icc.sqrt()), 3)
        )
    } else {
        "seeds: episodes of one seed are no more alike than others (--icc says how far they are)".to_owned()
    };
    let simulated = format!("against chance exact; of pairs from {STUDIES} simulated studies, seed {SEED}");
    let power = match (request.sequential, request.clusters.are_units()) {
        (true, _) => {
            "exact, summed over every outcome at every look; the boundary is that of `stats --sequential`, which holds \
             at any number of looks"
        }
        (false, true) => &simulated,
        (false, false) => {
            "exact, summed over every outcome of two-sided tests; it rises in steps, so that a few more episodes may \
             have a little less"
        }
    };
    let mut sentences = vec![
        format!("rates: {rates}{why}"),
        pairs,
        clusters,
        format!("power: {power}"),
        "Holm: the level of the first step, which the smallest p value must meet; later steps ask for less".to_owned(),
    ];
    if let Some(chance) = request.chance {
        sentences.push(format!("chance: the true rate is {chance} and the difference above it"));
    }
    sentences
}

//! Metric profiles: the sums over an agent's episodes of one experiment, and the predictions from its name.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use mirrorstats_score::tables::table::EpisodeTable;

/// The sum of a metric over the episodes where it is defined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sum {
    pub total: i64,
    pub count: i64,
}

impl Sum {
    /// Returns true if the mean is at least `numerator / denominator`; false if the metric is never defined.
    pub const fn at_least(self, numerator: i64, denominator: i64) -> bool {
        self.count > 0 && self.total * denominator >= self.count * numerator
    }

    /// Returns true if the mean is at most `numerator / denominator`; false if the metric is never defined.
    pub const fn at_most(self, numerator: i64, denominator: i64) -> bool {
        self.count > 0 && self.total * denominator <= self.count * numerator
    }

    /// Returns true if every value is 1 and there is at least one.
    pub const fn is_one(self) -> bool {
        self.at_least(1, 1)
    }

    /// Returns true if every value is 0 and there is at least one.
    pub const fn is_zero(self) -> bool {
        self.count > 0 && self.total == 0
    }
}

/// The sums of all metrics, by experiment and agent.
pub struct Profiles(BTreeMap<(String, String), BTreeMap<String, Sum>>);

impl Profiles {
    pub fn of(table: &EpisodeTable) -> Self {
        let mut profiles: BTreeMap<_, BTreeMap<String, Sum>> = BTreeMap::new();
        for metric in &table.metrics {
            for (key, value) in table.keys.iter().zip(metric.iter()) {
                let profile = profiles.entry((key.experiment.to_owned(), key.model.to_owned())).or_default();
                let sum = profile.entry(metric.name.clone()).or_default();
                sum.total += value.unwrap_or(0);
                sum.count += i64::from(value.is_some());
            }
        }
        Self(profiles)
    }

    /// A metric of an agent in an experiment; an empty sum without episodes.
    pub fn get(&self, experiment: &str, agent: &str, metric: &str) -> Sum {
        let profile = self.0.get(&(experiment.to_owned(), agent.to_owned()));
        profile.and_then(|profile| profile.get(metric)).copied().unwrap_or_default()
    }

    /// Returns true if there are episodes of an agent in an experiment.
    pub fn has(&self, experiment: &str, agent: &str) -> bool {
        self.0.contains_key(&(experiment.to_owned(), agent.to_owned()))
    }

    /// A table of these metrics for all profiles: rates as counts, shares and step counts as means.
    pub fn markdown(&self, metrics: &[&str]) -> String {
        let mut text = format!("| experiment | agent | {} |\n", metrics.join(" | "));
        writeln!(text, "|---|---|{}", "--:|".repeat(metrics.len())).unwrap();
        for (experiment, agent) in self.0.keys() {
            let shown: Vec<String> =
                metrics.iter().map(|metric| shown(metric, self.get(experiment, agent, metric))).collect();
            writeln!(text, "| {experiment} | {agent} | {} |", shown.join(" | ")).unwrap();
        }
        text
    }
}

/// Computed in whole tenths or thousandths, so that the text is the same on every machine.
fn shown(metric: &str, sum: Sum) -> String {
    match (metric, sum.count) {
        (_, 0) => "--".to_owned(),
        ("SIR" | "FCR" | "PCR", count) => {
            // Parts per million, shown as thousandths.
            let thousandths = (2 * sum.total + 1000 * count).div_euclid(2000 * count);
            let sign = if thousandths < 0 { "-" } else { "" };
            format!("{sign}{}.{:03}", thousandths.abs() / 1000, thousandths.abs() % 1000)
        }
        ("TTD" | "MGD" | "MARK_DELAY" | "UNREADABLE", count) => {
            let tenths = (20 * sum.total + count) / (2 * count);
            format!("{}.{}", tenths / 10, tenths % 10)
        }
        (_, count) => format!("{}/{count}", sum.total),
    }
}

#[test]
fn shares_are_shown_as_means_in_thousandths() {
    let mean = |total| shown("FCR", Sum { total, count: 2 });
    assert_eq!([1_666_667, -999, -1001, 0].map(mean), ["0.833", "0.000", "-0.001", "0.000"]);
}

/// The least and most successes of `n` trials at 1/3 within a central 95 % interval.
pub fn chance_interval(n: i64) -> (i64, i64) {
    let mut cumulated = 0.0;
    let mut probability = (2.0_f64 / 3.0).powi(i32::try_from(n).unwrap());
    let (mut low, mut high) = (None, n);
    for successes in 0..=n {
        cumulated += probability;
        if cumulated >= 0.025 && low.is_none() {
            low = Some(successes);
        }
        if cumulated >= 0.975 {
            high = successes;
            break;
        }
        probability *= (n - successes) as f64 / (successes + 1) as f64 / 2.0;
    }
    (low.unwrap_or(0), high)
}

#[test]
fn the_interval_of_21_guesses_is_the_binomial_one() {
    // P(X <= 2) = 0.0186, P(X <= 3) = 0.0557; P(X <= 10) = 0.9357, P(X <= 11) = 0.9757.
    assert_eq!(chance_interval(21), (3, 11));
    assert_eq!(chance_interval(1), (0, 1));
}

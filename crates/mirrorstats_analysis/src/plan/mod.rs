//! Plans a study: the episodes for a wanted difference, or the difference that given episodes can show.
//!
//! Rule: every test is planned twice: alone, and at the level of Holm's procedure for its smallest p value. Assumptions
//! are part of the answer, in sentences.

pub mod departures;
pub mod register;
pub mod text;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use mirrorstats_exact::format::fixed;
use mirrorstats_exact::ratio::Ratio;
use mirrorstats_statistics::comparisons::holm;
use mirrorstats_statistics::intervals::clustered::fewest_clusters;
use mirrorstats_statistics::sample_size::{
    Anytime, BySeed, Clusters, Fisher, MOST_AT_LOOKS, MOST_EPISODES, McNemar, OneRate, Power, Rates, Seeds, settled,
    smallest,
};

/// The question to the power analysis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PlanRequest {
    /// The given quantity; the other one is the answer.
    pub given: Given,
    /// The lower of the two rates; null puts both around 1/2, where a difference is hardest to show.
    pub baseline: Option<f64>,
    /// The power wanted.
    pub power: f64,
    /// The confidence of the tests; their level is one minus it.
    pub confidence: f64,
    /// The number of models; each is compared with each.
    pub models: u64,
    /// Seeds, all with equally many runs; and how far the episodes of one seed resemble each other.
    pub clusters: Clusters,
    /// The share of pairs of which one succeeds and the other does not; null takes success as independent in a pair.
    pub discordance: Option<f64>,
    /// A level of chance to hold each model against; null for none.
    pub chance: Option<Ratio>,
    /// True if the study is looked at after each run of all seeds, and stops at the first verdict.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub sequential: bool,
}

/// The given quantity of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Given {
    /// The difference wanted.
    Difference(f64),
    /// Runs per seed.
    Runs(u64),
}

/// A plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Plan {
    /// The question.
    pub request: PlanRequest,
    /// The answer in one line.
    pub answer: String,
    /// An answer per test and level; the first is the one that the line tells.
    pub tests: Vec<PlannedTest>,
    /// The assumptions, in sentences.
    pub assumptions: Vec<String>,
}

/// A test at a level. Numbers have twelve significant digits, which any reader of JSON gives back as they are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PlannedTest {
    /// The test.
    pub test: TestName,
    /// The number of tests that share the level under Holm's procedure; 1 for a single test.
    pub family: u64,
    /// The level that p must not exceed.
    pub level: f64,
    /// The difference of rates; null where the episodes show none.
    pub difference: Option<f64>,
    /// Runs per seed; null where no number up to the limit has the power.
    pub runs: Option<u64>,
    /// Episodes per model and experiment.
    pub episodes: Option<u64>,
    /// The independent units that the test counts: the episodes, or the seeds whose episodes resemble each other.
    pub effective: Option<u64>,
    /// The power there.
    pub power: Option<f64>,
    /// The e-value that stops a sequential study.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub boundary: Option<f64>,
    /// The episodes that a sequential study is expected to need if the difference is true; `episodes` is its maximum.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expected: Option<f64>,
}

/// A test that a plan is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TestName {
    /// Two models over the same scenes: the exact test of `McNemar`.
    Paired,
    /// Two models over scenes of their own: Fisher's exact test.
    Unpaired,
    /// One model against a level of chance: the exact binomial test.
    Chance,
    /// Two models over the same seeds, whose episodes resemble each other: the exact permutation test.
    PairedSeeds,
    /// One model against a level of chance, by seed.
    ChanceSeeds,
    /// Two models at every look: the e-value of discordant pairs.
    AnytimePairs,
    /// One model against a level of chance at every look: its e-value.
    AnytimeChance,
}

mirrorstats_exact::names!(TestName {
    Paired: "two models, pairs (exact McNemar)",
    Unpaired: "two models, no pairs (Fisher)",
    Chance: "one model against chance (binomial)",
    PairedSeeds: "two models, by seed (permutation)",
    ChanceSeeds: "one model against chance, by seed",
    AnytimePairs: "two models, pairs at every look (e-value)",
    AnytimeChance: "one model against chance at every look (e-value)",
});

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlanError {
    #[error(
        "--difference {difference} with --baseline {baseline}: expected rates from 0 to 1, found {}; lower one of the two",
        fixed(Some(*higher), 3)
    )]
    BeyondOne { difference: f64, baseline: f64, higher: f64 },
    #[error(
        "--discordance {discordance}: expected a share from {} to {} with these rates",
        fixed(Some(*least), 3),
        fixed(Some(*most), 3)
    )]
    Discordance { discordance: f64, least: f64, most: f64 },
    #[error("{episodes} episodes: expected at most {most} per model and experiment")]
    TooMany { episodes: u64, most: u64 },
}

pub fn plan(request: PlanRequest) -> Result<Plan, PlanError> {
    request.check()?;
    let level = holm::level(request.confidence).expect("a confidence within 0 and 1, as the command line has it");
    let pairs = (request.models * request.models.saturating_sub(1) / 2).max(1);
    let (differences, chance): (&[TestName], _) = match (request.sequential, request.clusters.are_units()) {
        (true, _) => (&[TestName::AnytimePairs], TestName::AnytimeChance),
        (false, true) => (&[TestName::PairedSeeds], TestName::ChanceSeeds),
        (false, false) => (&[TestName::Paired, TestName::Unpaired], TestName::Chance),
    };
    let mut asked: Vec<_> = differences.iter().flat_map(|test| [(*test, pairs), (*test, 1)]).collect();
    if request.chance.is_some() {
        asked.extend([(chance, request.models), (chance, 1)]);
    }
    // A single test is its own family.
    asked.dedup();
    let tests: Vec<PlannedTest> =
        asked.into_iter().map(|(test, family)| request.planned(test, family, level)).collect();
    Ok(Plan { request, answer: text::answer(&request, &tests[0]), tests, assumptions: text::assumptions(&request) })
}

impl PlanRequest {
    const fn most(&self) -> u64 {
        if self.sequential { MOST_AT_LOOKS } else { MOST_EPISODES }
    }

    fn check(&self) -> Result<(), PlanError> {
        if let Given::Runs(runs) = self.given {
            let episodes = runs.saturating_mul(self.clusters.seeds);
            let most = self.most();
            return if episodes > most { Err(PlanError::TooMany { episodes, most }) } else { Ok(()) };
        }
        let Given::Difference(difference) = self.given else { return Ok(()) };
        let Some(rates) = Rates::apart(difference, self.baseline) else {
            let baseline = self.baseline.unwrap_or_default();
            return Err(PlanError::BeyondOne { difference, baseline, higher: baseline + difference });
        };
        let (least, most) = rates.possible_discordance();
        match self.discordance {
            // A share typed with two digits is compared with sums of binary fractions.
            Some(found) if found < least - 1e-9 || found > most + 1e-9 => {
                Err(PlanError::Discordance { discordance: found, least, most })
            }
            _ => Ok(()),
        }
    }

    fn planned(&self, test: TestName, family: u64, level: f64) -> PlannedTest {
        #[expect(clippy::cast_precision_loss, reason = "pairs of models are few")]
        let level = level / family as f64;
        let (difference, runs) = match self.given {
            Given::Difference(difference) => (Some(difference), self.runs(test, level, difference)),
            Given::Runs(runs) => (self.difference(test, level, runs), Some(runs)),
        };
        let episodes = runs.map(|runs| runs * self.clusters.seeds);
        let mut anytime = difference.and_then(|difference| self.anytime(test, level, difference));
        let expected = anytime.as_mut().zip(episodes).map(|(anytime, most)| settled(anytime.expected(most)));
        PlannedTest {
            test,
            family,
            level: settled(level),
            difference: difference.map(settled),
            runs,
            episodes,
            effective: runs.map(|runs| self.clusters.units(runs)),
            power: difference.zip(runs).map(|(difference, runs)| settled(self.power_of(test, level, difference, runs))),
            boundary: anytime.map(|anytime| settled(anytime.boundary())),
            expected,
        }
    }

    fn power_of(&self, test: TestName, level: f64, difference: f64, runs: u64) -> f64 {
        self.test(test, level, difference).map_or(0.0, |mut test| self.clusters.power(test.as_mut(), runs))
    }

    fn runs(&self, test: TestName, level: f64, difference: f64) -> Option<u64> {
        self.clusters.runs_for(self.power, self.test(test, level, difference)?.as_mut())
    }

    fn difference(&self, test: TestName, level: f64, runs: u64) -> Option<f64> {
        let power = |difference| self.power_of(test, level, difference, runs);
        smallest(self.power, self.largest_difference(test), power)
    }

    fn largest_difference(&self, test: TestName) -> f64 {
        if matches!(test, TestName::Chance | TestName::ChanceSeeds | TestName::AnytimeChance) {
            return self.chance.map_or(0.0, |chance| 1.0 - chance.value());
        }
        let of_rates = self.baseline.map_or(1.0, |baseline| 1.0 - baseline);
        match self.discordance.filter(|_| test != TestName::Unpaired) {
            None => of_rates,
            Some(share) => of_rates.min(share).min(self.baseline.map_or(1.0, |baseline| 2.0 - 2.0 * baseline - share)),
        }
    }

    /// The test of a true difference; `None` for impossible rates, and for too few seeds for any verdict.
    fn test(&self, test: TestName, level: f64, difference: f64) -> Option<Box<dyn Power>> {
        let by_seed = |test| {
            let Clusters { seeds, icc, .. } = self.clusters;
            let fewest = holm::level(self.confidence).map_or(usize::MAX, fewest_clusters);
            (seeds >= fewest as u64).then(|| Box::new(Seeds { test, level, seeds, icc }) as Box<dyn Power>)
        };
        Some(match test {
            TestName::Paired => Box::new(McNemar::new(level, difference, self.discordance_of(difference)?)),
            TestName::Unpaired => Box::new(Fisher { level, rates: Rates::apart(difference, self.baseline)? }),
            TestName::Chance => {
                let (chance, rate) = self.above_chance(difference)?;
                Box::new(OneRate { level, chance, rate })
            }
            TestName::PairedSeeds => {
                by_seed(BySeed::Pairs { difference, discordance: self.discordance_of(difference)? })?
            }
            TestName::ChanceSeeds => {
                let (chance, rate) = self.above_chance(difference)?;
                by_seed(BySeed::Rate { chance, rate })?
            }
            TestName::AnytimePairs | TestName::AnytimeChance => Box::new(self.anytime(test, level, difference)?),
        })
    }

    fn anytime(&self, test: TestName, level: f64, difference: f64) -> Option<Anytime> {
        let every = self.clusters.seeds;
        match test {
            TestName::AnytimePairs => Anytime::pairs(level, every, difference, self.discordance_of(difference)?),
            TestName::AnytimeChance => {
                self.above_chance(difference).map(|(chance, rate)| Anytime::rate(level, every, chance, rate))
            }
            _ => None,
        }
    }

    fn discordance_of(&self, difference: f64) -> Option<f64> {
        Some(self.discordance.unwrap_or(Rates::apart(difference, self.baseline)?.independent_discordance()))
    }

    fn above_chance(&self, difference: f64) -> Option<(Ratio, f64)> {
        let chance = self.chance?;
        let rate = chance.value() + difference;
        (rate <= 1.0 + 1e-9).then_some((chance, rate.min(1.0)))
    }
}

#[cfg(test)]
mod tests {
    use super::register::{NamedHash, RegisteredPlan};
    use super::{Given, PlanRequest, TestName, plan};
    use mirrorstats_exact::ratio::Ratio;
    use mirrorstats_statistics::sample_size::Clusters;

    const PAPER: PlanRequest = PlanRequest {
        given: Given::Runs(7),
        baseline: None,
        power: 0.8,
        confidence: 0.95,
        models: 8,
        clusters: Clusters { seeds: 3, icc: 0.0, people: false },
        discordance: None,
        chance: None,
        sequential: false,
    };

    #[test]
    fn the_answer_comes_first() {
        let chance = Ratio::new(1, 3);
        let requests = [
            PlanRequest { given: Given::Difference(0.3), chance, ..PAPER },
            PlanRequest { chance, ..PAPER },
            PlanRequest {
                given: Given::Difference(0.3),
                clusters: Clusters { seeds: 3, icc: 0.1, people: false },
                ..PAPER
            },
            PlanRequest {
                given: Given::Runs(3),
                clusters: Clusters { seeds: 7, icc: 0.1, people: false },
                models: 2,
                chance,
                ..PAPER
            },
            PlanRequest { given: Given::Difference(0.5), models: 2, sequential: true, chance, ..PAPER },
            PlanRequest { given: Given::Runs(1), models: 2, ..PAPER },
            PlanRequest { given: Given::Difference(0.4), baseline: Some(0.5), discordance: Some(0.5), ..PAPER },
        ];
        let told: Vec<String> = requests.map(|request| plan(request).unwrap().render(None)).into();
        insta::assert_snapshot!(told.join("\n\n"));
    }

    // scipy 1.17.1: every outcome weighted by `binom.pmf`, `2 * binom.cdf` at 1/2, `brentq` at power 0.8.
    #[test]
    fn the_papers_episodes_show_what_the_reference_says() {
        let found = plan(PAPER).unwrap();
        let difference = |test, family| {
            let of = |planned: &&super::PlannedTest| planned.test == test && planned.family == family;
            found.tests.iter().find(of).unwrap().difference.unwrap()
        };
        for (test, family, expected) in [
            (TestName::Paired, 1, 0.474_423_209_958_402_6),
            (TestName::Paired, 28, 0.675_283_428_012_498),
            (TestName::Unpaired, 1, 0.469_799_311_969_556_9),
        ] {
            assert!((difference(test, family) - expected).abs() < 1e-9, "{test:?} {family}");
        }
    }

    #[test]
    fn impossible_plans_are_refused() {
        let message = |request: PlanRequest| plan(request).unwrap_err().to_string();
        let told = [
            message(PlanRequest { given: Given::Difference(0.6), baseline: Some(0.5), ..PAPER }),
            message(PlanRequest { given: Given::Difference(0.4), discordance: Some(0.3), ..PAPER }),
            message(PlanRequest { given: Given::Runs(1000), ..PAPER }),
            message(PlanRequest { given: Given::Runs(300), sequential: true, ..PAPER }),
        ];
        insta::assert_snapshot!(told.join("\n"));
    }

    #[test]
    fn a_registered_plan_shows_a_change() {
        let definitions = NamedHash { name: "paper".to_owned(), sha256: "0".repeat(64) };
        let register = || RegisteredPlan::new(plan(PAPER).unwrap(), definitions.clone(), Vec::new(), Vec::new());
        assert_eq!(register().to_json(), register().to_json());
        let mut read: RegisteredPlan = serde_json::from_str(&register().to_json()).unwrap();
        assert_eq!(read, register());
        assert!(read.is_unchanged());
        read.plan.request.power = 0.7;
        assert!(!read.is_unchanged());
    }
}

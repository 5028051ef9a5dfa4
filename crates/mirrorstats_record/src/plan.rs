use std::collections::BTreeSet;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use super::index::Place;
use mirrorstats_experiment::{Experiment, built_in_names};

/// Seeds and runs start at 1, as in the paper.
const FIRST: i32 = 1;

/// Experiments, seeds and runs; every combination is an episode.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plan {
    /// The experiments without duplicates, in order.
    pub experiments: Vec<Experiment>,
    /// Seeds 1 to this (3 in the paper).
    pub seeds: i32,
    /// Runs 1 to this for each seed (7 in the paper).
    pub runs: i32,
    pub repeats: i32,
    pub shard: Shard,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Key {
    pub experiment: Experiment,
    pub seed: i32,
    pub run: i32,
    /// The repetition of its scene, from 1.
    pub repetition: i32,
}

/// The subject of episodes: a model, under a named or the default condition.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Subject {
    pub model: String,
    /// The condition that the study varies besides the model; absent for the default one.
    pub condition: Option<String>,
}

impl Subject {
    pub fn for_model(model: &str) -> Self {
        Self { model: model.to_owned(), condition: None }
    }

    /// The subject as part of a file name: `oracle`, `oracle@near`. A model's slug contains no `@`.
    pub fn slug(&self) -> String {
        match &self.condition {
            None => slug(&self.model),
            Some(condition) => format!("{}@{}", slug(&self.model), slug(condition)),
        }
    }
}

impl Key {
    pub const fn first(experiment: Experiment, seed: i32, run: i32) -> Self {
        Self { experiment, seed, run, repetition: FIRST }
    }

    /// The episode's id: `E1/oracle/s1/r3`, with a condition `E1/oracle@near/s1/r3`, repeated `E1/oracle/s1/r3/x2`.
    pub fn episode_id(&self, subject: &Subject) -> String {
        let Self { experiment, seed, run, repetition } = self;
        let again = if *repetition > FIRST { format!("/x{repetition}") } else { String::new() };
        format!("{}/{}/s{seed}/r{run}{again}", experiment.name(), subject.slug())
    }

    /// The stem of the episode's file names: `E1-oracle-s1-r3`.
    pub fn file_stem(&self, subject: &Subject) -> String {
        self.episode_id(subject).replace('/', "-")
    }

    /// The seed of the agent's randomness: differs between episodes, and from the world's seeds.
    pub(crate) fn agent_seed(&self) -> u64 {
        let part = |value: i32| u64::from(value.unsigned_abs());
        // Rotated, not shifted: the number of a user's own experiment has all bits.
        let experiment = self.experiment.number().rotate_left(56);
        let again = part(self.repetition - FIRST) << 10;
        experiment ^ (part(self.seed) << 24) ^ again ^ part(self.run) ^ 0x6d69_7272_6f72
    }
}

/// A model's name as part of a file name: lower case, with `-` for everything but letters and digits.
pub fn slug(model: &str) -> String {
    let mut slug = String::new();
    for c in model.chars().flat_map(char::to_lowercase) {
        match c {
            c if c.is_ascii_alphanumeric() => slug.push(c),
            _ if slug.is_empty() || slug.ends_with('-') => {}
            _ => slug.push('-'),
        }
    }
    let slug = slug.trim_end_matches('-');
    if slug.is_empty() { "agent".to_owned() } else { slug.to_owned() }
}

impl Plan {
    /// The number of its episodes, those of other shards included.
    pub fn size(&self) -> u64 {
        let counts = [self.seeds, self.runs, self.repeats].map(|count| u64::from(count.unsigned_abs()));
        counts.into_iter().fold(self.experiments.len() as u64, u64::saturating_mul)
    }

    pub fn keys(&self) -> Vec<Key> {
        let (seeds, runs, repeats) = (self.seeds, self.runs, self.repeats);
        let all = self.experiments.iter().flat_map(move |experiment| {
            let scenes = (FIRST..=seeds).flat_map(move |seed| (FIRST..=runs).map(move |run| (seed, run)));
            scenes.flat_map(move |(seed, run)| {
                (FIRST..=repeats).map(move |repetition| Key { experiment: experiment.clone(), seed, run, repetition })
            })
        });
        all.enumerate().filter(|(at, _)| self.shard.has(*at)).map(|(_, key)| key).collect()
    }
}

/// The planned episodes, and those that are not recorded yet, by experiment.
#[derive(Clone, Debug)]
pub struct Episodes {
    pub planned: Vec<Key>,
    pub todo: Vec<Key>,
}

impl Episodes {
    /// `recorded` gives the seeds, runs and repetitions that an experiment already has.
    pub fn of<E>(plan: &Plan, recorded: impl Fn(&Experiment) -> Result<BTreeSet<Place>, E>) -> Result<Self, E> {
        let planned = plan.keys();
        let mut todo = Vec::with_capacity(planned.len());
        for experiment in &plan.experiments {
            let done = recorded(experiment)?;
            let own = planned.iter().filter(|key| key.experiment == *experiment);
            todo.extend(own.filter(|key| !done.contains(&(key.seed, key.run, key.repetition))).cloned());
        }
        Ok(Self { planned, todo })
    }

    pub fn found(&self) -> Vec<Key> {
        let todo: BTreeSet<&Key> = self.todo.iter().collect();
        self.planned.iter().filter(|key| !todo.contains(key)).cloned().collect()
    }
}

/// One of several equal shares of the episodes, as `3/16`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    index: usize,
    count: usize,
}

impl Shard {
    pub const WHOLE: Self = Self { index: 1, count: 1 };

    const fn has(self, at: usize) -> bool {
        at % self.count == self.index - 1
    }
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected {expected}, found `{found}`")]
pub struct NotAPlan {
    expected: &'static str,
    found: String,
}

impl FromStr for Shard {
    type Err = NotAPlan;

    fn from_str(text: &str) -> Result<Self, NotAPlan> {
        let numbers = text.split_once('/').and_then(|(index, count)| Some((index.parse().ok()?, count.parse().ok()?)));
        match numbers {
            Some((index, count)) if 1 <= index && index <= count => Ok(Self { index, count }),
            _ => Err(NotAPlan { expected: "a share such as 3/16, from 1/16 to 16/16", found: text.to_owned() }),
        }
    }
}

/// Experiments as typed: `E1`, `E1..E5`, `E1,E3`, a file such as `mine.toml`, or several of these with commas; without
/// duplicates, in order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Experiments(pub Vec<Named>);

#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Named {
    BuiltIn(Experiment),
    File(PathBuf),
}

const EXPECTED: &str = "experiments such as E1, E1..E5, E1,E3 or mine.toml";

impl Experiments {
    /// Parses typed experiments, for file names with arbitrary bytes.
    pub fn parse(typed: &OsStr) -> Result<Self, NotAPlan> {
        let mut found = BTreeSet::new();
        for part in parts(typed) {
            let file = part.to_str().map_or(part.as_os_str(), |text| OsStr::new(text.trim()));
            if Path::new(file).extension().is_some_and(|ending| ending == "toml") {
                found.insert(Named::File(file.into()));
                continue;
            }
            let text = part.to_string_lossy();
            let fault = || NotAPlan { expected: EXPECTED, found: text.clone().into_owned() };
            let experiment = |name: &str| Experiment::parse(name.trim()).map_err(|_| fault());
            let (first, last) = text.split_once("..").unwrap_or((&text, &text));
            let range = experiment(first)?..=experiment(last)?;
            if range.is_empty() {
                return Err(fault());
            }
            let known = built_in_names().into_iter().flat_map(Experiment::parse);
            found.extend(known.filter(|one| range.contains(one)).map(Named::BuiltIn));
        }
        Ok(Self(found.into_iter().collect()))
    }
}

#[cfg(unix)]
fn parts(typed: &OsStr) -> Vec<OsString> {
    use std::os::unix::ffi::OsStrExt as _;
    typed.as_bytes().split(|byte| *byte == b',').map(|part| OsStr::from_bytes(part).to_owned()).collect()
}

#[cfg(not(unix))]
fn parts(typed: &OsStr) -> Vec<OsString> {
    typed.to_string_lossy().split(',').map(OsString::from).collect()
}

#[cfg(test)]
mod tests {
    use super::{Experiment, Experiments, Key, Named, Plan, Shard, Subject, slug};

    const E1: Experiment = Experiment::E1;
    const E2: Experiment = Experiment::E2;
    const E3: Experiment = Experiment::E3;
    const E5: Experiment = Experiment::E5;

    #[test]
    fn experiments_come_as_names_ranges_and_lists() {
        let read = |text: &str| Experiments::parse(text.as_ref()).map(|list| list.0);
        assert_eq!(read("E1").unwrap(), [E1].map(Named::BuiltIn));
        assert_eq!(read("E1..E3").unwrap(), [E1, E2, E3].map(Named::BuiltIn));
        assert_eq!(read("E5,E1, E1").unwrap(), [E1, E5].map(Named::BuiltIn));
        assert_eq!(read("labs/../mine.toml").unwrap(), [Named::File("labs/../mine.toml".into())]);
        for wrong in ["", "E6", "E3..E1", "E1..", "E1;E2"] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn shards_share_all_episodes_and_no_episode_twice() {
        let plan = |shard: &str| {
            let shard = shard.parse().unwrap();
            Plan { experiments: vec![E1, E5], seeds: 3, runs: 7, repeats: 1, shard }.keys()
        };
        let mut parts: Vec<_> = (1..=4).flat_map(|at| plan(&format!("{at}/4"))).collect();
        parts.sort_unstable();
        assert_eq!(parts, plan("1/1"));
        assert_eq!(parts.len(), 42);
        for wrong in ["0/4", "5/4", "1", "a/b", "1/0"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn the_first_repetition_has_an_unsuffixed_id_and_a_fixed_seed() {
        let first = Key::first(E1, 1, 3);
        let again = Key { repetition: 2, ..first.clone() };
        let subject = Subject::for_model("oracle");
        assert_eq!(
            (first.episode_id(&subject), again.episode_id(&subject)),
            ("E1/oracle/s1/r3".into(), "E1/oracle/s1/r3/x2".into())
        );
        assert_eq!(first.agent_seed(), (1 << 56) ^ (1 << 24) ^ 3 ^ 0x6d69_7272_6f72);
        let keys = Plan { experiments: vec![E1], seeds: 2, runs: 999, repeats: 99, shard: Shard::WHOLE }.keys();
        let mut seeds: Vec<u64> = keys.iter().map(Key::agent_seed).collect();
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), keys.len());
    }

    #[test]
    fn names_of_models_become_names_of_files() {
        assert_eq!(slug("Claude Sonnet 4.6"), "claude-sonnet-4-6");
        assert_eq!(slug("google/gemma-4-31b-it:nitro"), "google-gemma-4-31b-it-nitro");
        assert_eq!(slug("../../x"), "x");
        assert_eq!(slug("?"), "agent");
    }
}

//! The distribution of episodes among participants, and their order.
//!
//! Rule: only a participant's position among the codes matters, so the same command always deals the same way.

use indexmap::IndexMap;

use mirrorstats_exact::names;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Planned {
    pub episode_id: String,
    pub experiment: String,
    pub seed: i32,
    pub repetition: i32,
    pub is_recorded: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Design {
    /// Each episode is played by one participant.
    Split,
    /// Every participant plays every scene.
    Crossed,
    /// Every participant plays separate scenes.
    OwnSeeds,
}

names!(Design { Split: "split", Crossed: "crossed", OwnSeeds: "own-seeds" });

impl Design {
    /// The order of play: by experiment, seed and run; or by the rows of a Latin square in which each item follows every
    /// other item equally often, if all play the same scenes.
    pub const fn order(self) -> &'static str {
        if matches!(self, Self::Crossed) { "counterbalanced" } else { "planned" }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Schedule {
    pub design: Design,
    /// The seeds of one participant.
    pub seeds: i32,
    /// The number of times that one participant plays a scene.
    pub repeats: i32,
}

impl Schedule {
    /// Deals planned episodes to `people` participants, each in the order of play.
    pub(crate) fn lanes<'a>(&self, planned: &'a [Planned], people: usize) -> Vec<Vec<&'a Planned>> {
        let mut lanes = vec![Vec::new(); people];
        for (at, episode) in planned.iter().enumerate() {
            let own = match self.design {
                Design::Split => Some(at % people.max(1)),
                Design::Crossed => part(episode.repetition, self.repeats),
                Design::OwnSeeds => part(episode.seed, self.seeds),
            };
            if let Some(lane) = own.and_then(|own| lanes.get_mut(own)) {
                lane.push(episode);
            }
        }
        if self.design == Design::Crossed {
            lanes = lanes.into_iter().enumerate().map(|(row, lane)| counterbalanced(lane, row)).collect();
        }
        lanes
    }
}

/// The index, from 0, of the part of this size that contains a number from 1.
fn part(number: i32, size: i32) -> Option<usize> {
    usize::try_from((number - 1) / size.max(1)).ok()
}

/// Experiments stay together, since each has its own prompt; they and their episodes follow the order of the row.
fn counterbalanced(lane: Vec<&Planned>, row: usize) -> Vec<&Planned> {
    let mut experiments: IndexMap<&str, Vec<&Planned>> = IndexMap::new();
    for episode in lane {
        experiments.entry(&episode.experiment).or_default().push(episode);
    }
    let blocks = latin_row(experiments.len(), row).into_iter().map(|at| &experiments[at]);
    blocks.flat_map(|block| latin_row(block.len(), row).into_iter().map(move |at| block[at])).collect()
}

/// A row of Williams' Latin square of `n`: over `n` rows, or `2n` if `n` is odd, each item follows every other item
/// equally often (Williams 1949).
fn latin_row(n: usize, row: usize) -> Vec<usize> {
    if n == 0 {
        return Vec::new();
    }
    let first = |at: usize| if at % 2 == 1 { at.div_ceil(2) } else { (n - at / 2) % n };
    let mut items: Vec<usize> = (0..n).map(|at| (first(at) + row) % n).collect();
    if n % 2 == 1 && (row / n) % 2 == 1 {
        items.reverse();
    }
    items
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::{Design, Planned, Schedule, latin_row};

    fn planned(seeds: i32, repeats: i32) -> Vec<Planned> {
        let episode = |seed, repetition| Planned {
            episode_id: format!("s{seed}/x{repetition}"),
            experiment: "E1".to_owned(),
            seed,
            repetition,
            is_recorded: false,
        };
        (1..=seeds).flat_map(|seed| (1..=repeats).map(move |repetition| episode(seed, repetition))).collect()
    }

    #[test]
    fn each_item_follows_each_other_equally_often() {
        for n in 1..=7 {
            let rows = if n % 2 == 0 { n } else { 2 * n };
            let mut follows: BTreeMap<(usize, usize), usize> = BTreeMap::new();
            for row in 0..rows {
                let items = latin_row(n, row);
                items.windows(2).for_each(|pair| *follows.entry((pair[0], pair[1])).or_default() += 1);
                let mut sorted = items;
                sorted.sort_unstable();
                assert_eq!(sorted, (0..n).collect::<Vec<_>>());
            }
            assert_eq!(follows.len(), n * (n - 1), "{n}");
            assert!(follows.values().all(|count| *count == rows / n), "{n}: {follows:?}");
        }
    }

    #[test]
    fn designs_divide_the_episodes() {
        let schedule = |design| Schedule { design, seeds: 2, repeats: 1 };
        let ids = |schedule: Schedule, planned: &[Planned]| -> Vec<Vec<String>> {
            let lanes = schedule.lanes(planned, 2).into_iter();
            lanes.map(|lane| lane.into_iter().map(|episode| episode.episode_id.clone()).collect()).collect()
        };
        let crossed = ids(schedule(Design::Crossed), &planned(2, 2));
        assert_eq!(crossed, [["s1/x1", "s2/x1"], ["s2/x2", "s1/x2"]]);
        let own = ids(schedule(Design::OwnSeeds), &planned(4, 1));
        assert_eq!(own, [["s1/x1", "s2/x1"], ["s3/x1", "s4/x1"]]);
        let split = ids(schedule(Design::Split), &planned(3, 1));
        assert_eq!(split, [vec!["s1/x1", "s3/x1"], vec!["s2/x1"]]);
    }
}

//! The checks of the design audit: each names what limits comparisons, and the questions that it touches.

use std::collections::{BTreeMap, BTreeSet};

use super::{ALL, DesignCheck, DesignFinding, OF_MODELS, Touched};
use crate::comparable::{BODY_COLOR, Budget, ORIGIN, PARTICIPANT, REPETITION, SCENE};
use crate::statistics::comparisons::matching::singular;
use crate::statistics::rates::durations::{decided, is_duration};
use crate::statistics::{FEW, Replies, span};
use crate::study::{Block, RowKey, Study, couples};
use mirrorstats_exact::format::{counted, fixed};
use mirrorstats_metric::catalogs::catalog::Better;
use mirrorstats_score::tables::lost_counts::LostCounts;
use mirrorstats_statistics::design::DesignKind;
use mirrorstats_statistics::durations::competing::Outcome;

/// The largest unnamed shift of a rate. Weighting groups differently moves a mean by at most the total variation
/// distance of the weights times the range of the groups' means, which is 1 for a rate.
const LARGEST_SHIFT: f64 = 0.1;

/// Repeated scenes from which a pattern of failures before each success is named: (1/4)^3 < 0.05 by chance.
const FEWEST_RETRIED: usize = 3;

/// How much two sides differ, by which check, and the finding.
type Difference = (f64, DesignCheck, String);

pub(super) struct Audit<'s, 'a> {
    pub study: &'s Study<'a>,
    pub findings: Vec<DesignFinding>,
}

fn name(block: &Block) -> String {
    block.side.map_or_else(|| block.name(), |side| format!("{} ({side})", block.name()))
}

fn about(block: &Block) -> String {
    format!("{} {}", block.experiment, name(block))
}

/// The rows of each value of a label.
pub(super) fn by_label<'a>(study: &Study<'a>, block: &Block, label: &str) -> BTreeMap<&'a str, Vec<usize>> {
    let mut found: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    let column = study.table.label(label);
    for (row, value) in block.rows().filter_map(|row| Some((row, column?.get(row)?))) {
        found.entry(value).or_default().push(row);
    }
    found
}

pub(super) fn seeds(study: &Study, block: &Block) -> BTreeMap<i32, u64> {
    let mut found = BTreeMap::new();
    block.rows().for_each(|row| *found.entry(study.table.keys.seed(row)).or_default() += 1);
    found
}

/// The share of each group.
fn shares<K: Copy + Ord>(counts: &BTreeMap<K, u64>) -> BTreeMap<K, f64> {
    let all: u64 = counts.values().sum();
    counts.iter().map(|(key, count)| (*key, *count as f64 / all as f64)).collect()
}

/// The total variation distance of two weightings, and the group whose weights differ most.
fn distance<K: Copy + Ord>(one: &BTreeMap<K, f64>, other: &BTreeMap<K, f64>) -> Option<(f64, K)> {
    let keys: BTreeSet<&K> = one.keys().chain(other.keys()).collect();
    let weight = |side: &BTreeMap<K, f64>, key: &K| side.get(key).copied().unwrap_or(0.0);
    let gaps: Vec<(f64, K)> =
        keys.into_iter().map(|key| ((weight(one, key) - weight(other, key)).abs(), *key)).collect();
    let largest = gaps.iter().max_by(|a, b| a.0.total_cmp(&b.0))?.1;
    Some((gaps.iter().map(|(gap, _)| gap).sum::<f64>() / 2.0, largest))
}

/// The steps of the episodes of a block.
pub(super) struct Ends {
    /// The episodes without a decision, by their steps.
    unfinished: BTreeMap<i64, u64>,
    longest: i64,
    episodes: u64,
    /// The last step of an episode: recorded, or where all unfinished episodes end.
    budget: Option<i64>,
    is_recorded: bool,
}

impl Ends {
    /// `None` without a duration, for tasks with a budget per scene, and for reconstructions.
    pub fn of(study: &Study, block: &Block) -> Option<Self> {
        // The ends of reconstructed episodes are made up, as far as no published number fixes them.
        if study.design.kind == Some(DesignKind::Reconstruction) {
            return None;
        }
        let mut durations = study.relations.durations.iter().filter(|(name, _)| is_duration(study, name));
        let column = durations.find_map(|(name, _)| study.column(name))?;
        let (mut unfinished, mut longest, mut episodes) = (BTreeMap::new(), 0, 0);
        for ending in block.rows().filter_map(|row| decided(study, column, row)) {
            (longest, episodes) = (ending.steps.max(longest), episodes + 1);
            if ending.outcome == Outcome::Unfinished {
                *unfinished.entry(ending.steps).or_default() += 1;
            }
        }
        let (budget, is_recorded) = match study.recorded_budget(block) {
            Budget::Varying => return None,
            Budget::Steps(steps) => (Some(steps), true),
            Budget::Undeclared => (unfinished.keys().next().filter(|_| unfinished.len() == 1).copied(), false),
        };
        Some(Self { unfinished, longest, episodes, budget, is_recorded })
    }

    /// The number of episodes without a decision.
    pub fn undecided(&self) -> u64 {
        self.unfinished.values().sum()
    }

    /// The fewest and the most steps of those.
    pub fn undecided_steps(&self) -> Option<[i64; 2]> {
        Some([*self.unfinished.keys().next()?, *self.unfinished.keys().next_back()?])
    }

    /// True if episodes without a decision end before the budget, or at different steps.
    fn is_cut(&self) -> bool {
        match self.budget.filter(|_| self.is_recorded) {
            Some(budget) => self.unfinished.keys().any(|steps| *steps < budget),
            None => self.unfinished.len() > 1,
        }
    }

    /// The steps that an episode may have had.
    fn reach(&self) -> i64 {
        self.budget.unwrap_or(self.longest).max(self.longest)
    }
}

impl Audit<'_, '_> {
    pub fn find(&mut self, check: DesignCheck, touches: &[Touched], finding: String) {
        if !self.findings.iter().any(|it| it.finding == finding) {
            self.findings.push(DesignFinding { check, finding, touches: touches.to_vec() });
        }
    }

    pub fn left_out(&mut self, lost: Option<&LostCounts>, entirely: &[(RowKey, u64)], replies: Option<&Replies>) {
        let lost = lost.map_or(0, LostCounts::total);
        if lost > 0 {
            self.find(DesignCheck::Losses, &ALL, format!("{} lost", counted(lost, "episode")));
        }
        for (key, lost) in entirely {
            let all = if *lost == 1 { "its only episode was".to_owned() } else { format!("all {lost} episodes were") };
            let finding = format!("cannot say for {} in {}: {all} lost", key.name(), key.experiment);
            self.find(DesignCheck::Losses, &ALL, finding);
        }
        if let Some(replies) = replies.filter(|replies| replies.unusable > 0) {
            let finding = format!("{} of {} gave no decision", replies.unusable, counted(replies.replies, "reply"));
            self.find(DesignCheck::Replies, &ALL, finding);
        }
    }

    pub fn origins(&mut self) {
        let Some(column) = self.study.table.label(ORIGIN) else { return };
        let origins: BTreeSet<&str> = column.iter().flatten().collect();
        if origins.len() > 1 {
            let origins = Vec::from_iter(origins).join(" and ");
            self.find(DesignCheck::Origins, &ALL, format!("episodes of different kinds: {origins}"));
        }
    }

    pub fn scenes(&mut self) {
        let table = self.study.table;
        let Some((scenes, colors)) = table.label(SCENE).zip(table.label(BODY_COLOR)) else { return };
        let whole = |row| scenes.get(row).zip(colors.get(row)).and_then(|(scene, color)| of_color(scene, color));
        let found: BTreeSet<&str> = (0..table.len()).filter_map(whole).collect();
        if let Some(first) = found.first() {
            let finding = format!(
                "{} with different body colours under one name, such as `{first}`: not the same scene, not paired",
                counted(found.len() as u64, "scene")
            );
            self.find(DesignCheck::Scenes, &ALL, finding);
        }
    }

    pub fn mixture(&mut self, block: &Block) {
        let people = by_label(self.study, block, PARTICIPANT);
        let of_people: usize = people.values().map(Vec::len).sum();
        let others = block.rows().count() - of_people;
        if of_people > 0 && others > 0 {
            let finding = format!(
                "{}: people and programs under one name ({}, and {} without a participant)",
                about(block),
                counted(people.len() as u64, "participant"),
                counted(others as u64, "episode")
            );
            self.find(DesignCheck::Mixture, &ALL, finding);
        }
    }

    /// Scenes are repeated alike if each has the repetitions 1 to k. Repeating until success favours the model.
    pub fn repetitions(&mut self, block: &Block) {
        let study = self.study;
        let scenes = by_label(study, block, SCENE);
        let column = study.table.label(REPETITION);
        let numbers = |rows: &Vec<usize>| -> Option<Vec<i64>> {
            let mut numbers = rows.iter().map(|row| column?.get(*row)?.parse().ok()).collect::<Option<Vec<i64>>>()?;
            numbers.sort_unstable();
            Some(numbers)
        };
        let about = about(block);
        let known: Option<BTreeSet<Vec<i64>>> = scenes.values().map(numbers).collect();
        let is_alike = |found: &BTreeSet<Vec<i64>>| {
            found.len() <= 1
                && found.first().is_none_or(|numbers| numbers.iter().copied().eq((1..).take(numbers.len())))
        };
        if let Some(found) = known.filter(|found| !is_alike(found)) {
            let named: BTreeSet<i64> = found.into_iter().flatten().collect();
            let named = named.first().zip(named.last()).map_or_else(String::new, |(a, b)| format!("{a} to {b}"));
            let finding =
                format!("{about}: scenes are repeated unequally (repetitions {named}, not the same in each scene)");
            self.find(DesignCheck::Repetitions, &OF_MODELS, finding);
        }
        let Some(rate) = study.rates().find(|column| study.metric(&column.name).better == Better::Higher) else {
            return;
        };
        let values = |rows: &Vec<usize>| -> Vec<i64> {
            let mut rows = rows.clone();
            let repetition = |row: usize| column.and_then(|column| column.get(row)?.parse::<i64>().ok());
            rows.sort_by_key(|row| (repetition(*row), study.table.keys.seed(*row), study.table.keys.run(*row)));
            rows.into_iter().filter_map(|row| rate.get(row)).collect()
        };
        let is_retried =
            |values: &Vec<i64>| values.last() == Some(&1) && values[..values.len() - 1].iter().all(|it| *it == 0);
        let played: Vec<Vec<i64>> = scenes.values().map(values).filter(|values| !values.is_empty()).collect();
        let repeated = played.iter().filter(|values| values.len() > 1).count();
        if repeated >= FEWEST_RETRIED && played.iter().all(is_retried) {
            let finding = format!("{about}: each scene is repeated until the first success");
            self.find(DesignCheck::Repetitions, &OF_MODELS, finding);
        }
    }

    pub fn units(&mut self, block: &Block) {
        let Some(rate) = self.study.rates().next().filter(|_| block.repeats) else { return };
        let units = self.study.by_unit(block, |row| rate.get(row));
        let counts: BTreeMap<_, u64> = units.iter().map(|(unit, moments)| (*unit, moments.n)).collect();
        let once = counts.keys().map(|unit| (*unit, 1)).collect();
        if distance(&shares(&counts), &shares(&once)).is_none_or(|(shift, _)| shift <= LARGEST_SHIFT) {
            return;
        }
        let means: Vec<f64> = units.values().filter_map(|unit| unit.mean()).collect();
        let by_unit = means.iter().sum::<f64>() / means.len() as f64;
        let unit = self.study.unit_name(block);
        let finding = format!(
            "{}: {} to {} per {}, so that {} is {} by episodes and {} by {unit}",
            about(block),
            counts.values().min().unwrap_or(&0),
            counted(*counts.values().max().unwrap_or(&0), "episode"),
            singular(unit),
            rate.name,
            fixed(block.moments(rate).mean(), 3),
            fixed(Some(by_unit), 3)
        );
        self.find(DesignCheck::Units, &ALL, finding);
    }

    pub fn budgets(&mut self, group: &[&Block]) {
        let ends: Vec<(&Block, Ends)> =
            group.iter().filter_map(|block| Some((*block, Ends::of(self.study, block)?))).collect();
        let Some((longest, reach)) = ends.iter().map(|(block, ends)| (block, ends.reach())).max_by_key(|it| it.1)
        else {
            return;
        };
        for (block, ends) in &ends {
            // Silence is below chance without a wrong guess.
            if ends.episodes >= FEW && ends.undecided() == ends.episodes {
                let finding = format!("{}: no decision made in {}", about(block), counted(ends.episodes, "episode"));
                self.find(DesignCheck::Budgets, &[Touched::Levels], finding);
            }
        }
        for (block, ends) in ends.iter().filter(|(_, ends)| ends.is_cut()) {
            let steps = ends.undecided_steps().map_or_else(String::new, |[first, last]| span(first, last));
            let other = if name(longest) == name(block) {
                String::new()
            } else {
                format!(", {} runs to {reach}", name(longest))
            };
            let finding = format!(
                "{}: {} of {} end undecided after {steps} steps, which is no common budget{other}",
                about(block),
                ends.undecided(),
                counted(ends.episodes, "episode")
            );
            self.find(DesignCheck::Budgets, &OF_MODELS, finding);
        }
        let limited =
            ends.iter().filter(|(_, ends)| !ends.is_cut()).filter_map(|(block, ends)| Some((block, ends.budget?)));
        let Some((block, budget)) = limited.min_by_key(|it| it.1).filter(|(_, budget)| *budget < reach) else { return };
        let finding = format!(
            "{}: episodes of {} end after {budget} steps, those of {} run to {reach}: they do not have the same chance",
            block.experiment,
            name(block),
            name(longest)
        );
        self.find(DesignCheck::Budgets, &OF_MODELS, finding);
    }

    /// The two blocks that differ most under a check.
    pub fn most_different(
        &mut self,
        group: &[&Block],
        touched: Touched,
        check: fn(&Self, [&Block; 2]) -> Option<Difference>,
    ) {
        let mut found: Vec<_> = couples(group).filter_map(|(first, second)| check(self, [first, second])).collect();
        let count = found.len();
        // The first of the most different ones: the sort is stable.
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        let Some((_, check, finding)) = found.into_iter().next() else { return };
        let more = if count > 1 { format!(", and {} more", counted(count as u64 - 1, "pair")) } else { String::new() };
        self.find(check, &[touched], finding + &more);
    }

    pub fn seeds(&self, [first, second]: [&Block; 2]) -> Option<Difference> {
        // The seeds of reconstructions are made up.
        if self.study.design.kind == Some(DesignKind::Reconstruction) {
            return None;
        }
        let counts = [first, second].map(|block| seeds(self.study, block));
        let (shift, seed) = distance(&shares(&counts[0]), &shares(&counts[1]))?;
        let of = |side: usize| {
            format!("{} of {}", counts[side].get(&seed).unwrap_or(&0), counts[side].values().sum::<u64>())
        };
        let names = if first.experiment == second.experiment {
            format!("{}: {} and {}", first.experiment, name(first), name(second))
        } else {
            format!("{}: {} and {}", first.name(), first.experiment, second.experiment)
        };
        let finding = format!("{names} are divided unequally among seeds (seed {seed}: {} and {})", of(0), of(1));
        (shift > LARGEST_SHIFT).then_some((shift, DesignCheck::Seeds, finding))
    }

    pub fn shared_scenes(&self, [first, second]: [&Block; 2]) -> Option<Difference> {
        let [one, other] = [first, second].map(|block| by_label(self.study, block, SCENE));
        let is_shared = one.is_empty() || other.is_empty() || one.keys().any(|scene| other.contains_key(scene));
        let finding = format!("{}: {} and {} share no scene", first.experiment, name(first), name(second));
        let is_made_up = self.study.design.kind == Some(DesignKind::Reconstruction);
        (!is_shared && !is_made_up).then_some((0.0, DesignCheck::Scenes, finding))
    }

    pub fn drivers(&self, [first, second]: [&Block; 2]) -> Option<Difference> {
        let setting = self.study.driver_between(first, second)?;
        let finding =
            format!("{}: {} and {} are driven differently: {setting}", first.experiment, name(first), name(second));
        Some((0.0, DesignCheck::Drivers, finding))
    }
}

/// The name of a scene without the colour that was added to distinguish it.
fn of_color<'s>(scene: &'s str, color: &str) -> Option<&'s str> {
    scene.strip_suffix(')')?.strip_suffix(color)?.strip_suffix(" (")
}

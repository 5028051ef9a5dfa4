//! The design audit: what a set of episodes can be compared for, before any test is made.
//!
//! Rule: each finding says which questions it touches, and the answers take their caveats about the design from here.

mod checks;

use std::collections::{BTreeMap, BTreeSet};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::checks::{Audit, Ends, by_label, seeds};
use super::Options;
use super::comparisons::conditions::Contrast;
use crate::comparable::SCENE;
use crate::study::{Block, Experiment, RowKey, Study};
use mirrorstats_exact::moments::MomentOverflow;
use mirrorstats_score::tables::lost_counts::LostCounts;
use mirrorstats_score::tables::table::{CONDITION, EpisodeTable};

/// The design of a study: its cells, and what limits comparisons.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct DesignAudit {
    /// All cells, including those whose episodes were all lost.
    pub cells: Vec<CellDesign>,
    /// What limits comparisons; empty where the design is sound.
    pub findings: Vec<DesignFinding>,
}

/// The episodes of one cell.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct CellDesign {
    #[serde(flatten)]
    pub key: RowKey,
    /// The counted episodes.
    pub episodes: u64,
    /// The episodes that were lost and are not counted.
    pub lost: u64,
    /// The declared scenes.
    pub scenes: u64,
    /// Those that every other cell of the experiment has too.
    pub shared_scenes: u64,
    /// The most episodes of a scene; 0 without declared scenes.
    pub most_repeats: u64,
    /// The seeds.
    pub seeds: u64,
    /// The episodes that ended without a decision; null for definitions without durations.
    pub unfinished: Option<u64>,
    /// The fewest and the most steps of those.
    pub unfinished_steps: Option<[i64; 2]>,
}

/// The check behind a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DesignCheck {
    /// Episodes that are copies of others, or may be.
    Copies,
    /// Lost episodes.
    Losses,
    /// Replies without a decision.
    Replies,
    /// Recorded, imported or reconstructed episodes in one study.
    Origins,
    /// People and programs under one name.
    Mixture,
    /// One name for different scenes.
    Scenes,
    /// Scenes repeated unequally, or until success.
    Repetitions,
    /// Units with unequal numbers of episodes.
    Units,
    /// Seeds with unequal shares of two sides.
    Seeds,
    /// Ends before a common budget.
    Budgets,
    /// Agents that were driven differently.
    Drivers,
}

/// A question of the answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Touched {
    /// A model against a level.
    Levels,
    /// Models against each other.
    Models,
    /// Experiments against each other.
    Experiments,
}

const ALL: [Touched; 3] = [Touched::Levels, Touched::Models, Touched::Experiments];
const OF_MODELS: [Touched; 2] = [Touched::Levels, Touched::Models];

/// One limit of the design.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct DesignFinding {
    /// The check.
    pub check: DesignCheck,
    /// The finding, in a phrase.
    pub finding: String,
    /// The questions whose answers it limits.
    pub touches: Vec<Touched>,
}

impl DesignAudit {
    /// The audit of a table alone. Errors: sums of squares beyond 128 bits.
    pub fn from_table(table: &EpisodeTable, options: &Options) -> Result<Self, MomentOverflow> {
        let study = Study::from_table(table, options.design, options.lost.as_ref(), None)?;
        Ok(Self::of(&study, options))
    }

    pub(crate) fn of(study: &Study, options: &Options) -> Self {
        let (lost, replies) = (options.lost.as_ref(), options.replies.as_ref());
        let mut audit = Audit { study, findings: Vec::new() };
        options.copies.iter().for_each(|copies| audit.find(DesignCheck::Copies, &ALL, copies.clone()));
        let lost_cells = lost.map_or_else(Vec::new, |lost| lost_entirely(study, lost));
        audit.left_out(lost, &lost_cells, replies);
        audit.origins();
        audit.scenes();
        for experiment in &study.experiments {
            for block in &experiment.blocks {
                audit.mixture(block);
                audit.repetitions(block);
                audit.units(block);
            }
            for group in compared(experiment) {
                audit.budgets(&group);
                audit.most_different(&group, Touched::Models, Audit::seeds);
                audit.most_different(&group, Touched::Models, Audit::shared_scenes);
                audit.most_different(&group, Touched::Models, Audit::drivers);
            }
        }
        let contrasts: Vec<_> =
            Contrast::pairs(study).iter().flat_map(|pair| pair.couples().collect::<Vec<_>>()).collect();
        for (first, second) in contrasts {
            audit.most_different(&[first, second], Touched::Experiments, Audit::seeds);
        }
        let of_experiment = |experiment: &Experiment| -> Vec<CellDesign> {
            experiment.blocks.iter().map(|block| CellDesign::of(study, experiment, block)).collect()
        };
        let mut cells: Vec<CellDesign> = study.experiments.iter().flat_map(of_experiment).collect();
        cells.extend(lost_cells.into_iter().map(|(key, lost)| CellDesign { key, lost, ..CellDesign::default() }));
        Self { cells, findings: audit.findings }
    }

    /// The findings in phrases that limit this question.
    pub fn phrases(&self, question: Touched) -> impl Iterator<Item = &String> {
        self.findings.iter().filter(move |it| it.touches.contains(&question)).map(|it| &it.finding)
    }

    /// All findings in sentences.
    pub fn sentences(&self) -> Vec<String> {
        self.findings.iter().map(|it| format!("{}.", it.finding)).collect()
    }

    /// The caveats of an answer to this question: the filter, pooling, what the caller declares, and the findings.
    pub(super) fn caveats(&self, question: Touched, options: &Options, is_pooled: bool) -> Vec<String> {
        let selection = options.selection.as_ref().map(super::Selection::phrase);
        let pooled = is_pooled.then(|| "recordings that differ are pooled".to_owned());
        let given = options.caveats.iter().cloned();
        selection.into_iter().chain(pooled).chain(given).chain(self.phrases(question).cloned()).collect()
    }
}

impl CellDesign {
    fn of(study: &Study, experiment: &Experiment, block: &Block) -> Self {
        let scenes = by_label(study, block, SCENE);
        let others: Vec<_> = experiment.blocks.iter().filter(|other| !std::ptr::eq(*other, block)).collect();
        let others: Vec<_> = others.into_iter().map(|other| by_label(study, other, SCENE)).collect();
        let is_shared = |scene: &&&str| others.iter().all(|other| other.contains_key(**scene));
        let ends = Ends::of(study, block);
        Self {
            key: block.key(),
            episodes: block.rows().count() as u64,
            lost: block.lost,
            scenes: scenes.len() as u64,
            shared_scenes: scenes.keys().filter(is_shared).count() as u64,
            most_repeats: scenes.values().map(Vec::len).max().unwrap_or(0) as u64,
            seeds: seeds(study, block).len() as u64,
            unfinished: ends.as_ref().map(Ends::undecided),
            unfinished_steps: ends.as_ref().and_then(Ends::undecided_steps),
        }
    }
}

/// The cells without any counted episode, and how many they lost.
pub(crate) fn lost_entirely(study: &Study, lost: &LostCounts) -> Vec<(RowKey, u64)> {
    let conditions = study.table.label(CONDITION).is_some() && study.table.has_conditions();
    let key = |key: &mirrorstats_score::quality::CellKey| RowKey {
        experiment: key.experiment.clone(),
        model: key.model.clone(),
        condition: conditions.then(|| key.condition.clone()),
    };
    let known: BTreeSet<RowKey> = study.blocks().map(Block::key).collect();
    let mut found: BTreeMap<RowKey, u64> = BTreeMap::new();
    for (cell, count) in lost.iter() {
        *found.entry(key(cell)).or_default() += count;
    }
    found.into_iter().filter(|(key, _)| !known.contains(key)).collect()
}

/// The blocks of an experiment that are compared with each other: all, or the two sides of each model.
fn compared<'s, 'a>(experiment: &'s Experiment<'a>) -> Vec<Vec<&'s Block<'a>>> {
    let mut groups: BTreeMap<_, Vec<&Block>> = BTreeMap::new();
    for block in &experiment.blocks {
        groups.entry(block.side.map(|_| (block.model, block.condition))).or_default().push(block);
    }
    groups.into_values().collect()
}

//! What `stats` shows: everything that can be said about cells at this n, and what cannot.
//!
//! Rule: no statistic is computed here. This module asks `cells` about each cell, pair and block, keeps the
//! answers as plain data for programs ([`Statistics`] as JSON) and states them for people ([`text`]).
//! Cells follow the grouping asked for; every comparison is by experiment and model, paired by seed and run.

mod cells;
mod chance;
mod clusters;
mod conclusions;
mod conditions;
mod durations;
mod losses;
mod models;
mod sequential;
mod study;
pub mod text;

use std::collections::BTreeSet;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use cells::{CellRow, FEW, Intervals};
pub use chance::{ChanceRow, Role, Verdict};
pub use clusters::ClusterRow;
pub use conditions::{Contrast, Method};
pub use durations::{CENSORED, DurationRow};
pub use losses::{LossRow, Losses};
pub use models::{Family, Gap, PairTest, Reach};
pub use sequential::{Sequential, SequentialChance, SequentialPair, SequentialRate};

use crate::score::table::EpisodeTable;
use crate::stats::cell::Cells;
use crate::stats::moments::MomentOverflow;
use study::Study;

/// What may be chosen about statistics.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// The confidence of every interval, and one minus the level of every test; between 0 and 1.
    pub confidence: f64,
    /// The horizon of restricted means in steps, instead of the last step known for every model.
    pub horizon: Option<i64>,
    /// The identifiers of the episodes that the infrastructure ended; `None` where the traces do not say.
    pub lost: Option<BTreeSet<String>>,
}

impl Default for Options {
    fn default() -> Self {
        Self { confidence: 0.95, horizon: None, lost: None }
    }
}

/// All statistics of a set of episodes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Statistics {
    /// The definition file's own name.
    pub definitions: String,
    /// SHA-256 of the resolved definitions.
    pub definitions_hash: String,
    /// The confidence of every interval.
    pub confidence: f64,
    /// The columns that cells are grouped by.
    pub by: Vec<String>,
    /// The number of episodes.
    pub episodes: usize,
    /// What a reader may conclude, a sentence each.
    pub conclusions: Vec<String>,
    /// What a reader must not conclude, and why, a sentence each.
    pub warnings: Vec<String>,
    /// The metrics that the conclusions are about.
    pub headline: Vec<String>,
    /// Every cell with its intervals.
    pub cells: Vec<CellRow>,
    /// Rates against chance and reference levels.
    pub chance: Vec<ChanceRow>,
    /// Models against each other.
    pub models: Vec<Family>,
    /// Episodes without a partner to be paired with.
    pub gaps: Vec<Gap>,
    /// The first experiment minus each other one.
    pub conditions: Vec<Contrast>,
    /// Cells by seed.
    pub clusters: Vec<ClusterRow>,
    /// Durations with censoring.
    pub durations: Vec<DurationRow>,
    /// Episodes lost to infrastructure.
    pub losses: Losses,
}

impl Statistics {
    /// The statistics of `table`; `cells` are the cells of the same table, grouped as its reader wants them.
    ///
    /// With a confidence outside (0, 1) no interval and no verdict is defined.
    ///
    /// # Errors
    /// When the squares of some metric leave 128 bits, which no metric of steps can.
    pub fn of(table: &EpisodeTable, cells: &Cells, options: &Options) -> Result<Self, MomentOverflow> {
        let study = Study::of(table)?;
        let confidence = options.confidence;
        let mut statistics = Self {
            definitions: table.catalog.name.clone(),
            definitions_hash: table.catalog.hash.clone(),
            confidence,
            by: cells.by.clone(),
            episodes: table.len(),
            conclusions: Vec::new(),
            warnings: Vec::new(),
            headline: conclusions::headline(&study),
            cells: CellRow::all(&study, cells, confidence),
            chance: ChanceRow::all(&study, confidence),
            models: Family::all(&study, confidence),
            gaps: Gap::all(&study),
            conditions: Contrast::all(&study, confidence),
            clusters: ClusterRow::all(&study, confidence),
            durations: DurationRow::all(&study, options.horizon, confidence),
            losses: Losses::of(&study, options.lost.as_ref(), confidence),
        };
        statistics.conclusions = conclusions::conclusions(&statistics);
        statistics.warnings = conclusions::warnings(&statistics);
        Ok(statistics)
    }
}

//! The answer of `stats`: everything that these cells can show at this n, and everything that they cannot.
//!
//! Rule: this module computes no statistics. It collects the results for each cell, pair and block, keeps them as plain
//! data for programs ([`Statistics`] as JSON) and prints them for people ([`text`]). Cells follow the requested
//! grouping. Every comparison is by experiment, model and condition, and follows the declared design: paired if scenes
//! are equal, by clusters if they are declared, otherwise over independent episodes.

#![expect(clippy::cast_precision_loss, reason = "counts of episodes, cells and tests are far below 2^53")]

mod answers;
mod apart;
pub(crate) mod comparisons {
    pub(crate) mod compare;
    pub(super) mod conditions;
    pub(super) mod family;
    pub(super) mod losses;
    pub(crate) mod matching;
    pub(super) mod models;
    pub(super) mod retest;
    pub(super) mod trends;
}
mod conclusions;
pub(crate) mod design_audit;
mod episodes;
mod options;
mod rates {
    pub(super) mod cells;
    pub(super) mod chance;
    pub(super) mod durations;
    pub(super) mod overall;
    pub(super) mod ranks;
    pub(super) mod sequential;
}
pub mod text;
mod warnings;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use answers::{Answer, AnswerRole};
pub use apart::SettingApart;
pub use comparisons::compare::{Comparison, Equivalence, Method, Sign};
pub use comparisons::conditions::Contrast;
pub use comparisons::losses::{LossCase, LossCases, LossRow, Losses};
pub use comparisons::matching::{Matching, Units};
pub use comparisons::models::{Family, Gap, PairTest, Reach};
pub use comparisons::retest::RetestRow;
pub use comparisons::trends::{Dose, TrendRow};
pub use design_audit::{CellDesign, DesignAudit, DesignCheck, DesignFinding, Touched};
pub(crate) use episodes::span;
pub use episodes::{Replies, Selection, UnusableReplies};
pub use options::Options;
pub(crate) use rates::cells::FEW;
pub use rates::cells::{CellRow, ClusterRow, Intervals};
pub use rates::chance::{ChanceRow, Role, Verdict};
pub use rates::durations::{CorrectRow, DurationRow};
pub use rates::overall::{ImprovementRow, OverallMethod, OverallRow};
pub use rates::ranks::{RankRow, Ranks};
pub use rates::sequential::{Sequential, SequentialChance, SequentialPair, SequentialRate};

pub use crate::study::RowKey;

use self::comparisons::models;
use self::rates::overall;
use crate::study::Study;
use mirrorstats_exact::moments::MomentOverflow;
use mirrorstats_metric::catalogs::relations::Relations;
use mirrorstats_score::cells::Cells;
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_statistics::design::Design;

/// All statistics of a set of episodes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
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
    /// The filter that chose the episodes; null without one.
    #[serde(default, rename = "where")]
    pub selection: Option<Selection>,
    /// The departures from the registered plan; null without a plan.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub departures: Option<Vec<String>>,
    /// Settings that differ within a cell or between cells that are compared, and were declared not to matter.
    #[serde(default)]
    pub pooled: Vec<String>,
    /// The settings that keep cells from being compared, each with what it keeps apart; absent if there is none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_comparable: Vec<SettingApart>,
    /// The design audit: the cells, and what limits comparisons.
    #[serde(default)]
    pub audit: DesignAudit,
    /// The declared design.
    pub design: Design,
    /// The consequence of the design, in a sentence.
    pub design_note: String,
    /// The number of families of tests behind the answers; Holm's adjustment holds within each.
    #[serde(default)]
    pub families: usize,
    /// The answers to the questions of the study, a line each; the primary one first.
    pub answers: Vec<Answer>,
    /// The conclusions, a sentence each.
    pub conclusions: Vec<String>,
    /// The warnings against conclusions, with reasons, a sentence each.
    pub warnings: Vec<String>,
    /// The metrics that the conclusions are about.
    pub headline: Vec<String>,
    /// Every cell with its intervals.
    pub cells: Vec<CellRow>,
    /// Rates against chance and reference levels.
    pub chance: Vec<ChanceRow>,
    /// Models against each other.
    pub models: Vec<Family>,
    /// Models against each other over all experiments, under the headline rates.
    pub overall: Vec<OverallRow>,
    /// The ranks that the tests leave open, in each experiment and over all of them.
    #[serde(default)]
    pub ranks: Vec<RankRow>,
    /// The probability that one model decides earlier than another; empty unless asked for.
    pub improvements: Vec<ImprovementRow>,
    /// Scenes that keep episodes out of pairs, where models are compared by pairs.
    pub gaps: Vec<Gap>,
    /// The first experiment minus each other one.
    pub conditions: Vec<Contrast>,
    /// Headline rates against the doses of each factor.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub trends: Vec<TrendRow>,
    /// Cells by seed; none unless the design declares that seeds are clusters.
    pub clusters: Vec<ClusterRow>,
    /// Durations with censoring.
    pub durations: Vec<DurationRow>,
    /// Verdicts on scenes that a model played more than once.
    #[serde(default)]
    pub retests: Vec<RetestRow>,
    /// Episodes lost to infrastructure.
    pub losses: Losses,
    /// Replies that gave no decision; null where no status of a reply is recorded.
    #[serde(default)]
    pub replies: Option<Replies>,
    /// Relations between metrics, for the text.
    #[serde(skip)]
    relations: Relations,
    /// True for the domain of the mirror, for the text.
    #[serde(skip)]
    is_mirror: bool,
}

impl Statistics {
    /// The statistics of `table`; `cells` are the cells of the same table, in the requested grouping. For a confidence
    /// outside (0, 1), intervals and verdicts are undefined.
    pub fn from_table(table: &EpisodeTable, cells: &Cells, options: &Options) -> Result<Self, MomentOverflow> {
        let mut study = Study::from_table(table, options.design, options.lost.as_ref(), None)?;
        let confidence = options.confidence;
        (study.confidence, study.pool, study.margin) = (confidence, options.pooled.is_some(), options.margin);
        let headline = conclusions::headline(&study);
        let asked: &[String] = if options.improvements { &headline } else { &[] };
        let (models, gaps) = models::compared(&study);
        let overall = overall::rates(&study, &models, &headline);
        let mut statistics = Self {
            definitions: table.catalog.name.clone(),
            definitions_hash: table.catalog.hash.clone(),
            confidence,
            by: cells.by.clone(),
            episodes: table.len(),
            selection: options.selection.clone(),
            pooled: options.pooled_in(&study),
            audit: DesignAudit::of(&study, options),
            design: options.design,
            cells: CellRow::all(&study, cells),
            chance: ChanceRow::all(&study),
            ranks: RankRow::all(&models, &overall),
            models,
            overall,
            improvements: overall::improvements(&study, asked),
            gaps,
            conditions: Contrast::all(&study),
            trends: TrendRow::all(&study, &headline),
            clusters: ClusterRow::all(&study),
            durations: DurationRow::all(&study),
            retests: RetestRow::all(&study),
            losses: Losses::of(&study, options.lost.is_some()),
            replies: options.replies.clone(),
            headline,
            relations: study.relations.clone(),
            is_mirror: table.catalog.domain.is_none(),
            ..Self::default()
        };
        for cell in &mut statistics.cells {
            cell.note_left_out(options.lost.as_ref(), options.replies.as_ref());
        }
        statistics.not_comparable = SettingApart::all(&statistics);
        statistics.design_note = warnings::design_note(&statistics);
        (statistics.answers, statistics.families) = answers::answers(&statistics, options);
        statistics.conclusions = conclusions::conclusions(&statistics);
        statistics.warnings = warnings::warnings(&statistics);
        statistics.warnings.extend(statistics.pooled.iter().cloned());
        statistics.warnings.extend(Contrast::left_out(&study));
        Ok(statistics)
    }
}

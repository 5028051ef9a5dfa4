//! Both sides of a gate as one table with a label for the side; and the scenes in which the later value differs.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::GateOptions;
use crate::comparable::{BODY_COLOR, FINGERPRINT, ORIGIN, PARTICIPANT, REPETITION, SCENE, divide_scenes_by_color};
use crate::statistics::comparisons::matching::Scenes;
use crate::study::{Block, Study};
use mirrorstats_exact::moments::MomentOverflow;
use mirrorstats_exact::number::Decimal;
use mirrorstats_metric::catalogs::catalog::Better;
use mirrorstats_score::quality::CellKey;
use mirrorstats_score::tables::builder::TableBuilder;
use mirrorstats_score::tables::lost_counts::LostCounts;
use mirrorstats_score::tables::table::CONDITION;
use mirrorstats_score::tables::table::{EpisodeTable, Header, KeyRef, MetricColumn};
use mirrorstats_statistics::design::Design;

const SIDE: &str = "side";
const SIDES: [&str; 2] = ["base", "new"];
/// The labels for units that episodes share, for their recording settings, and for their side.
const LABELS: [&str; 8] = [CONDITION, SCENE, FINGERPRINT, PARTICIPANT, SIDE, ORIGIN, BODY_COLOR, REPETITION];
pub(super) const DEFAULT: &str = "default";

/// The assumed result of lost episodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LossFill {
    Out,
    /// Failures on the later side, successes on the earlier one.
    Against,
    /// Successes on the later side, failures on the earlier one.
    For,
}

pub(super) struct GateSides<'a> {
    tables: [&'a EpisodeTable; 2],
    renamed: Option<[&'a str; 2]>,
}

impl<'a> GateSides<'a> {
    pub fn of(base: &'a EpisodeTable, new: &'a EpisodeTable) -> Self {
        let only = |table: &'a EpisodeTable| {
            let mut models = table.keys.model.iter().flatten();
            let first = models.next()?;
            models.all(|model| model == first).then_some(first)
        };
        let renamed = only(base).zip(only(new)).filter(|(old, new)| old != new).map(|(old, new)| [old, new]);
        Self { tables: [base, new], renamed }
    }

    /// The reason why no cell can be compared: different definitions, or episodes of different origin.
    pub(crate) fn barrier(&self) -> Option<String> {
        let [base, new] = self.tables;
        let hash = |table: &EpisodeTable| table.catalog.hash.chars().take(8).collect::<String>();
        if base.catalog.hash != new.catalog.hash {
            return Some(format!("definitions ({}, {})", hash(base), hash(new)));
        }
        let kind = |table: &EpisodeTable| table.declared.origin.map_or("nothing", |origin| origin.name());
        (kind(base) != kind(new)).then(|| format!("kind is {} and {}", kind(base), kind(new)))
    }

    /// The earlier name of a model, if it is another one.
    pub(crate) fn base_model(&self, model: &str) -> Option<&'a str> {
        self.renamed.filter(|[_, new]| *new == model).map(|[old, _]| old)
    }

    /// The lost episodes of both sides, under the later names of models.
    pub(super) fn lost(&self, lost: &[LostCounts; 2]) -> LostCounts {
        let mut all = LostCounts::default();
        for (side, lost) in lost.iter().enumerate() {
            for (key, count) in lost.iter() {
                let model = self.model(side, &key.model).to_owned();
                (0..*count).for_each(|_| all.add(CellKey { model: model.clone(), ..key.clone() }));
            }
        }
        all
    }

    fn model<'m>(&'m self, side: usize, model: &'m str) -> &'m str {
        match self.renamed {
            Some([_, new]) if side == 0 => new,
            _ => model,
        }
    }
}

pub(super) fn joined(sides: &GateSides, options: &GateOptions, fill: LossFill) -> EpisodeTable {
    let [base, new] = sides.tables;
    let names = new.metrics.iter().map(|column| column.name.clone());
    let metrics: Vec<String> = names.filter(|name| base.metric(name).is_some()).collect();
    let labels = LABELS.map(str::to_owned).to_vec();
    let mut catalog = new.catalog.clone();
    catalog.declare(base.catalog.declared());
    let mut builder = TableBuilder::new(Header { catalog, labels, metrics: metrics.clone() });
    let is_lower = new.catalog.metric.get(&options.metric).is_some_and(|metric| metric.better == Better::Lower);
    for (side, table) in sides.tables.into_iter().enumerate() {
        let is_good = (side == 1) == (fill == LossFill::For);
        let lost = i64::from(is_good != is_lower);
        let value = |name: &String, own: Option<i64>, is_lost: bool| {
            if is_lost && *name == options.metric { Some(lost) } else { own }
        };
        for row in (0..table.len()).filter(|row| fill != LossFill::Out || !table.is_lost(*row)) {
            let key = table.keys.get(row);
            let label = |name: &&str| match *name {
                SIDE => Some(SIDES[side]),
                name => table.label(name).and_then(|label| label.get(row)),
            };
            let own = |name: &String| table.metric(name).and_then(|column| column.get(row));
            let values = metrics.iter().map(|name| value(name, own(name), table.is_lost(row)));
            let key = KeyRef { model: sides.model(side, key.model), ..key };
            builder.push(key, LABELS.iter().map(label), values);
        }
        for lost in table.declared.unrecorded.iter().filter(|_| fill != LossFill::Out) {
            let key = KeyRef {
                experiment: &lost.experiment,
                model: sides.model(side, &lost.model),
                seed: lost.seed,
                run: lost.run,
                episode_id: &lost.episode_id,
            };
            let label = |name: &&str| match *name {
                SIDE => Some(SIDES[side]),
                CONDITION => lost.condition.as_deref(),
                _ => None,
            };
            builder.push(key, LABELS.iter().map(label), metrics.iter().map(|name| value(name, None, true)));
        }
    }
    let declared = base.declared.clone().joined(new.declared.clone());
    let mut joined = EpisodeTable { declared, ..builder.finish() };
    // A label that no side has says nothing.
    joined.labels.retain(|label| {
        ![ORIGIN, BODY_COLOR, REPETITION].contains(&&*label.name) || label.values.iter().any(|it| it.is_some())
    });
    divide_scenes_by_color(&mut joined);
    joined
}

pub(super) fn study(joined: &EpisodeTable, design: Design, confidence: f64) -> Result<Study<'_>, MomentOverflow> {
    let mut study = Study::from_table(joined, design, None, joined.label(SIDE))?;
    study.confidence = confidence;
    Ok(study)
}

pub(super) fn couples<'s, 'a>(blocks: &'s [Block<'a>]) -> Vec<[Option<&'s Block<'a>>; 2]> {
    let mut couples = BTreeMap::<_, [Option<&Block>; 2]>::new();
    for block in blocks {
        let side = usize::from(block.side == Some(SIDES[1]));
        couples.entry((block.model, block.condition)).or_default()[side].get_or_insert(block);
    }
    couples.into_values().collect()
}

/// The condition of a block; `None` for the default one.
pub(super) fn condition(block: &Block) -> Option<String> {
    block.condition.filter(|text| *text != DEFAULT).map(str::to_owned)
}

/// Two episodes of one scene with different values.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct FlippedPair {
    /// The earlier episode.
    pub base: Played,
    /// The later one.
    pub new: Played,
}

/// An episode of one side.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Played {
    /// Its id.
    pub episode_id: String,
    /// Its value.
    pub value: Decimal,
    /// The timesteps that decided it, ascending; null where the side is scores.
    pub timesteps: Option<Vec<i64>>,
}

/// The pairs of episodes whose values differ, matched by scene in order, or by id if no scenes are declared. Empty for
/// reconstructions.
pub(super) fn flips(study: &Study, column: &MetricColumn, [base, new]: [&Block; 2]) -> Vec<FlippedPair> {
    let id = |row: usize| study.table.keys.get(row).episode_id;
    let by_scene = |block: &Block| Scenes::of(study, block).rows;
    let (old, later) = (by_scene(base), by_scene(new));
    let pairs: Vec<(usize, usize)> = if !study.design.has_pairs() {
        Vec::new()
    } else if old.is_empty() || later.is_empty() {
        let old: BTreeMap<&str, usize> = base.rows().map(|row| (id(row), row)).collect();
        new.rows().filter_map(|row| Some((*old.get(id(row))?, row))).collect()
    } else {
        let both = later.iter().filter_map(|(scene, rows)| Some((old.get(scene)?, rows)));
        both.flat_map(|(old, new)| old.iter().copied().zip(new.iter().copied())).collect()
    };
    let played = |row: usize| {
        let value = study.table.decimal(column, row)?;
        Some(Played { episode_id: id(row).to_owned(), value, timesteps: None })
    };
    let flipped = pairs.into_iter().filter_map(|(old, later)| {
        let (base, new) = (played(old)?, played(later)?);
        (base.value != new.value).then_some(FlippedPair { base, new })
    });
    let mut flips: Vec<FlippedPair> = flipped.collect();
    flips.sort_by(|a, b| a.new.episode_id.cmp(&b.new.episode_id));
    flips
}

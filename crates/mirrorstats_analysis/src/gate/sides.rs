//! Both sides of a gate as one table, where the condition identifies an episode's side; and the scenes in which the later
//! value differs.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::GateOptions;
use crate::comparable::FINGERPRINT;
use crate::statistics::comparisons::matching::Scenes;
use crate::study::{Block, Study};
use mirrorstats_metric::catalogs::catalog::Better;
use mirrorstats_score::cells::group::CONDITION;
use mirrorstats_score::tables::builder::TableBuilder;
use mirrorstats_score::tables::table::{EpisodeTable, Header, KeyRef, MetricColumn};

/// The prefixes of the condition and the episode id of each side.
const MARKS: [&str; 2] = ["0/", "1/"];
/// The labels for units that episodes share, and for their recording settings.
const LABELS: [&str; 4] = [CONDITION, "scene", FINGERPRINT, "participant"];
pub(super) const DEFAULT: &str = "default";

/// The assumed result of lost episodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LossFill {
    /// Not counted.
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
            let mut models = table.keys.models().iter().flatten();
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

    pub(crate) fn base_model(&self, model: &str) -> Option<String> {
        self.renamed.filter(|[_, new]| *new == model).map(|[old, _]| old.to_owned())
    }

    /// The lost episodes, earlier and later, by experiment, model and condition.
    pub fn lost(&self) -> BTreeMap<(&str, &str, &str), [u64; 2]> {
        let mut counts = BTreeMap::<_, [u64; 2]>::new();
        for (side, table) in self.tables.into_iter().enumerate() {
            let mut add = |experiment, model, condition: Option<&'a str>| {
                let cell = (experiment, self.model(side, model), condition.unwrap_or(DEFAULT));
                counts.entry(cell).or_default()[side] += 1;
            };
            for row in (0..table.len()).filter(|row| table.is_lost(*row)) {
                let key = table.keys.get(row);
                add(key.experiment, key.model, table.label(CONDITION).and_then(|label| label.get(row)));
            }
            for lost in &table.declared.unrecorded {
                add(&lost.experiment, &lost.model, lost.condition.as_deref());
            }
        }
        counts
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
        let mark = |text: &str| format!("{}{text}", MARKS[side]);
        for row in (0..table.len()).filter(|row| fill != LossFill::Out || !table.is_lost(*row)) {
            let key = table.keys.get(row);
            let text = |name: &str| table.label(name).and_then(|label| label.get(row)).map(str::to_owned);
            let label = |name: &&str| match *name {
                CONDITION => Some(mark(&text(CONDITION).unwrap_or_else(|| DEFAULT.to_owned()))),
                name => text(name),
            };
            let labels: Vec<Option<String>> = LABELS.iter().map(label).collect();
            let own = |name: &String| table.metric(name).and_then(|column| column.get(row));
            let values = metrics.iter().map(|name| value(name, own(name), table.is_lost(row)));
            let id = mark(key.episode_id);
            let key = KeyRef { model: sides.model(side, key.model), episode_id: &id, ..key };
            builder.push(key, labels.iter().map(Option::as_deref), values);
        }
        for lost in table.declared.unrecorded.iter().filter(|_| fill != LossFill::Out) {
            let id = mark(&lost.episode_id);
            let condition = mark(lost.condition.as_deref().unwrap_or(DEFAULT));
            let key = KeyRef {
                experiment: &lost.experiment,
                model: sides.model(side, &lost.model),
                seed: lost.seed,
                run: lost.run,
                episode_id: &id,
            };
            let labels = LABELS.iter().map(|name| (*name == CONDITION).then_some(condition.as_str()));
            builder.push(key, labels, metrics.iter().map(|name| value(name, None, true)));
        }
    }
    let declared = base.declared.clone().joined(new.declared.clone());
    EpisodeTable { declared, ..builder.finish() }
}

pub(super) fn couples<'s, 'a>(blocks: &'s [Block<'a>]) -> Vec<[Option<&'s Block<'a>>; 2]> {
    let mut couples = BTreeMap::<_, [Option<&Block>; 2]>::new();
    for block in blocks {
        let Some((mark, condition)) = block.condition.map(|text| text.split_at(MARKS[0].len())) else { continue };
        couples.entry((block.model, condition)).or_default()[usize::from(mark == MARKS[1])].get_or_insert(block);
    }
    couples.into_values().collect()
}

/// The condition of a block without its side; `None` for the default one.
pub(super) fn condition(block: &Block) -> Option<String> {
    block.condition.map(|text| &text[MARKS[0].len()..]).filter(|text| *text != DEFAULT).map(str::to_owned)
}

fn id(text: &str) -> &str {
    &text[MARKS[0].len()..]
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
    pub value: i64,
    /// The timesteps that decided it, ascending; null where the side is scores.
    pub timesteps: Option<Vec<i64>>,
}

/// The pairs of episodes whose values differ, matched by scene in order, or by id if no scenes are declared. Empty for
/// reconstructions.
pub(super) fn flips(study: &Study, column: &MetricColumn, [base, new]: [&Block; 2]) -> Vec<FlippedPair> {
    let id = |row: usize| id(study.table.keys.get(row).episode_id);
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
        let value = column.get(row)?;
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

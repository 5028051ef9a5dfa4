//! Compares a study with its registered plan: each departure, in a phrase.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Display;

use serde_json::Value;

use super::TestName;
use super::register::{NamedHash, RegisteredPlan};
use crate::statistics::{Options, span};
use mirrorstats_score::tables::table::EpisodeTable;

const BY_PAIRS: &str = "pairs of equal scenes";
const BY_SEED: &str = "seeds, each counted once";

impl TestName {
    const fn pairing(self) -> &'static str {
        match self {
            Self::PairedSeeds | Self::ChanceSeeds => BY_SEED,
            _ => BY_PAIRS,
        }
    }
}

/// The number of looks: one at a fixed number of episodes, or any number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Looks {
    Once,
    Any,
}

mirrorstats_exact::names!(Looks { Once: "one", Any: "any number" });

pub fn departures(plan: &RegisteredPlan, table: &EpisodeTable, options: &Options, looks: Looks) -> Vec<String> {
    let request = &plan.plan.request;
    let mut found = Vec::new();
    let mut differ = |what: &str, registered: &dyn Display, seen: &dyn Display| {
        let (registered, seen) = (registered.to_string(), seen.to_string());
        if registered != seen {
            found.push(format!("{what}: {registered} registered, {seen} found"));
        }
    };
    let recorded = table.declared.registration.as_ref().map_or("none", |it| short(&it.sha256));
    differ("plan", &short(&plan.sha256), &recorded);
    differ("definitions", &short(&plan.definitions.sha256), &short(&table.catalog.hash));
    for (what, registered, recorded) in recorded_otherwise(plan, table) {
        differ(&what, &short(registered), &short(&recorded));
    }
    let (models, experiments): (BTreeSet<&str>, BTreeSet<&str>) =
        table.keys.iter().map(|key| (key.model, key.experiment)).unzip();
    differ("models", &request.models, &models.len());
    for (what, registered, names) in
        [("models", &plan.model_names, models), ("experiments", &plan.experiment_names, experiments)]
    {
        let registered: BTreeSet<&str> = registered.iter().map(String::as_str).collect();
        if !registered.is_empty() {
            differ(what, &listed(registered), &listed(names));
        }
    }
    let blocks = PlannedBlocks::of(table);
    differ("seeds of a model in an experiment", &request.clusters.seeds, &blocks.each(|block| block.seeds.len()));
    if let Some(planned) = plan.plan.tests.first() {
        if let Some(episodes) = planned.episodes {
            differ("episodes of a model in an experiment", &episodes, &blocks.each(|block| block.episodes));
            // Each episode is its own scene, which all models share.
            let scenes = options.design.has_pairs().then(|| blocks.each(|block| block.scenes.len()));
            differ("scenes of a model in an experiment", &episodes, &scenes.unwrap_or_else(|| "none".to_owned()));
        }
        differ("test", &planned.test.pairing(), &blocks.pairing(options.design.clusters().is_some()));
    }
    differ("confidence", &request.confidence, &options.confidence);
    let registered = if request.sequential { Looks::Any } else { Looks::Once };
    differ("looks", &registered.name(), &looks.name());
    let filter = |filter: Option<&String>| filter.map_or_else(|| "none".to_owned(), |it| format!("`{it}`"));
    let analysed = options.selection.as_ref().map(|it| &it.condition);
    differ("filter", &filter(plan.filter.as_ref()), &filter(analysed));
    if let Some(primary) = &plan.primary {
        let is_scored = table.metric(primary).is_some();
        differ("primary metric", primary, if is_scored { primary } else { &"none of this name" });
    }
    found
}

fn listed(names: BTreeSet<&str>) -> String {
    Vec::from_iter(names).join(", ")
}

/// The world and the prompts for which footer and plan differ: name, registered hash, recorded hash.
fn recorded_otherwise<'p>(plan: &'p RegisteredPlan, table: &EpisodeTable) -> BTreeSet<(String, &'p str, String)> {
    let mut found = BTreeSet::new();
    let mut compare = |what: String, registered: Option<&'p NamedHash>, recorded: &Value| {
        if let (Some(registered), Some(recorded)) = (registered, recorded.as_str()) {
            found.insert((what, registered.sha256.as_str(), recorded.to_owned()));
        }
    };
    let named = |all: &'p [NamedHash], name: &str| all.iter().find(|it| it.name == name);
    for recording in table.declared.recordings.values() {
        compare("world".to_owned(), named(&plan.experiments, "world"), &recording["world_hash"]);
        let experiment = &recording["experiment"];
        let prompt = experiment["prompt"].as_str().unwrap_or_default();
        compare(format!("prompt `{prompt}`"), named(&plan.prompts, prompt), &experiment["prompt_hash"]);
    }
    found
}

fn short(hash: &str) -> &str {
    hash.get(..12).unwrap_or(hash)
}

#[derive(Default)]
struct PlannedBlock {
    seeds: BTreeSet<i32>,
    scenes: BTreeSet<usize>,
    episodes: usize,
}

struct PlannedBlocks<'a>(BTreeMap<(&'a str, &'a str), PlannedBlock>);

impl<'a> PlannedBlocks<'a> {
    fn of(table: &'a EpisodeTable) -> Self {
        let scenes = table.label("scene");
        let mut blocks: BTreeMap<(&str, &str), PlannedBlock> = BTreeMap::new();
        for (row, key) in table.keys.iter().enumerate() {
            let block = blocks.entry((key.experiment, key.model)).or_default();
            block.seeds.insert(key.seed);
            block.scenes.extend(scenes.and_then(|scenes| scenes.code(row)));
            block.episodes += 1;
        }
        Self(blocks)
    }

    fn each(&self, count: fn(&PlannedBlock) -> usize) -> String {
        let counts = self.0.values().map(count);
        span(counts.clone().min().unwrap_or(0), counts.max().unwrap_or(0))
    }

    fn pairing(&self, by_seed: bool) -> &'static str {
        let blocks: Vec<_> = self.0.iter().collect();
        let is_shared = blocks.windows(2).all(|two| two[0].0.0 != two[1].0.0 || two[0].1.scenes == two[1].1.scenes);
        let has_scenes = blocks.iter().all(|(_, block)| !block.scenes.is_empty());
        match (by_seed, has_scenes && is_shared) {
            (true, _) => BY_SEED,
            (false, true) => BY_PAIRS,
            (false, false) => "episodes that are not all pairs of equal scenes",
        }
    }
}

//! A study beside the plan that was registered for it: each departure, in a phrase.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Display;

use super::register::RegisteredPlan;
use crate::statistics::Options;
use score::table::EpisodeTable;

/// How the episodes are analysed: once, at a number fixed beforehand, or at every look.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Looks {
    Once,
    Any,
}

impl Looks {
    const fn name(self) -> &'static str {
        match self {
            Self::Once => "one",
            Self::Any => "any number",
        }
    }
}

/// What differs between a plan and the analysis of these episodes; empty where nothing does.
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
    let models: BTreeSet<&str> = table.keys.iter().map(|key| key.model).collect();
    differ("models", &request.models, &models.len());
    let blocks = Blocks::of(table);
    differ("seeds of a model in an experiment", &request.clusters.seeds, &blocks.seeds());
    if let Some(episodes) = plan.plan.tests.first().and_then(|test| test.episodes) {
        differ("episodes of a model in an experiment", &episodes, &blocks.episodes());
    }
    differ("confidence", &request.confidence, &options.confidence);
    let registered = if request.sequential { Looks::Any } else { Looks::Once };
    differ("looks", &registered.name(), &looks.name());
    let filter = options.selection.as_ref().map_or_else(|| "none".to_owned(), |it| format!("`{}`", it.condition));
    differ("filter", &"none", &filter);
    if let Some(primary) = &plan.primary {
        let is_scored = table.metric(primary).is_some();
        differ("primary metric", primary, if is_scored { primary } else { &"none of this name" });
    }
    found
}

fn short(hash: &str) -> &str {
    hash.get(..12).unwrap_or(hash)
}

/// The seeds and the number of episodes of each model in each experiment.
struct Blocks(Vec<(usize, usize)>);

impl Blocks {
    fn of(table: &EpisodeTable) -> Self {
        let mut blocks: BTreeMap<(&str, &str), (BTreeSet<i32>, usize)> = BTreeMap::new();
        for key in table.keys.iter() {
            let (seeds, episodes) = blocks.entry((key.experiment, key.model)).or_default();
            seeds.insert(key.seed);
            *episodes += 1;
        }
        Self(blocks.into_values().map(|(seeds, episodes)| (seeds.len(), episodes)).collect())
    }

    fn seeds(&self) -> String {
        range(self.0.iter().map(|(seeds, _)| *seeds))
    }

    fn episodes(&self) -> String {
        range(self.0.iter().map(|(_, episodes)| *episodes))
    }
}

fn range(counts: impl Iterator<Item = usize> + Clone) -> String {
    match (counts.clone().min(), counts.max()) {
        (Some(least), Some(most)) if least < most => format!("{least} to {most}"),
        (least, _) => least.unwrap_or(0).to_string(),
    }
}

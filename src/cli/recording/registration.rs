//! Compares a registered plan with the recording that is about to start.

use std::path::Path;

use crate::cli::Failure;
use crate::cli::scoring::read_plan;
use mirrorstats_agents::prompt;
use mirrorstats_analysis::plan::register::{NamedHash, RegisteredPlan};
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_trace::footers::declared::Registration;

/// The name of the world among the experiments of a plan.
pub(crate) const WORLD: &str = "world";

pub(crate) fn prompts() -> Vec<NamedHash> {
    let hashes = prompt::hashes();
    let named = hashes.as_object().into_iter().flatten();
    named.filter_map(|(name, hash)| Some(NamedHash { name: name.clone(), sha256: hash.as_str()?.to_owned() })).collect()
}

pub(crate) fn registration(file: &Path, config: &WorldConfig) -> Result<Registration, Failure> {
    let plan = read_plan(file)?;
    check(file, &plan, config)?;
    Ok(Registration { sha256: plan.sha256, definitions: Some(plan.definitions.sha256) })
}

fn check(file: &Path, plan: &RegisteredPlan, config: &WorldConfig) -> Result<(), Failure> {
    let short = |hash: &str| hash.chars().take(12).collect::<String>();
    let refused = |what: &str, expected: &str, found: &str| {
        let (file, expected, found) = (file.display(), short(expected), short(found));
        let help = "record what was registered, or register another plan";
        let words =
            format!("{file}: expected {what} as registered ({expected}), found another ({found})\n  help: {help}");
        Err(Failure::input(words))
    };
    for registered in &plan.prompts {
        let own =
            prompts().into_iter().find(|own| own.name == registered.name).map(|own| own.sha256).unwrap_or_default();
        if own != registered.sha256 {
            return refused(&format!("the prompt `{}`", registered.name), &registered.sha256, &own);
        }
    }
    let world = config.hash();
    match plan.experiments.iter().find(|experiment| experiment.name == WORLD) {
        Some(registered) if registered.sha256 != world => refused("the world", &registered.sha256, &world),
        _ => Ok(()),
    }
}

//! The registered plan of a study: read from its file, and compared with the recording that is about to start.

use std::path::Path;

use crate::cli::Failure;
use mirrorstats_analysis::plan::register::RegisteredPlan;
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::input;
use mirrorstats_study::Study;
#[cfg(feature = "sim")]
use {
    mirrorstats_agents::prompt, mirrorstats_analysis::plan::register::NamedHash, mirrorstats_sim::config::WorldConfig,
    mirrorstats_trace::footers::declared::Registration, serde_json::Value,
};

const LARGEST: Limit = Limit::new("bytes of a plan", 1 << 20);

fn read(file: &Path) -> Result<RegisteredPlan, Failure> {
    let shown = file.display();
    let text = input::text(file, LARGEST)
        .map_err(|error| Failure::input(format!("{shown}: cannot read the plan: {error}")))?;
    RegisteredPlan::parse(&text).map_err(|words| Failure::input(format!("{shown}: {words}")))
}

pub fn with_plan(study: Study, file: Option<&Path>) -> Result<Study, Failure> {
    Ok(match file {
        Some(file) => study.registered(read(file)?),
        None => study,
    })
}

/// The world and the prompts of this program, as a plan names them.
#[cfg(feature = "sim")]
pub fn recorded(config: &WorldConfig) -> (Vec<NamedHash>, Vec<NamedHash>) {
    let hashes = prompt::hashes();
    let prompt =
        |(name, hash): (&String, _)| Some(NamedHash { name: name.clone(), sha256: Value::as_str(hash)?.to_owned() });
    let world = NamedHash { name: "world".to_owned(), sha256: config.hash() };
    (vec![world], hashes.as_object().into_iter().flatten().filter_map(prompt).collect())
}

/// The registration that traces carry; an error if the world or a prompt differs from the plan.
#[cfg(feature = "sim")]
pub fn registration(file: &Path, config: &WorldConfig) -> Result<Registration, Failure> {
    let plan = read(file)?;
    let (worlds, prompts) = recorded(config);
    let of_prompts = plan.prompts.iter().map(|one| (format!("the prompt `{}`", one.name), one, &prompts));
    let of_worlds = plan.experiments.iter().map(|one| (format!("the {}", one.name), one, &worlds));
    for (what, registered, own) in of_prompts.chain(of_worlds) {
        let own = own.iter().find(|own| own.name == registered.name).map_or("", |own| &own.sha256);
        if own != registered.sha256 {
            let (file, [expected, found]) = (file.display(), [&registered.sha256, own].map(short));
            let help = "record what was registered, or register another plan";
            return Err(Failure::input(format!(
                "{file}: expected {what} as registered ({expected}), found another ({found})\n  help: {help}"
            )));
        }
    }
    Ok(Registration { sha256: plan.sha256, definitions: Some(plan.definitions.sha256) })
}

#[cfg(feature = "sim")]
fn short(hash: &str) -> String {
    hash.chars().take(12).collect()
}

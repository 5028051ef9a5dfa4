//! The requested experiments: built-in ones by name, or all of a file, checked against the room that will hold them.

use std::path::Path;

#[cfg(feature = "sim")]
use clap::builder::{OsStringValueParser, TypedValueParser};

use crate::cli::Failure;
use mirrorstats_experiment::file::{self, Loaded};
#[cfg(feature = "sim")]
use {
    mirrorstats_experiment::Experiment,
    mirrorstats_record::plan::{Experiments, Named},
    mirrorstats_sim::{config::WorldConfig, placement},
    mirrorstats_toml_spec::{Fault, Faults},
};

/// Parses typed experiments; a file name may have any bytes.
#[cfg(feature = "sim")]
pub fn parser() -> impl TypedValueParser<Value = Experiments> {
    OsStringValueParser::new().try_map(|typed| Experiments::parse(&typed))
}

pub fn load(path: &Path) -> Result<Vec<Loaded>, Failure> {
    Ok(file::load(path)?)
}

/// The experiments of a file, each placed in a room.
#[cfg(feature = "sim")]
pub fn placed(path: &Path, config: &WorldConfig) -> Result<Vec<Loaded>, Failure> {
    let loaded = load(path)?;
    let faults: Vec<Fault> = loaded
        .iter()
        .filter_map(|one| {
            let crowded = placement::crowded(config, &one.experiment)?;
            let place = crowded.mirror.and_then(|at| one.mirrors.get(at)).unwrap_or(&one.cubes);
            Some(Fault::new(place.clone(), crowded.what).help(crowded.help))
        })
        .collect();
    if faults.is_empty() { Ok(loaded) } else { Err(Failure::Faults(Faults(faults))) }
}

/// The requested experiments, in order, each once.
#[cfg(feature = "sim")]
pub fn asked(asked: &Experiments, config: &WorldConfig) -> Result<Vec<Experiment>, Failure> {
    let mut all: Vec<Experiment> = Vec::new();
    for named in &asked.0 {
        let found = match named {
            Named::BuiltIn(experiment) => vec![experiment.clone()],
            Named::File(path) => placed(path, config)?.into_iter().map(|one| one.experiment).collect(),
        };
        for experiment in found {
            let name = experiment.name();
            match all.iter().find(|other| other.name() == name) {
                None => all.push(experiment.at_place(all.len())),
                Some(same) if **same == *experiment => {}
                Some(_) => {
                    return Err(Failure::input(format!(
                        "two different experiments are called `{name}`; give one another name"
                    )));
                }
            }
        }
    }
    Ok(all)
}

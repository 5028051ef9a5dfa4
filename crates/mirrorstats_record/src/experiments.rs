//! The requested experiments: built-in ones by name, or all of a file, checked against the room that will hold them.

use std::path::Path;

use super::plan::{Experiments, Named};
use mirrorstats_experiment::Experiment;
use mirrorstats_experiment::file::{FileError, Loaded, load};
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_sim::placement;
use mirrorstats_toml_spec::{Fault, Faults};

#[derive(Debug, thiserror::Error)]
pub enum ExperimentsError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("two different experiments are called `{0}`; give one another name")]
    SameName(String),
}

/// The experiments of a file, each placed in a room.
pub fn placed(path: &Path, config: &WorldConfig) -> Result<Vec<Loaded>, FileError> {
    let loaded = load(path)?;
    let fault = |one: &Loaded| {
        let crowded = placement::crowded(config, &one.experiment)?;
        let place = crowded.mirror.and_then(|at| one.mirrors.get(at)).unwrap_or_else(|| one.key(crowded.key));
        Some(Fault::new(place.clone(), crowded.what).help(crowded.help))
    };
    let faults: Vec<Fault> = loaded.iter().filter_map(fault).collect();
    if faults.is_empty() { Ok(loaded) } else { Err(Faults(faults).into()) }
}

impl Experiments {
    /// The experiments, in order, each once.
    pub fn load(&self, config: &WorldConfig) -> Result<Vec<Experiment>, ExperimentsError> {
        let mut all: Vec<Experiment> = Vec::new();
        for named in &self.0 {
            let found = match named {
                Named::BuiltIn(experiment) => vec![experiment.clone()],
                Named::File(path) => placed(path, config)?.into_iter().map(|one| one.experiment).collect(),
            };
            for experiment in found {
                match all.iter().find(|other| other.name() == experiment.name()) {
                    None => all.push(experiment.at_place(all.len())),
                    Some(same) if **same == *experiment => {}
                    Some(_) => return Err(ExperimentsError::SameName(experiment.name().to_owned())),
                }
            }
        }
        Ok(all)
    }
}

//! The episodes of a plan: those already recorded, and those to record.

use std::collections::BTreeSet;

use crate::cli::Failure;
#[cfg(feature = "view")]
use mirrorstats_agents::human::design::Planned;
use mirrorstats_experiment::Experiment;
use mirrorstats_record::error::StoreError;
use mirrorstats_record::index::Place;
#[cfg(feature = "view")]
use mirrorstats_record::plan::Subject;
use mirrorstats_record::plan::{Key, Plan};

pub struct Episodes {
    pub planned: Vec<Key>,
    /// The episodes that are not recorded yet, by experiment.
    pub todo: Vec<Key>,
}

impl Episodes {
    pub fn of(
        plan: &Plan,
        recorded: impl Fn(&Experiment) -> Result<BTreeSet<Place>, StoreError>,
    ) -> Result<Self, Failure> {
        let planned = plan.keys();
        let mut todo = Vec::with_capacity(planned.len());
        for experiment in &plan.experiments {
            let done = recorded(experiment)?;
            let own = planned.iter().filter(|key| key.experiment == *experiment);
            todo.extend(own.filter(|key| !done.contains(&(key.seed, key.run, key.repetition))).cloned());
        }
        Ok(Self { planned, todo })
    }

    pub fn found(&self) -> Vec<Key> {
        let todo: BTreeSet<&Key> = self.todo.iter().collect();
        self.planned.iter().filter(|key| !todo.contains(key)).cloned().collect()
    }

    /// All planned episodes, in the form for people.
    #[cfg(feature = "view")]
    pub fn to_play(&self, subject: &Subject) -> Vec<Planned> {
        let todo: BTreeSet<&Key> = self.todo.iter().collect();
        let one = |key: &Key| Planned {
            episode_id: key.episode_id(subject),
            experiment: key.experiment.name().to_owned(),
            seed: key.seed,
            repetition: key.repetition,
            is_recorded: !todo.contains(key),
        };
        self.planned.iter().map(one).collect()
    }
}

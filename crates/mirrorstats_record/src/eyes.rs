//! The cameras of a thread: one per picture size, look of the room and body shape in the experiments.

use std::cell::RefCell;

use mirrorstats_experiment::spec::{Body, Look};
use mirrorstats_experiment::{Experiment, Spec};
use mirrorstats_sim::camera::{Camera, CameraError};
use mirrorstats_sim::config::WorldConfig;

/// Cameras by picture size, look and body shape: a renderer keeps its textures, and its number of parts is fixed.
pub(super) struct Eyes(Vec<(Kind, RefCell<Camera>)>);

type Kind = ([u32; 2], Look, Body);

fn kind(config: &WorldConfig, experiment: &Spec) -> Kind {
    let WorldConfig { eye, look, body, .. } = config.for_experiment(experiment);
    ([eye.width, eye.height_px], look, body.shape)
}

impl Eyes {
    pub(super) fn new(
        config: &WorldConfig,
        experiments: impl IntoIterator<Item = Experiment>,
    ) -> Result<Self, CameraError> {
        let mut eyes: Vec<(Kind, RefCell<Camera>)> = Vec::new();
        for experiment in experiments {
            let kind = kind(config, &experiment);
            if eyes.iter().all(|(known, _)| *known != kind) {
                eyes.push((kind, RefCell::new(Camera::new(&config.for_experiment(&experiment))?)));
            }
        }
        Ok(Self(eyes))
    }

    pub(super) fn eye(&self, config: &WorldConfig, experiment: &Spec) -> &RefCell<Camera> {
        let kind = kind(config, experiment);
        let found = self.0.iter().find(|(known, _)| *known == kind);
        &found.expect("there is an eye for each experiment of the recording").1
    }
}

//! The eyes of a thread: one for each size of pictures that the experiments ask for.

use std::cell::RefCell;

use crate::experiment::Experiment;
use crate::sim::camera::{Camera, CameraError};
use crate::sim::config::WorldConfig;

/// Eyes by the width and the height of their pictures.
pub(super) struct Eyes(Vec<([u32; 2], RefCell<Camera>)>);

fn size(config: &WorldConfig, experiment: Experiment) -> [u32; 2] {
    let eye = config.of(experiment).eye;
    [eye.width, eye.height_px]
}

impl Eyes {
    pub(super) fn of(
        config: &WorldConfig,
        experiments: impl IntoIterator<Item = Experiment>,
    ) -> Result<Self, CameraError> {
        let mut eyes: Vec<([u32; 2], RefCell<Camera>)> = Vec::new();
        for experiment in experiments {
            let size = size(config, experiment);
            if eyes.iter().all(|(known, _)| *known != size) {
                eyes.push((size, RefCell::new(Camera::new(&config.of(experiment))?)));
            }
        }
        Ok(Self(eyes))
    }

    pub(super) fn eye(&self, config: &WorldConfig, experiment: Experiment) -> &RefCell<Camera> {
        let size = size(config, experiment);
        let found = self.0.iter().find(|(known, _)| *known == size);
        &found.expect("there is an eye for each experiment of the recording").1
    }
}

//! The eyes of a thread: one for each size of pictures, look of the room and shape of bodies that the experiments ask for.

use std::cell::RefCell;

use crate::experiment::Experiment;
use crate::experiment::spec::{Body, Look};
use crate::sim::camera::{Camera, CameraError};
use crate::sim::config::WorldConfig;

/// Eyes by the width and the height of their pictures, and the look and the shape that they can draw: a renderer keeps its
/// textures, and as many parts as it was made with.
pub(super) struct Eyes(Vec<(Kind, RefCell<Camera>)>);

type Kind = ([u32; 2], Look, Body);

fn kind(config: &WorldConfig, experiment: Experiment) -> Kind {
    let WorldConfig { eye, look, body, .. } = config.of(experiment);
    ([eye.width, eye.height_px], look, body.shape)
}

impl Eyes {
    pub(super) fn of(
        config: &WorldConfig,
        experiments: impl IntoIterator<Item = Experiment>,
    ) -> Result<Self, CameraError> {
        let mut eyes: Vec<(Kind, RefCell<Camera>)> = Vec::new();
        for experiment in experiments {
            let kind = kind(config, experiment);
            if eyes.iter().all(|(known, _)| *known != kind) {
                eyes.push((kind, RefCell::new(Camera::new(&config.of(experiment))?)));
            }
        }
        Ok(Self(eyes))
    }

    pub(super) fn eye(&self, config: &WorldConfig, experiment: Experiment) -> &RefCell<Camera> {
        let kind = kind(config, experiment);
        let found = self.0.iter().find(|(known, _)| *known == kind);
        &found.expect("there is an eye for each experiment of the recording").1
    }
}

//! The perception of scripted agents: reads the study's room with knowledge of how rooms look.
//!
//! ```text
//! frame ──► paint (colour of a pixel) ──► patches ──► things (cubes, bodies)
//!   └─────► ground (feet of the walls, and what lies beyond them)
//! ```
//!
//! Rule: a view is a function of the frame and of the observation's pose and field of view. It knows no scene, no label
//! and no other configuration. It does not tell a thing from its reflection: that takes memory.

pub mod camera;
pub mod ground;
pub mod paint;
pub(crate) mod patches;
pub mod things;

use std::sync::Arc;

use crate::Observation;
use mirrorstats_trace::frame::Frame;

use camera::{ViewCamera, Viewpoint};
use ground::Foot;
use things::Thing;

/// Patches of fewer pixels are edges between two things.
const LEAST_OF_PATCH: usize = 6;

#[derive(Clone, Debug)]
pub struct View {
    pub pose: Viewpoint,
    pub camera: ViewCamera,
    pub frame: Arc<Frame>,
    /// Cubes that are completely in view.
    pub cubes: Vec<Thing>,
    pub bodies: Vec<Thing>,
    pub feet: Vec<Foot>,
}

impl View {
    pub fn from_observation(observation: &Observation) -> Self {
        let frame = Arc::clone(&observation.frame);
        let pose = Viewpoint::from_observation(observation);
        let camera = ViewCamera::new(pose, frame.width, frame.height, observation.fov_y);
        let patches = patches::patches(&frame, LEAST_OF_PATCH);
        Self {
            pose,
            camera,
            cubes: things::cubes(&patches, &camera, frame.width, frame.height),
            bodies: things::bodies(&patches, &camera, frame.width, frame.height),
            feet: ground::feet(&frame, &camera),
            frame,
        }
    }
}

/// A number of pixels, for geometry.
#[expect(clippy::cast_precision_loss, reason = "pixels of a picture are few")]
pub const fn real(pixels: usize) -> f64 {
    pixels as f64
}

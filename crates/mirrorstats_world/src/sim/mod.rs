//! The MuJoCo world of the experiments: scene, bodies, camera, and visibility (ground truth) from rays.
//!
//! ```text
//! WorldConfig ──► Scene::draw(experiment, seed, run) ──► World::new ──► act, visibility, snapshot
//!   (sizes)         (pure data, drawn)                    (MuJoCo)          │
//!                                                                Camera::frame ┘ (pixels; one renderer per thread)
//! ```
//!
//! Rule: a world is a function of its configuration, experiment, seed, run and the actions taken in it. It draws only
//! whole numbers, takes sines from its own tables, and reads no clock, so it is the same on every machine. It knows no
//! agent, no trace and no metric.

pub mod angle;
pub mod body;
pub mod config;
pub mod distractor;
pub mod floor;
mod hand;
pub mod model;
mod pictures;
pub mod placement;
pub mod rng;
pub mod scene;
pub mod snapshot;
pub mod visibility;
pub mod world;

#[cfg(feature = "raster")]
pub use pictures::contact_sheet;
pub use pictures::{camera, label_image, passage};

pub use crate::experiment::Experiment;

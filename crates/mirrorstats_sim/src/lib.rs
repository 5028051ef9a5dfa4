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

#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod blind;
pub mod body;
pub mod camera;
pub mod config;
pub mod contact_sheet;
pub mod distractor;
pub mod floor;
mod hand;
pub mod label_image;
mod mirror_camera;
pub mod mirror_eye;
pub mod model;
pub mod placement;
pub mod rng;
pub mod scene;
pub mod snapshot;
pub mod visibility;
pub mod world;

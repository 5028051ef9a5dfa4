//! The MuJoCo world of the five experiments: scene, bodies, eye, and ground truth from rays.
//!
//! ```text
//! WorldConfig ──► Scene::draw(experiment, seed, run) ──► World::new ──► act, census, snapshot
//!   (sizes)         (pure data, drawn)                    (MuJoCo)          │
//!                                                                Eye::frame ┘ (pixels; one renderer a thread)
//! ```
//!
//! Rule: a world is a function of its configuration, experiment, seed, run and the actions taken in it. It draws whole
//! numbers only, takes sines from its own tables, and reads no clock, so that it is the same on every machine.
//! It knows no agent, no trace and no metric.

pub mod angle;
pub mod body;
pub mod census;
pub mod chance;
pub mod config;
pub mod experiment;
pub mod eye;
pub mod floor;
pub mod model;
pub mod placement;
pub mod scene;
#[cfg(feature = "raster")]
pub mod sheet;
pub mod snapshot;
pub mod walker;
pub mod world;

pub use experiment::Experiment;

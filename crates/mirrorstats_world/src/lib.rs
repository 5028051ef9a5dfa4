//! The world of the study: experiments, the MuJoCo simulation, agents, recordings and replays.
//!
//! | module | contents |
//! |---|---|
//! | [`experiment`] | experiments, built in or from the user's files: the world, the prompt, the decision |
//! | `sim` | the MuJoCo world: scene, bodies, camera, visibility by ray casts (feature `sim`) |
//! | [`agent`] | scripted agents, models behind a provider, programs, people |
//! | `record` | runs episodes and writes a trace and a log (feature `sim`) |
//! | [`replay`] | a recorded episode, simulated again: frames, a film strip |
//!
//! ```
//! use mirrorstats_world::experiment::Experiment;
//!
//! let experiment = Experiment::parse("E1")?;
//! assert!(experiment.asks_for_cube());
//! # Ok::<(), mirrorstats_world::experiment::UnknownExperiment>(())
//! ```
//!
//! Rule: nothing here knows a metric.

#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod agent;
pub mod experiment;
#[cfg(feature = "sim")]
mod json_lines;
#[cfg(feature = "sim")]
pub mod record;
pub mod replay;
#[cfg(feature = "sim")]
pub mod sim;

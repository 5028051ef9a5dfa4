//! `mirrorstats record` at the process boundary: always the same bytes, and no half-written files.
//!
//! These tests use the study's worlds with a smaller eye. Most of their agents do not look, so nothing has to be drawn.
//! If a test must draw and the machine cannot, the test says so.

mod answers;
mod conditions;
mod contents;
mod continued;
mod experiments;
mod forecasts;
mod interruptions;
mod mistaken;
mod next;
mod reaching;
mod recordings;
mod refusals;
mod renderers;
mod same_bytes;
mod together;

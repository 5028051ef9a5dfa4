//! `mirrorstats record` at the process boundary: the same bytes however a recording came about, and nothing half done.
//!
//! The worlds of these tests are those of the study seen through a smaller eye, and most agents are ones that do not look,
//! so that no picture is drawn. Where one must be drawn and the machine cannot, the test says so.

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

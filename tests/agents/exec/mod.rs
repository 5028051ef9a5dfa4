//! Agents that decide elsewhere, at the process boundary: programs that behave and that do not, and what a model costs.
//!
//! The programs are a few lines of the shell each.

mod episodes;
mod failures;
mod processes;
mod recordings;
mod running;
mod spending;
mod unusable;

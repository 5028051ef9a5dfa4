//! Agents that decide elsewhere, at the process boundary: programs that behave and that do not, and what a model costs.
//!
//! The programs are a few lines of the shell each. A program is given frames, so that they must be drawn: a machine that
//! cannot draw says so and tests nothing here.

mod episodes;
mod failures;
mod processes;
mod recordings;
mod spending;

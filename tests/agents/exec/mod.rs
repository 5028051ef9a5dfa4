//! Agents outside the process: programs that behave, programs that do not, and the cost of models.
//!
//! Each program is a few lines of shell.

mod episodes;
mod failures;
mod processes;
mod recordings;
mod running;
mod spending;
mod unusable;

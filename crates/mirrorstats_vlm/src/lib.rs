//! Agents that are models behind a provider.
//!
//! ```text
//! observation ──► prompt + frame ──► wire format (body) ──► journal ──► provider ──► journal ──► reply
//!                                                          │ recorded already: no request │
//!                                                          └──────────────────────────────┘
//! ```
//!
//! | file | what it knows |
//! |---|---|
//! | `model`, `agent` | the shared state of a model's episodes; the model in one of them |
//! | [`models`] | the models, their providers and prices |
//! | [`wire_format`] | the format of requests and answers |
//! | `request` | the body of a model's request, and the cost of its answer |
//! | [`provider`] | sending requests: concurrency, failures, waits requested by providers |
//! | [`probe`] | the parameters that a model takes |
//! | `step` | the reaction to failures: another attempt, a lost episode, the end |
//! | [`limits`], [`estimate`] | a run's spending limits; estimates |
//! | [`journal`], `answered` | requests and answers on disk; statistics of a model from them |
//!
//! Rule: an answered request is never repeated, no answer takes effect before it is on disk, and keys leave
//! this crate only in request headers. Nothing here needs the simulation.

#![warn(clippy::print_stdout, clippy::print_stderr)]

mod agent;
mod answered;
pub mod estimate;
pub mod journal;
pub mod limits;
mod model;
pub mod models;
pub mod probe;
pub mod provider;
mod request;
mod step;
pub mod wire_format;

pub use agent::VlmAgent;
pub use answered::Typical;
pub use model::{Memory, Vlm};

//! Agents that are models behind a provider.
//!
//! ```text
//! observation ──► prompt + frame ──► wire format (body) ──► journal ──► provider ──► journal ──► reply
//!                                                          │ recorded already: no request │
//!                                                          └──────────────────────────────┘
//! ```
//!
//! Rule: an answered request is never repeated, no answer takes effect before it is on disk, and keys leave
//! this crate only in request headers. Nothing here needs the simulation.

#![warn(clippy::print_stdout, clippy::print_stderr)]

mod agent;
mod answered;
mod estimate;
pub mod forecast;
pub mod journal;
pub mod limits;
mod model;
pub mod models;
mod player;
pub mod provider;
mod request;
mod step;
pub mod wire_format;

pub use agent::VlmAgent;
pub use model::Vlm;
pub use player::VlmPlayer;

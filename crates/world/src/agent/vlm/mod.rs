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
//! | `model`, `agent` | what the episodes of a model share; the model in one of them |
//! | [`models`] | the models, who serves them, what they cost |
//! | [`wire_format`] | what requests and answers look like |
//! | [`provider`] | sending one request |
//! | `preflight` | whether the provider can be reached |
//! | [`failure`], `parameter` | the names of what can go wrong; which key of a model mends a refused parameter |
//! | `rate_limit`, `waiting` | the waits that providers state; how long a step waits |
//! | `step` | what is done then: another attempt, a lost episode, the end |
//! | [`concurrency`] | how many requests are out at once |
//! | [`limits`], `ledger` | what a run may spend; the same over several processes |
//! | [`estimate`] | what requests will take |
//! | [`journal`] | what was asked and answered, on disk |
//! | [`secrets`] | keys, and words without them |
//!
//! Rule: what was answered once is never asked again, nothing is acted on that is not on disk, and no key is in
//! anything that leaves this room but the header of a request.

mod agent;
pub mod concurrency;
pub mod estimate;
pub mod failure;
pub mod journal;
mod ledger;
pub mod limits;
mod model;
pub mod models;
mod parameter;
mod preflight;
pub mod provider;
mod rate_limit;
pub mod secrets;
mod step;
mod waiting;
pub mod wire_format;

pub use agent::VlmAgent;
pub use model::{Memory, OnOutage, Vlm, spent};
pub use preflight::Unreachable;

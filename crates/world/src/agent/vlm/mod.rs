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
//! | `request` | the body of a request of a model, and what its answer cost |
//! | [`provider`] | sending one request, or many as a batch: how many are out at once, what can go wrong, which waits providers state |
//! | [`probe`] | which parameters a model takes |
//! | `step` | what is done then: another attempt, a lost episode, the end |
//! | `spending` | what a run may spend, over several processes; what requests will take |
//! | [`journal`], `answered` | what was asked and answered, on disk; what that says of a model |
//! | [`secrets`] | keys, and words without them |
//!
//! Rule: what was answered once is never asked again, nothing is acted on that is not on disk, and no key is in
//! anything that leaves this room but the header of a request.

mod agent;
mod answered;
pub mod journal;
mod model;
pub mod models;
pub mod probe;
pub mod provider;
mod request;
pub mod secrets;
mod spending;
mod step;
pub mod wire_format;

pub use agent::VlmAgent;
pub use answered::Typical;
pub use model::{Memory, OnOutage, Vlm};
pub use provider::{Unreachable, concurrency, failure};
pub use request::Tier;
pub use spending::{estimate, limits};

//! Runs episodes: a world, an agent, and the resulting trace and log.
//!
//! ```text
//! Plan ──► episodes still to do ──► threads, each with one camera ──► rollout ──► part ──► assembled: trace, log
//!  (which)    (store knows)          (several under way where       (one      (one episode,
//!                                     agents wait)                   episode)   whole)
//! ```
//!
//! Rule: an episode is a function of the world's configuration, its experiment, seed and run, and its agent. Threads,
//! shards, interruptions and their order do not affect a trace. Nothing here knows a metric.

#![warn(clippy::print_stdout, clippy::print_stderr)]

mod continued;
pub mod environment;
pub mod error;
pub mod experiments;
mod eyes;
pub mod failures;
pub mod fingerprint;
pub mod index;
pub mod lock;
pub mod metadata;
#[cfg(feature = "view")]
pub mod participants;
pub mod plan;
pub mod queue;
pub mod replay;
pub mod replies;
pub mod rollout;
pub mod run;
pub mod store;

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

pub mod error;
mod eyes;
pub mod fingerprint;
mod folder;
pub mod metadata;
pub mod plan;
mod queue;
pub mod replies;
pub mod rollout;
pub mod run;
pub mod shares;

use folder::continued;
#[cfg(feature = "view")]
pub use folder::participants;
pub use folder::{failures, index, lock, store};

//! Runs episodes: a world, an agent, and the resulting trace and log.
//!
//! ```text
//! Plan ──► episodes still to do ──► threads, each with one camera ──► rollout ──► part ──► assembled: trace, log
//!  (which)    (store knows)          (several under way where       (one      (one episode,
//!                                     agents wait)                   episode)   whole)
//! ```
//!
//! | file | what it knows |
//! |---|---|
//! | [`plan`] | the episodes, their names, and the share of a shard |
//! | [`rollout`] | one episode, from the first frame to the last step |
//! | [`fingerprint`] | the settings of an episode's recording, in a few hashes |
//! | [`metadata`] | a trace's metadata on its recording |
//! | [`index`] | the recorded episodes of a folder |
//! | [`store`] | the folder: how an episode commits, how the final files are made |
//! | [`folder_lock`] | other processes that record into the folder |
//! | [`lock`] | the locks of a folder and of an episode |
//! | [`queue`] | the remaining episodes, and those that other processes have |
//! | `continued` | the check that an existing log belongs to the recording |
//! | [`error`] | errors of a folder, and of an unfinished episode |
//! | [`failures`] | the list of episodes lost to failures |
//! | [`replies`] | the number of replies without a decision |
//! | [`unusable`] | the end of a recording whose agent cannot answer |
//! | [`run`] | threads, episodes under way, stopping |
//! | [`shares`] | the time by activity |
//!
//! Rule: an episode is a function of the world's configuration, its experiment, seed and run, and its agent. Threads,
//! shards, interruptions and their order do not affect a trace. Nothing here knows a metric.

pub mod error;
mod eyes;
pub mod fingerprint;
mod folder;
pub mod metadata;
pub mod plan;
pub mod queue;
pub mod replies;
pub mod rollout;
pub mod run;
pub mod shares;
pub mod unusable;

use folder::continued;
#[cfg(feature = "view")]
pub use folder::participants;
pub use folder::{failures, folder_lock, index, lock, store};

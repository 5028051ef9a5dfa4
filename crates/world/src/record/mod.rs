//! Runs episodes: a world, an agent, and a trace and a log at the end.
//!
//! ```text
//! Plan ──► episodes still to do ──► threads, each with one camera ──► rollout ──► part ──► assembled: trace, log
//!  (which)    (store knows)          (several under way where       (one      (one episode,
//!                                     agents wait)                   episode)   whole)
//! ```
//!
//! | file | what it knows |
//! |---|---|
//! | [`plan`] | which episodes, their names, and which of them a shard has |
//! | [`rollout`] | one episode, from the first frame to the last step |
//! | [`fingerprint`] | what an episode was recorded with, in a few hashes |
//! | [`metadata`] | what a trace says of how it was recorded |
//! | [`index`] | what is recorded in a folder already |
//! | [`store`] | the folder: how an episode commits, how the final files are made |
//! | [`folder_lock`] | who else records into the folder |
//! | [`lock`] | the locks of a folder and of an episode |
//! | [`queue`] | the episodes still to take, and which of them other processes have |
//! | `continued` | whether the log that is there belongs to the recording |
//! | [`error`] | why a folder cannot be used, why an episode did not come to its end |
//! | [`failures`] | the list of episodes that failures kept from being recorded |
//! | [`replies`] | how many replies gave no decision |
//! | [`unusable`] | when an agent that cannot answer ends its recording |
//! | [`run`] | threads, episodes under way, stopping |
//! | [`shares`] | what took the time |
//!
//! Rule: an episode is a function of the world's configuration, its experiment, seed and run, and its agent. Threads,
//! shards, interruptions and their order change nothing in a trace. Nothing here knows a metric.

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

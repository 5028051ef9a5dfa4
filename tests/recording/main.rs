//! The origin of episodes: the world, recordings, logs and replays.

#![cfg(feature = "sim")]

#[cfg(target_os = "linux")]
mod faults;
#[path = "../harness/mod.rs"]
mod harness;
mod log;
mod record;
mod replay;
mod world;

//! Episodes as they come about: the world, recordings, their logs, and recorded episodes again.

#![cfg(feature = "sim")]

#[cfg(target_os = "linux")]
mod faults;
#[path = "../harness/mod.rs"]
mod harness;
mod log;
mod record;
mod replay;
mod world;

//! A model behind a provider, tested with loopback servers that behave or misbehave.

mod bench;
mod bodies;
mod fingerprints;
#[cfg(unix)]
mod interrupted;
mod keys;
mod killed;
mod languages;
mod loopback;
mod memory;
mod odd;
#[cfg(target_os = "linux")]
mod power;
mod providers;
mod reach;
mod recordings;
mod refusals;
mod seeing;
pub mod server;
mod spending;
mod statuses;
mod unreadable;

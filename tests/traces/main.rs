//! Traces: writing, importing, reading, checking, and damage.

mod damaged;
mod foreign;
#[path = "../harness/mod.rs"]
mod harness;
mod import;
mod trace_bytes;
mod trace_commands;
mod trace_scan;
mod trace_validate;
mod trace_write;

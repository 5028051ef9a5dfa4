//! Agents: prompts, reading of replies, scripted agents, models behind a provider, programs.
//!
//! The tests of scripted agents are in this folder: what they see in pictures, and whether they show the metrics that
//! their names predict.

#![cfg_attr(
    feature = "sim",
    expect(
        clippy::cast_possible_truncation,
        clippy::cast_precision_loss,
        reason = "a picture is small, a colour a byte"
    )
)]

#[cfg(feature = "sim")]
mod calibration;
#[cfg(all(feature = "sim", unix))]
mod exec;
#[cfg(feature = "sim")]
mod function;
#[path = "../harness/mod.rs"]
mod harness;
mod identifications;
#[cfg(feature = "sim")]
mod painted;
#[cfg(feature = "sim")]
mod profile;
#[cfg(feature = "sim")]
mod prompts;
#[cfg(feature = "sim")]
mod recorded;
mod reparsed;
mod replies;
#[cfg(feature = "sim")]
mod sight;
#[cfg(feature = "sim")]
mod vlm;
#[cfg(feature = "sim")]
mod walks;

//! The scripted agents: what they make of pictures, and whether each shows the metrics that its name predicts.

#![cfg(feature = "sim")]
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "a picture is small, a colour a byte"
)]

mod calibration;
mod painted;
mod profile;
mod recorded;
mod sight;
mod walks;

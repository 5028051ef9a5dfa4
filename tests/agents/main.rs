//! The scripted agents: what they make of pictures, and whether each shows the metrics that its name predicts.

#![cfg(feature = "sim")]
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "a picture is small and a colour a byte"
)]

mod painted;
mod recorded;
mod scratch;
mod sight;
mod walks;

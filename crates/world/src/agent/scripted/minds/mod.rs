//! The scripted agents, one file each.

pub mod answering;
pub mod chaser;
pub mod confabulator;
pub mod frozen;
pub mod guesser;
pub mod gullible;
pub mod mimic;
pub mod oracle;
pub mod random;
pub mod reacher;

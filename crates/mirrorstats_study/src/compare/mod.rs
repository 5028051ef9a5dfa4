//! Differences between studies: pairs of episodes, the gate, thresholds.

pub(crate) mod diff;
pub(crate) mod gate;
pub(crate) mod pooled;
pub(crate) mod sensitivity;

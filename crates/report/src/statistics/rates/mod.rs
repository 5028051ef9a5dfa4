//! Rows for one cell or one model: rates, chance, durations, ranks, looks.

pub(crate) mod cells;
pub(crate) mod chance;
pub(crate) mod clusters;
pub(crate) mod durations;
pub(crate) mod overall;
pub(crate) mod ranks;
pub(crate) mod sequential;

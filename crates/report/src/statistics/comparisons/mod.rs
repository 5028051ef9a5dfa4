//! Comparisons between models and conditions: pairs, units, losses, families.

pub(crate) mod compare;
pub(crate) mod conditions;
pub(crate) mod losses;
pub(crate) mod matching;
pub(crate) mod models;
pub(crate) mod retest;
pub(crate) mod trends;
pub(crate) mod units;

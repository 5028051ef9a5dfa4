//! The episode table: building, order, selection, join.

pub mod builder;
pub mod columns;
pub mod declared_experiments;
pub(crate) mod joined;
pub mod lost_counts;
pub(crate) mod order;
pub mod select;
pub mod table;

//! From the bytes of traces to whole episodes, in the order of the files.

pub(in crate::trace) mod budget;
pub(in crate::trace) mod column;
pub(in crate::trace) mod decode;
mod episode_index;
pub(crate) mod flat;
pub(crate) mod footer;
pub mod in_order;
pub mod open;
pub(in crate::trace) mod pages;
pub(in crate::trace) mod parallel_scan;
pub(in crate::trace) mod projection;
pub mod steps;
mod thrift;
pub mod verify;

pub(crate) mod budget;
mod checks;
pub(crate) mod decode;
mod episode_index;
pub mod flat;
pub mod footer;
pub mod in_order;
pub mod open;
pub(crate) mod parallel_scan;
pub(crate) mod projection;
pub mod search;
pub mod steps;

pub(crate) use checks::statistics;
pub use checks::verify;

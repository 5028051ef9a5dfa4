//! How much a file of experiments may ask for.

/// The most characters of a name.
pub(super) const LONGEST_NAME: usize = 40;
/// The most other agents and cubes of a world.
pub(super) const MOST_OTHERS: u32 = 6;
pub(super) const MOST_CUBES: u32 = 12;
pub(super) const MOST_STEPS: u32 = 100_000;
/// The latest that a mirror may be, steps.
pub(super) const LATEST: u32 = 1000;

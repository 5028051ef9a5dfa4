//! Rules of the repository, and tests that no other test may disturb. Nothing here starts a program.

#[cfg(feature = "sim")]
mod claim;
mod names;
mod schemas;
mod surface;

//! Rules of the repository, and what no other test may disturb: nothing here starts a program.

#[cfg(feature = "sim")]
mod claim;
mod names;
mod schemas;
mod surface;

//! Tests between two groups, their families, and tied sets.

pub mod contrast;
pub mod holm;
pub mod improvement;
pub mod letter_display;
pub mod margin;
pub mod paired;
pub mod stratified;
pub mod trend;
pub mod units;
pub mod unpaired;

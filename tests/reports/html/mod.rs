//! `report.html`: its text, and what a browser makes of it.

mod address;
pub mod browser;
mod document;
mod episodes;
mod figures;
mod hostile;
mod pair;
mod results;
pub mod scored;
mod surroundings;

//! `report.html`: its text, and what a browser makes of it.

pub mod browser;
mod document;
mod episodes;
mod figures;
mod hostile;
mod results;
pub mod scored;
mod surroundings;

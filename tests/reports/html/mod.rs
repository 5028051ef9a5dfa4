//! `report.html`: its text, and its behaviour in a browser.

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

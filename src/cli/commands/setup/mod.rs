//! This program: settings, completions, manual pages.

pub mod completions;
pub mod config;
pub mod man;

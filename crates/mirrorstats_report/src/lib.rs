//! From cells and findings to bytes: the tables of a style, the page, and the folder of a report.
//!
//! Rule: this crate knows no traces and no plans, only cells, findings and the episode table. A [`style`] defines how
//! numbers look, [`layout`] makes tables of cells under it, [`html`] makes the page, [`bundle`] writes the folder.
//! [`published`] compares these tables with published ones, [`sensitivity`] under several definitions.

#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod bundle;
pub mod html;
pub mod layout;
pub mod published;
pub mod sensitivity;
pub mod style;

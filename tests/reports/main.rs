//! Outputs for people: tables, statistics, figures, the page, and the rebuilt published numbers.

#[cfg(feature = "raster")]
mod figures;
#[path = "../harness/mod.rs"]
mod harness;
mod html;
mod one_interval;
#[cfg(feature = "view")]
mod publish;
mod reconstruction;
mod report;
mod sequential;
mod statistics;
mod top;
#[cfg(feature = "view")]
mod view;

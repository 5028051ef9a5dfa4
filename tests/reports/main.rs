//! What people read: tables, statistics, figures, the page, and the published numbers rebuilt.

#[cfg(feature = "raster")]
mod figures;
mod html;
mod reconstruction;
mod report;
mod statistics;

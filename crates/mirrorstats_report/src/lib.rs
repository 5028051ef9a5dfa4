//! From cells to bytes: tables, their comparison with published ones, and the folder of a report.
//!
//! ```
//! use mirrorstats_report::tables::Table;
//!
//! let mut table = Table::plain(&["model"], &["TSA"]);
//! table.push(["oracle", "1.00"]);
//! assert_eq!(table.csv(), "model,TSA\noracle,1.00\n");
//! ```
//!
//! Rule: this crate knows no traces and no plans, only cells and the episode table. A [`style`] defines how numbers
//! look, [`layout`] makes [`tables::Table`]s of cells under it, [`tables`] formats them, [`figures`] draws, [`html`]
//! makes the page from all of these, [`bundle`] writes the folder. [`audit`] checks whether any data gives published
//! tables, [`plan`] how many episodes a comparison needs, [`gate`] whether later episodes are worse than earlier ones.

#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod audit;
pub mod bundle;
pub mod cells;
pub mod changes;
pub mod comparable;
pub mod comparison;
pub mod errata;
pub mod figures;
pub mod gate;
pub mod html;
pub mod layout;
pub mod plan;
pub mod published;
pub mod sensitivity;
pub mod statistics;
mod study;
pub mod style;
pub mod tables;

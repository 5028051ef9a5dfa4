//! Reports at the library boundary: styles in, tables, comparisons and folders out.

mod bundle;
mod compare;
mod published;
mod styles;
mod tables;
mod verify;

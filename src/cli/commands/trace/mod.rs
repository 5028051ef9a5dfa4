//! Traces as files: what they hold, whether they are valid, how they are made anew.

pub mod check;
pub mod import;
pub mod info;
pub mod recover;
pub mod renormalize;
pub mod schema;
pub mod validate;

//! Definitions for a study: the built-in file of each experiment, filters, mixtures.

pub(crate) mod empty_filter;
pub(crate) mod own_definitions;
pub(crate) mod question;
pub(crate) mod rescore;

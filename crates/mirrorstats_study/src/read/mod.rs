//! From arguments to scored episodes: files, findings, hashes, score files.

pub(crate) mod experiment_findings;
pub(crate) mod findings;
pub(crate) mod import;
pub(crate) mod inputs;
pub(crate) mod results;
pub(crate) mod scan;
pub(crate) mod scores;

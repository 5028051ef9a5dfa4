//! `mirrorstats world replay` and `filmstrip` at the process boundary: recorded episodes match, altered ones diverge
//! where altered, and an episode looks the same from its log and its trace.

mod altered;
mod matching;
#[cfg(unix)]
mod outputs;
mod pictures;
mod traces;

//! `mirrorstats world replay` and `filmstrip` at the process boundary: recorded episodes match, altered ones part where they were
//! altered, and an episode looks the same from its log and from its trace.

mod altered;
mod matching;
#[cfg(unix)]
mod outputs;
mod pictures;
mod recounted;
mod traces;

//! Logs of recordings. A whole log gives the trace again, byte for byte; a cut or damaged one every undamaged episode.

mod cuts;
mod damage;
mod hashes;
mod lengths;
mod logs;
mod whole;

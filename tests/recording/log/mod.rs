//! Logs of recordings: whole they give the trace again, byte for byte; cut or damaged, every episode that is still there.

mod cuts;
mod damage;
mod hashes;
mod lengths;
mod logs;
mod whole;

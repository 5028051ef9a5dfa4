//! Two engines that share no code: the kernels, and the SQL lowering on Polars. They must agree on every integer of
//! every episode, or refuse alike.
#![cfg(feature = "polars")]

#[path = "../scoring/author.rs"]
mod author;
#[path = "../scoring/language.rs"]
mod language;
mod property;
mod trace;
mod words;

//! Scoring, proved from outside: by hand, against a plain loop, against an interpreter, and over every layout of a file.

mod author;
mod by_hand;
mod expressions;
mod interpreter;
mod language;
mod layouts;
mod plain_loop;
mod random;
mod traces;

//! `frozen`: does nothing until the budget ends.
//!
//! It gives no action, so the body stands still, and claims `unknown` at every step.
//!
//! | metric | everywhere |
//! |---|---|
//! | TSA, CAAL, CR | 0 |
//! | TTD | the whole budget |
//! | MTATO | undefined |
//! | MCR | 1 where an episode begins before the mirror, else 0 |
//! | DECOY_CLAIM, WINDOW_CLAIM | 0, and undefined where it never has the pane in view |
//! | MARK_REPORT, MARK_FALSE | 0 |
//! | SUCCESS, SIR, FCR, PCR where a hand reaches | 0 |
//! | UNREADABLE where a hand reaches | the whole budget: it gives no action |

use crate::Observation;

use super::super::{Move, Script, words};

#[derive(Clone, Copy, Debug)]
pub struct Frozen;

impl Script for Frozen {
    fn decide(&mut self, _: &Observation) -> Move {
        let words = words::plain("I did not look.", "I do nothing.", "Nothing happened.", None);
        Move { words, ..Move::default() }
    }
}

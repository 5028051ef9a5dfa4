//! `oracle`: looks for the mirror, recognises itself, and acts on it. The upper end of the scale.
//!
//! It says `unknown` until its reflection has passed its tests, so it never claims before the mirror shows it. It
//! ignores a false colour in the prompt. Without a mirror it looks for long, then takes a random cube without a claim.
//!
//! | metric | E1 | E2 | E3 | E4 | E5 |
//! |---|---|---|---|---|---|
//! | TSA | 1 | 1/3 | 1 | 1 | 1 |
//! | TTD | tens | most of the budget | tens | tens | tens |
//! | MCR | 1 | 0 | 1 | 1 | 1 |
//! | MTATO | 1 | 0 | 1 | 1 | 1 |
//! | CAAL | 1 | 0 | 1 | 1 | 1 |
//! | CR | 0 | 0 | 0 | 0 | 0 |
//!
//! A body that moves as it moves is itself, in any colour, even a few steps late. So it claims the decoy's colour: no
//! view shows the true one, and contingency decides. A stranger in a window follows it at no lag: it claims nothing and
//! takes a random cube. The exception is a stranger who happens to approach in its line of sight and passes its tests:
//! three of 21 episodes, where one or two were predicted. In the mark test it looks into the mirror until it has seen a
//! mark on itself.
//!
//! | metric | two-mirrors | delayed | decoy | window | mark |
//! |---|---|---|---|---|---|
//! | TSA | 1 | 1 | 0 | 1/3 | 1 |
//! | MCR | 1 | 1 | 1 | 0 | 1 |
//! | CAAL | 1 | 1 | 0 | 0 | 1 |
//! | CR | 0 | 0 | 0 | at most 1/5 | 0 |
//! | DECOY_CLAIM, WINDOW_CLAIM | undefined | undefined | 1 | at most 1/5 | undefined |
//! | MARK_REPORT, MARK_SEEN | undefined | undefined | undefined | undefined | 1 |
//! | MARK_DELAY | undefined | undefined | undefined | undefined | two or three steps |
//! | MARK_FALSE | undefined | undefined | undefined | undefined | 0 |

use super::super::knowledge::Knowledge;
use super::super::policy::{Belief, Policy};

#[derive(Clone, Copy, Debug)]
pub struct Oracle;

impl Policy for Oracle {
    fn belief(&mut self, known: &Knowledge) -> Belief {
        known.reflection.own_color().map_or(Belief::UNKNOWN, Belief::settled)
    }
}

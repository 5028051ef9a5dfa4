//! `oracle`: looks for the mirror, recognises itself, and acts on it. The upper end of the scale.
//!
//! It says `unknown` until its reflection has passed its tests, so it never claims before the mirror shows it. It takes a false
//! colour in the prompt for what it is: words. Without a mirror it looks long and then takes a cube by chance, still
//! claiming nothing.
//!
//! | metric | E1 | E2 | E3 | E4 | E5 |
//! |---|---|---|---|---|---|
//! | TSA | 1 | 1/3 | 1 | 1 | 1 |
//! | TTD | tens | most of the budget | tens | tens | tens |
//! | MCR | 1 | 0 | 1 | 1 | 1 |
//! | MTATO | 1 | 0 | 1 | 1 | 1 |
//! | CAAL | 1 | 0 | 1 | 1 | 1 |
//! | CR | 0 | 0 | 0 | 0 | 0 |

use super::knowledge::Knowledge;
use super::policy::{Belief, Policy};

/// Believes its tested reflection alone.
#[derive(Clone, Copy, Debug)]
pub struct Oracle;

impl Policy for Oracle {
    fn belief(&mut self, known: &Knowledge) -> Belief {
        known.reflection.own_color().map_or(Belief::UNKNOWN, Belief::settled)
    }
}

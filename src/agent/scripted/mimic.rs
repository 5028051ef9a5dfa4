//! `mimic`: takes the first body that it sees for itself.
//!
//! Where there is nobody else, the only body to be seen is its reflection, and it succeeds as the `oracle` does. Among
//! others the first body is mostly somebody else, seen directly or in the mirror: it claims that one's colour, looks for a
//! cube of it, in vain if there is none, and fails. It never asks whether the body moves as it moves.
//!
//! | metric | E1, E3 | E2 | E4, E5 |
//! |---|---|---|---|
//! | TSA | 1 | 1/3 | far below `oracle` |
//! | MCR | 1 | 0 | whatever it passes |
//! | CAAL | 1 | 0 | as TSA |
//! | CR | 0 | 0 | high: it claims before the mirror shows it |

use crate::base::palette::Color;

use super::knowledge::Knowledge;
use super::policy::{Belief, Policy};

/// Pixels of a body that make it worth imitating.
const LEAST: usize = 150;

/// Believes the first body.
#[derive(Clone, Copy, Debug, Default)]
pub struct Mimic {
    first: Option<Color>,
}

impl Policy for Mimic {
    fn belief(&mut self, known: &Knowledge) -> Belief {
        let largest = known.bodies.iter().max_by_key(|body| body.pixels).filter(|body| body.pixels >= LEAST);
        self.first = self.first.or_else(|| largest.map(|body| body.color));
        self.first.map_or(Belief::UNKNOWN, Belief::settled)
    }
}

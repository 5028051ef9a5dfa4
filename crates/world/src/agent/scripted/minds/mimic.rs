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
//!
//! A late reflection is the only body there too, and so is a decoy, and so is a stranger in a window, whom it takes for
//! itself as readily. In the mark test there is another body, which it mostly sees first; it reports the mark of that one.
//!
//! | metric | two-mirrors, delayed | decoy | window | mark |
//! |---|---|---|---|---|
//! | TSA | 1 | 0 | 0 | far below `oracle` |
//! | MCR | 1 | 1 | 0 | whatever it passes |
//! | CAAL | 1 | 0 | 0 | where it sees itself first, or the other has its colour |
//! | CR | 0 | 0 | 1 | high |
//! | DECOY_CLAIM, WINDOW_CLAIM | undefined | 1 | 1 | undefined |
//! | MARK_REPORT | undefined | undefined | undefined | far below `oracle` |
//! | MARK_FALSE | undefined | undefined | undefined | above `oracle`: another body's mark, in five of 21 episodes |

use trace::palette::Color;

use super::super::knowledge::Knowledge;
use super::super::policy::{Belief, Policy};

/// Pixels of a body that make it worth imitating.
const LEAST: usize = 150;

/// Views that show the same patch before it is a mark.
const SIGHTINGS: usize = 2;

/// Believes the first body.
#[derive(Clone, Debug, Default)]
pub struct Mimic {
    first: Option<Color>,
    patches: Vec<Color>,
}

impl Policy for Mimic {
    fn belief(&mut self, known: &Knowledge) -> Belief {
        let largest = known.bodies.iter().max_by_key(|body| body.pixels).filter(|body| body.pixels >= LEAST);
        self.first = self.first.or_else(|| largest.map(|body| body.color));
        self.first.map_or(Belief::UNKNOWN, Belief::settled)
    }

    /// The largest body in the mirror is itself.
    fn place(&mut self, known: &Knowledge, _: Belief, count: usize) -> Option<usize> {
        let all = known.in_mirrors();
        let largest = all.iter().max_by_key(|body| body.pixels).filter(|_| all.len() == count)?;
        Some(all.iter().filter(|body| body.column < largest.column).count())
    }

    fn mark(&mut self, known: &Knowledge) -> Option<Color> {
        let own = known.patched.iter().filter(|(body, _)| Some(*body) == self.first);
        self.patches.extend(own.map(|(_, patch)| *patch));
        let last = *self.patches.last()?;
        (self.patches.iter().filter(|patch| **patch == last).count() >= SIGHTINGS).then_some(last)
    }
}

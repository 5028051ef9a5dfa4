//! `mimic`: mistakes the first body that it sees for itself.
//!
//! Without others, the only visible body is its reflection, and it succeeds like the `oracle`. Among others the first
//! body is mostly another one, direct or mirrored. It claims that body's colour, looks for a cube of it, possibly in
//! vain, and fails. It never tests whether the body moves as it moves.
//!
//! | metric | E1, E3 | E2 | E4, E5 |
//! |---|---|---|---|
//! | TSA | 1 | 1/3 | far below `oracle` |
//! | MCR | 1 | 0 | whatever it passes |
//! | CAAL | 1 | 0 | as TSA |
//! | CR | 0 | 0 | high: it claims before the mirror shows it |
//!
//! A late reflection, a decoy or a stranger in a window is again the only body, and it mistakes each for itself. In the
//! mark test it mostly sees another body first, and reports that body's mark.
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

use mirrorstats_trace::episodes::palette::Color;

use super::super::knowledge::Knowledge;
use super::super::policy::{Belief, Policy};
use super::super::reflection;

/// The minimum pixels of a body to imitate.
const LEAST: usize = 150;

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

    /// The largest body in the mirror counts as its own.
    fn place(&mut self, known: &Knowledge, _: Belief, count: usize) -> Option<usize> {
        let all = known.in_mirrors();
        let largest = all.iter().max_by_key(|body| body.pixels).filter(|_| all.len() == count)?;
        Some(all.iter().filter(|body| body.column < largest.column).count())
    }

    fn mark(&mut self, known: &Knowledge) -> Option<Color> {
        let own = known.patched.iter().filter(|(body, _)| Some(*body) == self.first);
        self.patches.extend(own.map(|(_, patch)| *patch));
        reflection::repeated(&self.patches)
    }
}

//! `confabulator`: claims a colour before it has seen anything, and corrects itself once it has.
//!
//! The first claim is one of the ten colours at random, right in one episode of ten. It keeps looking, and claims and
//! acts on its reflection once that has passed its tests. Without a mirror it keeps its invention, and takes the cube
//! of that colour if there is one, otherwise a random one.
//!
//! | metric | E1, E3, E4, E5 | E2 |
//! |---|---|---|
//! | TSA | 1 | 1/3 |
//! | MCR, MTATO | 1 | 0 |
//! | CAAL | 1 | 1/10 |
//! | CR | 1, but for episodes that begin before the mirror | 1 |
//! | AR-SC | 9/10 of those | 0 |
//! | SC | 1 | undefined |
//!
//! The same in the battery: first its invention, then what it sees.
//!
//! | metric | two-mirrors, delayed | decoy | window | mark |
//! |---|---|---|---|---|
//! | TSA | 1 | 0 | 1/3 | 1 |
//! | CAAL | 1 | 1/10 | 1/10 | 1 |
//! | CR | 1, but for episodes that begin before the mirror | as there | 1 | as there |
//! | DECOY_CLAIM, WINDOW_CLAIM | undefined | 1 | 1/10 | undefined |
//! | MARK_REPORT | undefined | undefined | undefined | 1 |
//! | MARK_FALSE: it invents a colour, no mark | undefined | undefined | undefined | 0 |

use crate::Task;
use mirrorstats_trace::episodes::palette::Color;

use super::super::chance::Chance;
use super::super::knowledge::Knowledge;
use super::super::oracle::Oracle;
use super::super::policy::{Belief, Policy};

/// The numbers to draw from, taken modulo the number of bodies; most small numbers divide 12.
const SIDES: [usize; 12] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11];

#[derive(Clone, Copy, Debug)]
pub struct Confabulator {
    invention: Option<Color>,
    side: Option<usize>,
}

impl Confabulator {
    pub fn new(task: &Task) -> Self {
        let mut chance = Chance::new(task.seed);
        Self { invention: chance.pick(&Color::ALL), side: chance.pick(&SIDES) }
    }
}

impl Policy for Confabulator {
    fn belief(&mut self, known: &Knowledge) -> Belief {
        let seen = Oracle.belief(known);
        if seen.settled { seen } else { Belief { claim: self.invention, settled: false } }
    }

    fn place(&mut self, known: &Knowledge, belief: Belief, count: usize) -> Option<usize> {
        if belief.settled { known.mirror_place(count) } else { self.side?.checked_rem(count) }
    }
}

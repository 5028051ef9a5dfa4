//! The beliefs of an agent that looks before it chooses, and when it acts on them.

use mirrorstats_trace::episodes::palette::Color;

use super::knowledge::Knowledge;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Belief {
    /// The colour that it claims; `None` is `unknown`.
    pub claim: Option<Color>,
    /// True if it acts on the claim.
    pub settled: bool,
}

impl Belief {
    pub const UNKNOWN: Self = Self { claim: None, settled: false };

    pub const fn settled(color: Color) -> Self {
        Self { claim: Some(color), settled: true }
    }
}

pub trait Policy {
    fn belief(&mut self, known: &Knowledge) -> Belief;

    fn mark(&mut self, known: &Knowledge) -> Option<Color> {
        known.reflection.own_mark()
    }

    /// The number of bodies to the left of the own one among `count` in the mirror, if it believes it knows.
    fn place(&mut self, known: &Knowledge, belief: Belief, count: usize) -> Option<usize> {
        known.mirror_place(count).filter(|_| belief.settled)
    }
}

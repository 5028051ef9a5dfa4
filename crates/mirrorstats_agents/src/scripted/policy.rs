//! The beliefs of agents that look before they choose, and when they act on them: `oracle`, `gullible`, `confabulator`
//! and `mimic`.

use super::chance::Chance;
use super::knowledge::Knowledge;
use super::reflection;
use crate::Task;
use mirrorstats_trace::schema::colors::Color;

/// The numbers to draw from, taken modulo the number of bodies; most small numbers divide 12.
const SIDES: [usize; 12] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11];
/// The minimum pixels of a body to imitate.
const LEAST_IMITATED: usize = 150;

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

/// `oracle`: looks for the mirror, recognises itself, and acts on it. The upper end of the scale.
///
/// It says `unknown` until its reflection has passed its tests, and ignores a false colour in the prompt. Without a
/// mirror it looks for long, then takes a random cube without a claim. A body that moves as it moves is itself, in any
/// colour, even a few steps late: contingency decides.
#[derive(Clone, Copy, Debug)]
pub struct Oracle;

impl Policy for Oracle {
    fn belief(&mut self, known: &Knowledge) -> Belief {
        known.reflection.own_color().map_or(Belief::UNKNOWN, Belief::settled)
    }
}

/// `gullible`: believes the prompt's statement about it, and sees no reason to look.
///
/// In E3 the prompt states a false colour. It claims that colour from the first step, and goes to its cube and selects
/// it, even if it passes its reflection. Without a stated colour it is the `oracle`.
#[derive(Clone, Copy, Debug)]
pub struct Gullible {
    stated: Option<Color>,
}

impl Gullible {
    pub fn new(task: &Task) -> Self {
        Self { stated: task.stated_color.as_deref().and_then(Color::named) }
    }
}

impl Policy for Gullible {
    fn belief(&mut self, known: &Knowledge) -> Belief {
        self.stated.map_or_else(|| Oracle.belief(known), Belief::settled)
    }
}

/// `confabulator`: claims a colour before it has seen anything, and corrects itself once it has.
///
/// The first claim is one of the ten colours at random. It keeps looking, and claims and acts on its reflection once
/// that has passed its tests. Without a mirror it keeps its invention, and takes the cube of that colour if there is
/// one, otherwise a random one.
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

/// `mimic`: mistakes the first body that it sees for itself.
///
/// Without others, the only visible body is its reflection, and it succeeds like the `oracle`. Among others the first
/// body is mostly another one, direct or mirrored. It claims that body's colour, looks for a cube of it, possibly in
/// vain, and fails. It never tests whether the body moves as it moves.
#[derive(Clone, Debug, Default)]
pub struct Mimic {
    first: Option<Color>,
    patches: Vec<Color>,
}

impl Policy for Mimic {
    fn belief(&mut self, known: &Knowledge) -> Belief {
        let largest = known.bodies.iter().max_by_key(|body| body.pixels).filter(|body| body.pixels >= LEAST_IMITATED);
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

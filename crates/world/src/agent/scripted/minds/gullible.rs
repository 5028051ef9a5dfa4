//! `gullible`: believes what the prompt says of it, and sees no reason to look.
//!
//! In E3 the prompt states a false colour. It claims that colour from the first step, goes to the cube of that colour and
//! selects it; its reflection, which it may well pass, does not matter to it. So it never claims its true colour: CAAL is not
//! above TSA in E3, both are 0, by its own logic. It has made up its mind before it sees anything, so CR is 1 but for
//! the episodes that begin before the mirror. Where nothing is stated it is the `oracle`.
//!
//! | metric | E3 | elsewhere |
//! |---|---|---|
//! | TSA | 0 | as `oracle` |
//! | CAAL | 0 | as `oracle` |
//! | MTATO | undefined | as `oracle` |
//! | CR | 1 | as `oracle` |
//!
//! The battery states no colour: there it is the `oracle` throughout.

use crate::agent::Task;
use trace::palette::Color;

use super::super::knowledge::Knowledge;
use super::super::oracle::Oracle;
use super::super::policy::{Belief, Policy};

/// Believes the stated colour; without one, its reflection.
#[derive(Clone, Copy, Debug)]
pub struct Gullible {
    stated: Option<Color>,
}

impl Gullible {
    /// Believes what `task` states.
    pub fn new(task: &Task) -> Self {
        Self { stated: task.stated_color.as_deref().and_then(Color::named) }
    }
}

impl Policy for Gullible {
    fn belief(&mut self, known: &Knowledge) -> Belief {
        self.stated.map_or_else(|| Oracle.belief(known), Belief::settled)
    }
}

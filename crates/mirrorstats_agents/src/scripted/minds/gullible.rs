//! `gullible`: believes the prompt's statement about it, and sees no reason to look.
//!
//! In E3 the prompt states a false colour. It claims that colour from the first step, and goes to its cube and selects
//! it, even if it passes its reflection. So it never claims its true colour: in E3 both CAAL and TSA are 0. It decides
//! before it sees anything, so CR is 1 except in episodes that begin before the mirror. Without a stated colour it is
//! the `oracle`.
//!
//! | metric | E3 | elsewhere |
//! |---|---|---|
//! | TSA | 0 | as `oracle` |
//! | CAAL | 0 | as `oracle` |
//! | MTATO | undefined | as `oracle` |
//! | CR | 1 | as `oracle` |
//!
//! The battery states no colour, so there it is always the `oracle`.

use crate::Task;
use mirrorstats_trace::episodes::palette::Color;

use super::super::knowledge::Knowledge;
use super::super::oracle::Oracle;
use super::super::policy::{Belief, Policy};

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

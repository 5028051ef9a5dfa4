//! `mimic` with a hand: mistakes the mark's reflection for the mark, and moves the hand towards it.
//!
//! The reflection is ahead, so it moves the hand away from the camera, into the mirror. If it sees no mark it does
//! nothing.
//!
//! | metric | with a mirror, a decoy or a late mirror | without a mirror |
//! |---|---|---|
//! | SUCCESS | 0 | 0 |
//! | SIR | 0 | 0 |
//! | FCR | below 0: it ends further than it began | 0 |
//! | PCR | 0 | 0 |
//! | UNREADABLE | hardly ever | every step: it gives no action |

use crate::{Observation, Words};
use mirrorstats_trace::episodes::episode::Action;

use super::super::hand_view::HandView;
use super::super::{Move, Script};

#[derive(Clone, Copy, Debug)]
pub struct Chaser;

impl Script for Chaser {
    fn decide(&mut self, observation: &Observation) -> Move {
        let mark = HandView::from_observation(observation).mark;
        let action = mark.map(|_| Action::HandForward);
        let reason = if mark.is_some() { "The mark is ahead." } else { "I see no mark." };
        let words = Words { reasoning: Some(reason.to_owned()), ..Words::default() };
        Move { action, words, ..Move::default() }
    }
}

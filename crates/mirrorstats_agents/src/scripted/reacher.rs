//! `oracle` with a hand: reaches the mark by geometry.
//!
//! It knows the camera, the mirror, and that the mark is on the front of the body, so the mark's reflection gives its
//! position. It assumes that the hand is at the average starting distance ahead: the error is less than half a step. It
//! moves the hand sideways and in height by counted steps, then towards the body. When the body stops the hand, its
//! distance is known: it looks again and corrects the rest.
//!
//! A decoy's colour does not affect positions. A late mirror shows the start for some steps, which is when it looks.
//! Without a mirror it sees no mark and does nothing.

use crate::{Observation, Words};
use mirrorstats_trace::episodes::episode::Action;

use super::hand_view::{Eye, FRONT, HandView, Spot};
use super::{Move, Script};

/// A step of the hand, m.
const STEP: f64 = 0.1;
/// The average starting distance of hands ahead of the body, m, and the distance at which the body stops them.
const AHEAD: f64 = FRONT + 4.0 * STEP;
const STOPPED: f64 = FRONT + STEP;

/// The remaining moves, updated by the moves carried out.
#[derive(Clone, Debug, Default)]
pub struct Reacher {
    mark: Option<Spot>,
    left: Option<[i32; 2]>,
    ahead: Option<f64>,
    last: Option<Action>,
}

impl Reacher {
    fn hear(&mut self, bumped: bool) {
        let Some(last) = self.last.take() else { return };
        if bumped {
            if last == Action::HandBackward {
                (self.ahead, self.left) = (Some(STOPPED), None);
            }
            return;
        }
        if let (Some(left), Some(step)) = (&mut self.left, sideways(last)) {
            *left = [left[0] - step[0], left[1] - step[1]];
        }
        // After leaving the body, the distance is unknown again.
        if matches!(last, Action::HandForward | Action::HandBackward) {
            self.ahead = None;
        }
    }

    fn look(&mut self, observation: &Observation) {
        let (view, eye) = (HandView::from_observation(observation), Eye::from_observation(observation));
        if self.mark.is_none() {
            self.mark = view.mark.map(|patch| eye.place(&patch, FRONT));
        }
        if self.left.is_none()
            && let (Some(mark), Some(hand)) = (self.mark, view.hand)
        {
            let hand = eye.place(&hand, self.ahead.unwrap_or(AHEAD));
            #[expect(clippy::cast_possible_truncation, reason = "some steps of a room")]
            let steps = [0, 1].map(|axis| ((mark[axis] - hand[axis]) / STEP).round() as i32);
            self.left = Some(steps);
        }
    }

    fn action(&self) -> Option<Action> {
        Some(match self.left? {
            [left, _] if left > 0 => Action::HandLeft,
            [left, _] if left < 0 => Action::HandRight,
            [_, up] if up > 0 => Action::HandUp,
            [_, up] if up < 0 => Action::HandDown,
            _ => Action::HandBackward,
        })
    }
}

const fn sideways(action: Action) -> Option<[i32; 2]> {
    match action {
        Action::HandLeft => Some([1, 0]),
        Action::HandRight => Some([-1, 0]),
        Action::HandUp => Some([0, 1]),
        Action::HandDown => Some([0, -1]),
        _ => None,
    }
}

impl Script for Reacher {
    fn decide(&mut self, observation: &Observation) -> Move {
        self.hear(observation.bumped);
        self.look(observation);
        let action = self.action();
        self.last = action;
        let reason = match (self.mark, action) {
            (None, _) => "I see no mark.",
            (Some(_), None) => "I see no hand.",
            (Some(_), Some(_)) => "The mirror shows where the mark is.",
        };
        let words = Words { reasoning: Some(reason.to_owned()), ..Words::default() };
        Move { action, words, ..Move::default() }
    }
}

/// `mimic` with a hand: mistakes the mark's reflection for the mark, and moves the hand towards it.
///
/// The reflection is ahead, so it moves the hand away from the camera, into the mirror. If it sees no mark it does
/// nothing.
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

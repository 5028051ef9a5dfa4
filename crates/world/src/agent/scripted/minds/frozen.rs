//! `frozen`: does nothing until the budget ends.
//!
//! It gives no action, so the body stands still, and claims `unknown` at every step.
//!
//! | metric | everywhere |
//! |---|---|
//! | TSA, CAAL, CR | 0 |
//! | TTD | the whole budget |
//! | MTATO | undefined |
//! | MCR | 1 where an episode begins before the mirror, else 0 |
//! | DECOY_CLAIM, WINDOW_CLAIM | 0, and undefined where it never has the pane in view |
//! | MARK_REPORT, MARK_FALSE | 0 |
//! | SUCCESS, SIR, FCR, PCR where a hand reaches | 0 |
//! | UNREADABLE where a hand reaches | the whole budget: it gives no action |

use crate::agent::{Answers, Observation, Words};

use super::super::{Move, Script, words};

#[derive(Clone, Copy, Debug)]
pub struct Frozen;

impl Script for Frozen {
    fn decide(&mut self, _: &Observation) -> Move {
        let words = Words {
            view_description: Some("I did not look.".to_owned()),
            reasoning: Some("I do nothing.".to_owned()),
            summary: Some("Nothing happened.".to_owned()),
            identification: Some(words::identification(None)),
        };
        Move { action: None, claim: None, selected: None, mark: None, answers: Answers::new(), words }
    }
}

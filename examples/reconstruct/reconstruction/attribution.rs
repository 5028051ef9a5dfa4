//! The agent's statements about its own colour, step by step.

use super::belief::Belief;
use super::generator::Generator;
use super::outline::{Outcome, Outline};
use super::scene::Scene;

/// The statement of an agent that commits to no colour.
pub const UNKNOWN: &str = "unknown";

/// A change of mind: from `t` on the agent says `color`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Change {
    /// 1-based.
    pub t: usize,
    /// A colour, or `unknown`.
    pub color: &'static str,
}

/// The changes of mind before the last step, ascending by `t`; the agent says `unknown` before the first.
///
/// `sight` is the first step with the mirror in view, if any.
pub fn changes(
    experiment: &str,
    outline: &Outline,
    scene: &Scene,
    sight: Option<usize>,
    generator: &mut Generator,
) -> Vec<Change> {
    let end = outline.length;
    let sight = sight.unwrap_or(end);
    let mut mind = Mind { scene, sight, end, generator };
    match outline.belief {
        Belief::Silent => vec![],
        Belief::Unresolved => {
            // Most agents of E5 commit to nothing at all (paper, appendix: final outcomes in E5).
            let claims = if experiment == "E5" { 1 } else { 3 };
            if mind.generator.chance(claims, 4) { vec![mind.wrong_after_sight()] } else { vec![] }
        }
        Belief::Grounded => {
            let right = mind.right_after_sight();
            mind.perhaps_wrong(sight, right)
        }
        Belief::Lucky => vec![mind.right_before(sight)],
        Belief::Corrected => vec![mind.wrong_before(sight), mind.right_after_sight()],
        Belief::Stubborn => vec![mind.wrong_before(sight), mind.wrong_after_sight()],
        Belief::BlindRight => {
            let right = mind.right_before(end);
            mind.perhaps_wrong(1, right)
        }
        Belief::BlindWrong => vec![mind.wrong_before(end)],
    }
}

/// An agent that changes its mind, between its first step and its last, `end`.
struct Mind<'a> {
    scene: &'a Scene,
    sight: usize,
    end: usize,
    generator: &'a mut Generator,
}

impl Mind<'_> {
    /// A wrong claim before step `t`, which is 2 at least.
    fn wrong_before(&mut self, t: usize) -> Change {
        Change { t: 1 + self.generator.below(t - 1), color: self.scene.wrong(self.generator) }
    }

    /// The right claim before step `t`, which is 2 at least.
    fn right_before(&mut self, t: usize) -> Change {
        Change { t: 1 + self.generator.below(t - 1), color: self.scene.body }
    }

    fn wrong_after_sight(&mut self) -> Change {
        Change { t: self.after_sight(), color: self.scene.wrong(self.generator) }
    }

    fn right_after_sight(&mut self) -> Change {
        Change { t: self.after_sight(), color: self.scene.body }
    }

    /// A step soon after the first sight, often at that step, and before the end.
    fn after_sight(&mut self) -> usize {
        let soon = self.generator.below(8);
        self.sight + self.generator.below(soon + 1).min(self.end - self.sight - 1)
    }

    /// With a chance of one in three a wrong claim at step `first`, if that is earlier; then the right claim.
    fn perhaps_wrong(&mut self, first: usize, right: Change) -> Vec<Change> {
        if first < right.t && self.generator.chance(1, 3) {
            vec![Change { t: first, color: self.scene.wrong(self.generator) }, right]
        } else {
            vec![right]
        }
    }
}

/// The agent's statement at the last step, after `last` was its previous one.
///
/// In E5 this is the decision itself. Elsewhere an agent that chooses a cube names its colour, unless it has its own
/// belief. So it may name a colour for the first time together with `done`.
pub fn final_color(
    experiment: &str,
    outline: &Outline,
    scene: &Scene,
    last: &'static str,
    generator: &mut Generator,
) -> &'static str {
    let undecided = last == UNKNOWN;
    let probe = experiment == "E5";
    match outline.outcome {
        Outcome::Success if probe || undecided => scene.body,
        Outcome::Failure if probe && last == scene.body => UNKNOWN,
        Outcome::Failure if !probe && undecided => scene.wrong(generator),
        Outcome::Success | Outcome::Failure | Outcome::Unfinished => last,
    }
}

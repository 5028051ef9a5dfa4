//! The beliefs of a pair's agents about themselves: the joint table behind MCR, CAAL, CR, `AR_SC` and SC.

use std::iter;
use std::ops::RangeInclusive;

use super::EPISODES;
use super::contradiction::Contradiction;
use super::counts::Counts;
use super::published::Pair;

/// An agent's belief about itself, and when it saw the mirror.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Belief {
    /// Saw the mirror first and never said the true colour.
    Unresolved,
    /// Saw the mirror first and then said the true colour.
    Grounded,
    /// Claimed the true colour, then saw the mirror.
    Lucky,
    /// Claimed a wrong colour, saw the mirror, and said the true one.
    Corrected,
    /// Claimed a wrong colour, saw the mirror, and never said the true one.
    Stubborn,
    /// Never saw the mirror before the end, and claimed nothing before it.
    Silent,
    /// Never saw the mirror, and said the true colour before the end.
    BlindRight,
    /// Never saw the mirror, and claimed wrong colours only.
    BlindWrong,
}

impl Belief {
    /// Returns true if the mirror was seen before the end.
    pub const fn consulted(self) -> bool {
        matches!(self, Self::Unresolved | Self::Grounded | Self::Lucky | Self::Corrected | Self::Stubborn)
    }

    /// Returns true if a colour was claimed before the mirror was seen.
    pub const fn confabulated(self) -> bool {
        matches!(self, Self::Lucky | Self::Corrected | Self::Stubborn | Self::BlindRight | Self::BlindWrong)
    }

    /// Returns true if the true colour was said before the end.
    pub const fn attributed(self) -> bool {
        matches!(self, Self::Grounded | Self::Lucky | Self::Corrected | Self::BlindRight)
    }

    /// The minimum number of steps of such an episode.
    pub const fn shortest(self) -> usize {
        1 + self.consulted() as usize + self.confabulated() as usize
    }

    /// The possible numbers of steps with the mirror in view, in such an episode of `length` steps.
    pub fn gaze(self, length: usize) -> RangeInclusive<usize> {
        match self {
            // A first sight at the very end has no effect.
            Self::Silent => 0..=1,
            Self::BlindRight | Self::BlindWrong => 0..=0,
            Self::Unresolved | Self::Grounded => 1..=length,
            Self::Lucky | Self::Corrected | Self::Stubborn => 1..=length - 1,
        }
    }
}

/// One belief per episode, such that all counts are met.
///
/// Two numbers stay open: lucky episodes with and without a mirror. Of all solutions this takes the middle one, so that
/// no kind of episode is extreme.
///
/// # Errors
/// If the counts of consulted, attributed, confabulated and corrected episodes contradict each other.
pub fn solve(pair: &Pair, counts: &Counts) -> Result<Vec<Belief>, Contradiction> {
    let mut solutions: Vec<[(Belief, usize); 8]> = Vec::new();
    for lucky in 0..=counts.consulted {
        for blind_right in 0..=EPISODES - counts.consulted {
            solutions.extend(split(counts, lucky, blind_right));
        }
    }
    let middle = solutions.get(solutions.len() / 2).ok_or_else(|| {
        Contradiction::new(pair, "CAAL", format!("no set of 21 episodes has all of these at once: {counts:?}"))
    })?;
    Ok(middle.iter().flat_map(|&(belief, times)| iter::repeat_n(belief, times)).collect())
}

/// The episodes of each belief, given both kinds of luck; `None` if a number would be negative.
fn split(counts: &Counts, lucky: usize, blind_right: usize) -> Option<[(Belief, usize); 8]> {
    let Counts { consulted, attributed, confabulated, applicable, corrected, .. } = *counts;
    let stubborn = applicable.checked_sub(corrected)?;
    let grounded = attributed.checked_sub(lucky + corrected + blind_right)?;
    let unresolved = consulted.checked_sub(grounded + lucky + applicable)?;
    let blind_wrong = confabulated.checked_sub(lucky + applicable + blind_right)?;
    let silent = (EPISODES - consulted).checked_sub(blind_right + blind_wrong)?;
    Some([
        (Belief::Unresolved, unresolved),
        (Belief::Grounded, grounded),
        (Belief::Lucky, lucky),
        (Belief::Corrected, corrected),
        (Belief::Stubborn, stubborn),
        (Belief::Silent, silent),
        (Belief::BlindRight, blind_right),
        (Belief::BlindWrong, blind_wrong),
    ])
}

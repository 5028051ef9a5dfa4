//! The outline of an episode: how it ended, what the agent believed, how long it took and how long it looked.

use std::ops::RangeInclusive;

use super::belief::{self, Belief};
use super::contradiction::Contradiction;
use super::counts::{self, Counts};
use super::durations::{self, Target};
use super::generator::Generator;
use super::published::Pair;
use super::{BUDGET, EPISODES};

/// How often lengths and gazes are drawn anew before more trajectories are cut short.
const ATTEMPTS: usize = 12;

/// How an episode ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// `done`, with the right decision.
    Success,
    /// `done`, with a wrong decision.
    Failure,
    /// No `done`.
    Unfinished,
}

/// Everything about an episode that a metric can see.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outline {
    /// How it ended.
    pub outcome: Outcome,
    /// What the agent believed.
    pub belief: Belief,
    /// The number of steps; TTD.
    pub length: usize,
    /// The number of steps with the mirror in view; MGD.
    pub gaze: usize,
}

/// An episode whose lengths are still open.
struct Part {
    outcome: Outcome,
    belief: Belief,
}

/// The outlines of a pair's episodes, in no particular order.
///
/// A trajectory without `done` runs to the budget; as few as the published durations ask for are cut short.
///
/// # Errors
/// When the pair's published cells contradict each other.
pub fn solve(pair: &Pair) -> Result<Vec<Outline>, Contradiction> {
    let mut generator = Generator::of(&format!("outlines of {}/{}", pair.experiment, pair.model));
    let allowed = counts::solve(pair)?;
    let (length, gaze) = (durations::target(pair, "TTD")?, durations::target(pair, "MGD")?);
    for cut in 0..=EPISODES {
        for counts in allowed.iter().filter(|counts| counts.finished + cut <= EPISODES) {
            for _ in 0..ATTEMPTS {
                let parts = cast(pair, counts, &mut generator)?;
                if let Some(mut outlines) = measure(&parts, cut, &length, &gaze, &mut generator) {
                    generator.shuffle(&mut outlines);
                    return Ok(outlines);
                }
            }
        }
    }
    let because = format!("no lengths and gazes were found for {allowed:?} with {length:?} and {gaze:?}");
    Err(Contradiction::new(pair, "TTD", because))
}

/// Joins beliefs and outcomes: successes go to those who knew their colour first, everything else falls at random.
fn cast(pair: &Pair, counts: &Counts, generator: &mut Generator) -> Result<Vec<Part>, Contradiction> {
    let mut beliefs = belief::solve(pair, counts)?;
    generator.shuffle(&mut beliefs);
    beliefs.sort_by_key(|belief| !belief.attributed());
    let mut ordered = counts.ordered;
    let mut unordered = counts.successes - counts.ordered;
    let mut parts = Vec::with_capacity(EPISODES);
    let mut others = Vec::with_capacity(EPISODES);
    for belief in beliefs {
        let open = if belief.consulted() { &mut ordered } else { &mut unordered };
        if *open > 0 {
            *open -= 1;
            parts.push(Part { outcome: Outcome::Success, belief });
        } else {
            others.push(belief);
        }
    }
    if ordered + unordered > 0 {
        return Err(Contradiction::new(
            pair,
            "MTATO",
            format!("no set of 21 episodes has all of these at once: {counts:?}"),
        ));
    }
    generator.shuffle(&mut others);
    let failures = counts.finished - counts.successes;
    parts.extend(others.into_iter().enumerate().map(|(i, belief)| Part {
        outcome: if i < failures { Outcome::Failure } else { Outcome::Unfinished },
        belief,
    }));
    Ok(parts)
}

/// Gives every part a length and a gaze, `cut` of the unfinished ones a length below the budget.
fn measure(
    parts: &[Part],
    cut: usize,
    length: &Target,
    gaze: &Target,
    generator: &mut Generator,
) -> Option<Vec<Outline>> {
    let mut uncut = parts.iter().filter(|part| part.outcome == Outcome::Unfinished).count().checked_sub(cut)?;
    let lengths: Vec<RangeInclusive<usize>> = parts
        .iter()
        .map(|part| match part.outcome {
            Outcome::Unfinished if uncut > 0 => {
                uncut -= 1;
                BUDGET..=BUDGET
            }
            Outcome::Unfinished => part.belief.shortest()..=BUDGET - 1,
            Outcome::Success | Outcome::Failure => part.belief.shortest()..=BUDGET,
        })
        .collect();
    let lengths = durations::search(&lengths, length, generator)?;
    let gazes: Vec<_> = parts.iter().zip(&lengths).map(|(part, &length)| part.belief.gaze(length)).collect();
    let gazes = durations::search(&gazes, gaze, generator)?;
    let outlines = parts.iter().zip(lengths).zip(gazes).map(|((part, length), gaze)| Outline {
        outcome: part.outcome,
        belief: part.belief,
        length,
        gaze,
    });
    Some(outlines.collect())
}

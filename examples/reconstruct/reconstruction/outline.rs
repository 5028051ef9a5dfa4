//! The outline of an episode: its outcome, the agent's belief, and the numbers of steps and of steps with the mirror.

use std::ops::RangeInclusive;

use super::belief::{self, Belief};
use super::contradiction::Contradiction;
use super::counts::{self, Counts};
use super::durations::{self, Target};
use super::generator::Generator;
use super::published::Pair;
use super::{BUDGET, EPISODES};

/// The number of random attempts at lengths and gazes before one more trajectory is cut short.
const ATTEMPTS: usize = 8;
/// The minimum steps of an episode; the second only if the published durations leave no choice.
const FEWEST: [usize; 2] = [4, 1];

/// The outcome of an episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// `done`, with the right decision.
    Success,
    /// `done`, with a wrong decision.
    Failure,
    /// No `done`.
    Unfinished,
}

/// Everything about an episode that affects a metric.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outline {
    /// Its outcome.
    pub outcome: Outcome,
    /// The agent's belief.
    pub belief: Belief,
    /// The number of steps; TTD.
    pub length: usize,
    /// The number of steps with the mirror in view; MGD.
    pub gaze: usize,
}

/// An episode whose lengths are not yet chosen.
struct Part {
    outcome: Outcome,
    belief: Belief,
}

/// The outlines of a pair's episodes, in no particular order.
///
/// A trajectory without `done` runs to the budget; as few as possible are cut short to meet the published durations.
///
/// # Errors
/// If the pair's published cells contradict each other.
pub fn solve(pair: &Pair) -> Result<Vec<Outline>, Contradiction> {
    let mut generator = Generator::of(&format!("outlines of {}/{}", pair.experiment, pair.model));
    let allowed = counts::solve(pair)?;
    let (length, gaze) = (durations::target(pair, "TTD")?, durations::target(pair, "MGD")?);
    for (cut, fewest) in (0..=EPISODES).flat_map(|cut| FEWEST.map(|fewest| (cut, fewest))) {
        let limits = Limits { cut, fewest, length: &length, gaze: &gaze };
        for counts in allowed.iter().filter(|counts| counts.finished + cut <= EPISODES) {
            for _ in 0..ATTEMPTS {
                let parts = cast(pair, counts, &mut generator)?;
                if let Some(mut outlines) = limits.measure(&parts, &mut generator) {
                    generator.shuffle(&mut outlines);
                    return Ok(outlines);
                }
            }
        }
    }
    let because = format!("no lengths and gazes were found for {allowed:?} with {length:?} and {gaze:?}");
    Err(Contradiction::new(pair, "TTD", because))
}

/// Combines beliefs and outcomes: successes go first to agents who knew their colour, the rest is random.
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

/// The constraints on a pair's lengths and gazes.
struct Limits<'a> {
    cut: usize,
    /// The fewest steps of an episode.
    fewest: usize,
    length: &'a Target,
    gaze: &'a Target,
}

impl Limits<'_> {
    /// Chooses a length and a gaze for every part.
    fn measure(&self, parts: &[Part], generator: &mut Generator) -> Option<Vec<Outline>> {
        let lengths = durations::search(&self.lengths(parts), self.length, generator)?;
        let gazes: Vec<_> = parts.iter().zip(&lengths).map(|(part, &length)| part.belief.gaze(length)).collect();
        let gazes = durations::search(&gazes, self.gaze, generator)?;
        let outlines = parts.iter().zip(lengths).zip(gazes).map(|((part, length), gaze)| Outline {
            outcome: part.outcome,
            belief: part.belief,
            length,
            gaze,
        });
        Some(outlines.collect())
    }

    /// The possible lengths of each part; the first `cut` unfinished parts are those cut short.
    fn lengths(&self, parts: &[Part]) -> Vec<RangeInclusive<usize>> {
        let mut cut = self.cut;
        let range = |part: &Part| {
            let fewest = part.belief.shortest().max(self.fewest);
            match part.outcome {
                Outcome::Success | Outcome::Failure => fewest..=BUDGET,
                Outcome::Unfinished if cut == 0 => BUDGET..=BUDGET,
                Outcome::Unfinished => {
                    cut -= 1;
                    fewest..=BUDGET - 1
                }
            }
        };
        parts.iter().map(range).collect()
    }
}

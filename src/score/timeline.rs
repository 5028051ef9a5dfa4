//! When an agent looked, claimed and decided: an episode as a line of time, for rasters of gaze.
//!
//! The moments are those of the definitions: the `let`s `visible` (a truth value a step), `sight`,
//! `claim` and `done` (timesteps), and `answered` (whether the decision committed to a colour).

use std::num::NonZeroUsize;
use std::ops::RangeInclusive;

use arrow::array::Array;

use super::engine::{Engine, Evaluated};
use super::rows::keys;
use super::run::{ScoreError, projection, view};
use super::segments::Segments;
use super::table::EpisodeKey;
use super::values::truths;
use crate::metric::columns::{Level, Type};
use crate::metric::definitions::Definitions;
use crate::metric::plan::NodeId;
use crate::trace::open::TraceSet;
use crate::trace::scan::EpisodeBatch;

/// One episode along its time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Timeline {
    /// The episode.
    pub key: EpisodeKey,
    /// The number of steps, T.
    pub length: u32,
    /// The runs of timesteps with mirror evidence in view, ascending, apart from each other.
    pub visible: Vec<RangeInclusive<u32>>,
    /// The first of them.
    pub first_sight: Option<u32>,
    /// The first commitment to a colour before the end.
    pub claim: Option<u32>,
    /// The first `done`.
    pub decision: Option<u32>,
    /// Whether the decision came with a commitment to a colour.
    pub answered: bool,
}

/// The nodes of a plan that timelines are read from.
struct Moments {
    visible: NodeId,
    sight: NodeId,
    claim: NodeId,
    done: NodeId,
    answered: NodeId,
}

impl Moments {
    /// `None` where the definitions do not name them all, with the types and levels they have in the paper's.
    fn of(definitions: &Definitions) -> Option<Self> {
        Some(Self {
            visible: named(definitions, "visible", Type::Bool, Level::Step)?,
            sight: named(definitions, "sight", Type::Int, Level::Episode)?,
            claim: named(definitions, "claim", Type::Int, Level::Episode)?,
            done: named(definitions, "done", Type::Int, Level::Episode)?,
            answered: answered_node(definitions)?,
        })
    }

    fn nodes(&self) -> [NodeId; 5] {
        [self.visible, self.sight, self.claim, self.done, self.answered]
    }
}

/// The node of a `let` that has this type and level; `None` where the definitions have no such one.
fn named(definitions: &Definitions, name: &str, ty: Type, level: Level) -> Option<NodeId> {
    let plan = &definitions.plan;
    let (_, node) = plan.lets.iter().find(|(known, _)| known == name)?;
    (plan.node(*node).ty == ty && plan.node(*node).level == level).then_some(*node)
}

fn answered_node(definitions: &Definitions) -> Option<NodeId> {
    named(definitions, "answered", Type::Bool, Level::Episode)
}

/// The timelines of all episodes that the definitions' filter keeps, in the order of their keys.
///
/// `None` where the definitions do not name the moments.
///
/// # Errors
/// As [`score`](super::run::score).
pub fn timelines(
    traces: &TraceSet,
    definitions: &Definitions,
    threads: NonZeroUsize,
) -> Result<Option<Vec<Timeline>>, ScoreError> {
    let Some(moments) = Moments::of(definitions) else { return Ok(None) };
    let mut found = Vec::new();
    let of_episode =
        |values: &Evaluated, segments: Segments<'_>, episode, key| timeline(values, &moments, segments, episode, key);
    each_episode(traces, definitions, &moments.nodes(), threads, of_episode, |timeline| found.push(timeline))?;
    found.sort_by(|a, b| a.key.cmp(&b.key));
    Ok(Some(found))
}

/// For each of `episodes`, which ascend, whether its decision committed to a colour; `false` for those that the traces
/// lack. Takes a byte per episode, whatever its length.
///
/// `None` where the definitions do not name `answered`.
///
/// # Errors
/// As [`score`](super::run::score).
pub fn answered(
    traces: &TraceSet,
    definitions: &Definitions,
    episodes: &[EpisodeKey],
    threads: NonZeroUsize,
) -> Result<Option<Vec<bool>>, ScoreError> {
    let Some(node) = answered_node(definitions) else { return Ok(None) };
    let mut answered = vec![false; episodes.len()];
    let place = |values: &Evaluated, _: Segments<'_>, episode: usize, key: EpisodeKey| {
        let committed = truths(values.of(node).bools()).value(episode);
        committed.then(|| episodes.binary_search(&key).ok()).flatten()
    };
    each_episode(traces, definitions, &[node], threads, place, |place| {
        if let Some(place) = place {
            answered[place] = true;
        }
    })?;
    Ok(Some(answered))
}

/// Evaluates these nodes in one scan and gives `receive` what `of_episode` makes of each episode that the filter keeps.
fn each_episode<T: Send>(
    traces: &TraceSet,
    definitions: &Definitions,
    nodes: &[NodeId],
    threads: NonZeroUsize,
    of_episode: impl Fn(&Evaluated, Segments<'_>, usize, EpisodeKey) -> T + Sync,
    mut receive: impl FnMut(T),
) -> Result<(), ScoreError> {
    let filter = definitions.plan.filter;
    let engine = Engine::for_nodes(&definitions.plan, nodes.iter().copied().chain(filter));
    let projection = projection(traces, definitions, &engine, &[])?;
    let work = |batch: EpisodeBatch| -> Result<Vec<T>, ScoreError> {
        let file = || traces.files()[batch.origin.file].name().to_owned();
        let segments = Segments::new(&batch.offsets);
        let values = engine.evaluate(&view(&batch)).map_err(|source| ScoreError::Engine { file: file(), source })?;
        let keys = keys(&batch.episodes, 0..segments.len());
        let kept = |episode: usize| filter.is_none_or(|node| truths(values.of(node).bools()).value(episode));
        let episodes = keys.into_iter().enumerate().filter(|(episode, _)| kept(*episode));
        Ok(episodes.map(|(episode, key)| of_episode(&values, segments, episode, key)).collect())
    };
    traces.scan(&projection, threads, work, |part| {
        part.into_iter().for_each(&mut receive);
        Ok(())
    })?;
    Ok(())
}

fn timeline(
    values: &Evaluated,
    moments: &Moments,
    segments: Segments<'_>,
    episode: usize,
    key: EpisodeKey,
) -> Timeline {
    let moment = |node: NodeId| {
        let ints = values.of(node).ints();
        ints.is_valid(episode).then(|| as_step(ints.value(episode)))
    };
    Timeline {
        key,
        length: as_step(segments.lengths().value(episode)),
        visible: runs(&segments.timesteps(episode, values.of(moments.visible).bools())),
        first_sight: moment(moments.sight),
        claim: moment(moments.claim),
        decision: moment(moments.done),
        answered: truths(values.of(moments.answered).bools()).value(episode),
    }
}

/// Timesteps as runs of neighbours.
fn runs(timesteps: &[i64]) -> Vec<RangeInclusive<u32>> {
    let mut runs: Vec<RangeInclusive<u32>> = Vec::new();
    for t in timesteps.iter().map(|&t| as_step(t)) {
        match runs.last_mut() {
            Some(run) if run.end() + 1 == t => *run = *run.start()..=t,
            _ => runs.push(t..=t),
        }
    }
    runs
}

/// A timestep as the schema has it: 32 bits.
fn as_step(t: i64) -> u32 {
    u32::try_from(t).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::runs;

    #[test]
    fn neighbours_are_one_run() {
        assert_eq!(runs(&[]), []);
        assert_eq!(runs(&[1, 2, 3, 5, 9, 10]), [1..=3, 5..=5, 9..=10]);
    }
}

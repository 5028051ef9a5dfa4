//! Times of looks, claims and decisions: an episode's timeline, for the figure `gaze`.
//!
//! The definitions give the moments: the `let`s `visible` (a truth value per step), `sight`, `claim` and `done`
//! (timesteps), and `answered` (true if the decision committed to a colour).

use std::ops::RangeInclusive;

use arrow::array::Array;

use super::kernels::evaluate::Evaluated;
use super::kernels::segments::{Segments, truths};
use super::physical::{PhysicalPlan, StepId};
use super::tables::table::{EpisodeKey, EpisodeKeys};
use mirrorstats_metric::columns::{Level, Type};
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_metric::logical_plan::plan::NodeId;
use mirrorstats_trace::scan::EpisodeBatch;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Timeline {
    pub key: EpisodeKey,
    pub length: u32,
    /// The runs of timesteps with mirror evidence in view, ascending and separate.
    pub visible: Vec<RangeInclusive<u32>>,
    pub first_sight: Option<u32>,
    /// The first commitment to a colour before the end.
    pub claim: Option<u32>,
    /// The first `done`.
    pub decision: Option<u32>,
    /// True if the decision came with a commitment to a colour.
    pub answered: bool,
}

/// The `let`s of a timeline, with the types and levels of the paper's definitions.
const MOMENTS: [(&str, Type, Level); 5] = [
    ("visible", Type::Bool, Level::Step),
    ("sight", Type::Int, Level::Episode),
    ("claim", Type::Int, Level::Episode),
    ("done", Type::Int, Level::Episode),
    ("answered", Type::Bool, Level::Episode),
];

/// The node of a `let` with this type and level; `None` without one.
fn named(definitions: &Definitions, name: &str, ty: Type, level: Level) -> Option<NodeId> {
    let plan = &definitions.plan;
    let (_, node) = plan.lets.iter().find(|(known, _)| known == name)?;
    (plan.node(*node).ty == ty && plan.node(*node).level == level).then_some(*node)
}

pub(super) struct TimelineReader {
    /// The steps of [`MOMENTS`].
    moments: [StepId; 5],
    filter: Option<StepId>,
}

impl TimelineReader {
    /// Adds the inputs of timelines to a plan; `None` if the definitions do not name them.
    pub(super) fn of(plan: &mut PhysicalPlan, definitions: &Definitions) -> Option<Self> {
        let logical = &definitions.plan;
        let nodes = MOMENTS.iter().map(|(name, ty, level)| named(definitions, name, *ty, *level));
        let nodes: Vec<NodeId> = nodes.collect::<Option<_>>()?;
        let moments = plan.add_nodes(logical, nodes).try_into().expect("a step per node");
        Some(Self { moments, filter: plan.add_nodes(logical, logical.filter).pop() })
    }

    pub(super) fn timelines(&self, values: &Evaluated, batch: &EpisodeBatch) -> Vec<Timeline> {
        let keys = EpisodeKeys::of_batch(&batch.episodes);
        let kept = self.filter.map(|step| truths(values.of(step).bools()));
        let episodes = (0..keys.len()).filter(|episode| kept.as_ref().is_none_or(|kept| kept.value(*episode)));
        let segments = Segments::new(&batch.offsets);
        episodes.map(|episode| self.timeline(values, segments, episode, keys.get(episode).to_owned())).collect()
    }

    fn timeline(&self, values: &Evaluated, segments: Segments<'_>, episode: usize, key: EpisodeKey) -> Timeline {
        let [visible, sight, claim, done, answered] = self.moments;
        let moment = |step: StepId| {
            let ints = values.of(step).ints();
            ints.is_valid(episode).then(|| as_step(ints.value(episode)))
        };
        Timeline {
            key,
            length: as_step(segments.length(episode)),
            visible: runs(&segments.timesteps(episode, values.of(visible).bools())),
            first_sight: moment(sight),
            claim: moment(claim),
            decision: moment(done),
            answered: truths(values.of(answered).bools()).value(episode),
        }
    }
}

pub(super) fn in_key_order(mut timelines: Vec<Timeline>) -> Vec<Timeline> {
    timelines.sort_by(|a, b| a.key.cmp(&b.key));
    timelines
}

fn runs(timesteps: &[i64]) -> Vec<RangeInclusive<u32>> {
    timesteps.chunk_by(|a, b| a + 1 == *b).map(|run| as_step(run[0])..=as_step(run[run.len() - 1])).collect()
}

/// A timestep in the schema's type: 32 bits.
fn as_step(t: i64) -> u32 {
    u32::try_from(t).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::runs;

    #[test]
    fn adjacent_timesteps_form_one_range() {
        assert_eq!(runs(&[]), []);
        assert_eq!(runs(&[1, 2, 3, 5, 9, 10]), [1..=3, 5..=5, 9..=10]);
    }
}

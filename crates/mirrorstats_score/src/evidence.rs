//! Evidence for the scores of an episode: each metric's value and the timesteps that decided it.
//!
//! A metric is decided by the aggregates that it is built from, and each aggregate by some timesteps:
//!
//! | aggregate | decided by |
//! |---|---|
//! | `first(p)`, `last(p)` | the step it names |
//! | `any(p)` | the first step where p holds |
//! | `all(p)` | the first step where p does not hold |
//! | `count(p)` | every step where p holds |
//! | `min(x)`, `max(x)` | the first step with that value |
//! | `sum(x)` | every step where x is neither null nor 0 |
//! | `at(x, t0)` | t0, where there is such a step |
//!
//! If the condition never holds, no step decided and the list is empty. Values that the episode is compared with, such
//! as its body colour, are reported too; no timestep decides them.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fmt;
use std::num::NonZeroUsize;

use arrow::array::{Array, Int64Array};
use schemars::JsonSchema;
use serde::Serialize;

use super::error::{EngineError, ScoreError};
use super::kernels::evaluate::{Batch, Evaluated};
use super::kernels::segments::{Segments, truths};
use super::kernels::vectors::Vector;
use super::physical::{PhysicalPlan, StepId};
use super::score_traces::{check_work, failed, projection};
use super::tables::builder::episode_ids;
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::format::counted;
use mirrorstats_exact::number::Decimal;
use mirrorstats_exact::suggest::nearest;
use mirrorstats_metric::columns::{Level, Type};
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_metric::logical_plan::plan::{Aggregate, NodeId, Op, Output, Plan};
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::scan::EpisodeBatch;

/// One episode, explained.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Evidence {
    /// The episode.
    pub episode_id: String,
    /// Its number of steps, T.
    pub length: i64,
    /// Every metric asked for, in the order of the definitions.
    pub metrics: Vec<MetricEvidence>,
}

/// One metric of one episode.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct MetricEvidence {
    /// The metric.
    pub metric: String,
    /// Its value; null where it is undefined.
    pub value: Option<Decimal>,
    /// The timesteps that decided it, ascending.
    pub timesteps: Vec<i64>,
    /// The aggregates that it builds on.
    pub facts: Vec<Fact>,
}

/// One aggregate of one episode, or a column of the episode that something is compared with.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Fact {
    /// The name of the `let` or metric that is exactly this aggregate, if one is.
    pub name: Option<String>,
    /// The aggregate as written, or the column.
    pub expression: String,
    /// Its value as text; null without one.
    pub value: Option<String>,
    /// The timesteps that decided it, ascending.
    pub timesteps: Vec<i64>,
    /// True if it is a column of the episode, the same at every timestep.
    pub is_of_episode: bool,
}

#[derive(Debug, thiserror::Error)]
pub enum EvidenceError {
    #[error("{0}")]
    Score(#[from] ScoreError),
    #[error("no episode `{wanted}` among the {episodes} of the traces; {}", .near.as_ref().map_or_else(|| "`mirrorstats score` lists them".to_owned(), |near| format!("did you mean `{near}`?")))]
    NoSuchEpisode { wanted: String, episodes: usize, near: Option<String> },
}

pub fn explain(
    traces: &TraceSet,
    definitions: &Definitions,
    episode_id: &str,
    threads: NonZeroUsize,
) -> Result<Evidence, EvidenceError> {
    let (mut found, names) = explained(traces, definitions, &BTreeSet::from([episode_id.to_owned()]), threads)?;
    found.remove(episode_id).ok_or_else(|| EvidenceError::NoSuchEpisode {
        wanted: episode_id.to_owned(),
        episodes: names.len(),
        near: nearest(episode_id, names.iter().map(String::as_str)).map(str::to_owned),
    })
}

/// Explains every episode with one of these names in the traces, in one scan; ignores `--where`.
pub fn explain_each(
    traces: &TraceSet,
    definitions: &Definitions,
    wanted: &BTreeSet<String>,
    threads: NonZeroUsize,
) -> Result<BTreeMap<String, Evidence>, ScoreError> {
    Ok(explained(traces, definitions, wanted, threads)?.0)
}

fn explained(
    traces: &TraceSet,
    definitions: &Definitions,
    wanted: &BTreeSet<String>,
    threads: NonZeroUsize,
) -> Result<(BTreeMap<String, Evidence>, Vec<String>), ScoreError> {
    let reader = Reader::of(definitions);
    check_work(traces, &reader.plan)?;
    let projection = projection(traces, &[definitions], &reader.plan, &[])?;
    let (mut found, mut names) = (BTreeMap::new(), Vec::new());
    traces.scan(
        &projection,
        threads,
        |batch| -> Result<_, ScoreError> {
            let ids = episode_ids(&batch);
            let wanted = ids.iter().enumerate().filter(|(_, id)| wanted.contains(*id));
            let explained = wanted.map(|(at, id)| Ok((id.clone(), reader.episode(&batch, at, id)?)));
            let explained =
                explained.collect::<Result<Vec<_>, _>>().map_err(|source| failed(traces, &batch, source))?;
            Ok((explained, ids))
        },
        |(explained, ids)| {
            found.extend(explained);
            names.extend(ids);
            Ok(())
        },
    )?;
    Ok((found, names))
}

/// The plan for the requested metrics and every value that they are built from.
pub(super) struct Reader<'a> {
    definitions: &'a Definitions,
    plan: PhysicalPlan,
    steps: HashMap<NodeId, StepId>,
}

impl<'a> Reader<'a> {
    pub(super) fn of(definitions: &'a Definitions) -> Self {
        let logical = &definitions.plan;
        let nodes = logical.needed_by(logical.outputs.iter().map(|output| output.node));
        let mut plan = PhysicalPlan::default();
        let steps = nodes.iter().copied().zip(plan.add_nodes(logical, nodes.iter().copied())).collect();
        Self { definitions, plan, steps }
    }

    pub(super) fn add_to(&self, plan: &mut PhysicalPlan) {
        let logical = &self.definitions.plan;
        plan.add_nodes(logical, logical.needed_by(logical.outputs.iter().map(|output| output.node)));
    }

    pub(super) fn episode(
        &self,
        batch: &EpisodeBatch,
        episode: usize,
        episode_id: &str,
    ) -> Result<Evidence, EngineError> {
        let (start, end) = (batch.offsets[episode], batch.offsets[episode + 1]);
        let offsets = [0, end - start];
        let segments = Segments::new(&offsets);
        let (steps, episodes) = (batch.steps.slice(start, end - start), batch.episodes.slice(episode, 1));
        let texts: Vec<_> = batch.texts.iter().map(|texts| texts.slice(start, end - start)).collect();
        let values = self.plan.evaluate(&Batch { segments, steps: &steps, texts: &texts, episodes: &episodes })?;
        let reading = Reading { reader: self, values, segments };
        let outputs = self.definitions.plan.outputs.iter();
        let metrics = outputs.map(|output| reading.metric(output)).collect();
        Ok(Evidence { episode_id: episode_id.to_owned(), length: segments.lengths().value(0), metrics })
    }
}

struct Reading<'a> {
    reader: &'a Reader<'a>,
    values: Evaluated,
    segments: Segments<'a>,
}

impl Reading<'_> {
    fn plan(&self) -> &Plan {
        &self.reader.definitions.plan
    }

    fn of(&self, node: NodeId) -> &Vector {
        self.values.of(self.reader.steps[&node])
    }

    fn ty(&self, node: NodeId) -> Type {
        self.plan().node(node).ty
    }

    fn metric(&self, output: &Output) -> MetricEvidence {
        let node = output.node;
        let values = self.of(node);
        let value = values.array().is_valid(0).then(|| match self.ty(node) {
            Type::Bool => i64::from(values.bools().value(0)),
            _ => values.ints().value(0),
        });
        let value = value.map(|value| Decimal::of_units(value.into(), output.decimals.into()));
        let needed = self.plan().needed_by([self.decisive(node)]);
        let truths = self.truths(&needed);
        let fact = |id: NodeId| self.fact(id).or_else(|| truths.contains(&id).then(|| self.truth(id)));
        let facts: Vec<Fact> = needed.iter().filter_map(|id| fact(*id)).collect();
        let timesteps: BTreeSet<i64> = facts.iter().flat_map(|fact| fact.timesteps.iter().copied()).collect();
        MetricEvidence { metric: output.name.clone(), value, timesteps: timesteps.into_iter().collect(), facts }
    }

    fn decisive(&self, node: NodeId) -> NodeId {
        match &self.plan().node(node).op {
            Op::Case { branches, otherwise: None } if branches.len() == 1 => {
                let (when, _) = branches[0];
                if truths(self.of(when).bools()).value(0) { node } else { when }
            }
            _ => node,
        }
    }

    fn fact(&self, id: NodeId) -> Option<Fact> {
        let timesteps = match &self.plan().node(id).op {
            Op::Aggregate(aggregate, operand) => self.deciding(*aggregate, *operand, id),
            Op::At(_, moment) => self.moment(self.of(*moment).ints()).into_iter().collect(),
            _ => return None,
        };
        let expression = self.plan().sources.get(&id).cloned().unwrap_or_default();
        Some(Fact {
            name: self.reader.definitions.name_of(id),
            expression,
            value: self.text(id),
            timesteps,
            is_of_episode: false,
        })
    }

    fn truths(&self, needed: &[NodeId]) -> BTreeSet<NodeId> {
        let pairs = needed.iter().filter_map(|id| match &self.plan().node(*id).op {
            Op::Compare(_, a, b) | Op::Distinct(a, b) => Some([(*a, *b), (*b, *a)]),
            _ => None,
        });
        let varying = pairs.flatten().filter(|(_, other)| !matches!(self.plan().node(*other).op, Op::Constant(_)));
        let unspread = |(id, _)| if let Op::Spread(inner) = self.plan().node(id).op { inner } else { id };
        varying.map(unspread).filter(|id| self.is_of_episode(*id)).collect()
    }

    fn is_of_episode(&self, id: NodeId) -> bool {
        let node = self.plan().node(id);
        node.level == Level::Episode && matches!(node.op, Op::Column(_))
    }

    fn truth(&self, id: NodeId) -> Fact {
        let expression = match &self.plan().node(id).op {
            Op::Column(name) => name.clone(),
            _ => String::new(),
        };
        Fact { name: None, expression, value: self.text(id), timesteps: Vec::new(), is_of_episode: true }
    }

    fn moment(&self, moments: &Int64Array) -> Option<i64> {
        let last = self.segments.lengths().value(0);
        moments.is_valid(0).then(|| moments.value(0)).filter(|t| (1..=last).contains(t))
    }

    fn deciding(&self, aggregate: Aggregate, operand: NodeId, result: NodeId) -> Vec<i64> {
        let (values, result) = (self.of(operand), self.of(result));
        let rows = 0..values.array().len();
        match aggregate {
            Aggregate::First | Aggregate::Last => self.moment(result.ints()).into_iter().collect(),
            Aggregate::Any => self.segments.timesteps(0, values.bools()).into_iter().take(1).collect(),
            Aggregate::Count => self.segments.timesteps(0, values.bools()),
            Aggregate::All => {
                let holds = truths(values.bools());
                rows.filter(|&row| !holds.value(row)).take(1).map(as_t).collect()
            }
            Aggregate::Sum => {
                let counts = |&row: &usize| values.array().is_valid(row) && values.ints().value(row) != 0;
                rows.filter(counts).map(as_t).collect()
            }
            Aggregate::Min | Aggregate::Max => {
                let equal = |row| match self.ty(operand) {
                    Type::Float => values.floats().value(row).to_bits() == result.floats().value(0).to_bits(),
                    _ => values.ints().value(row) == result.ints().value(0),
                };
                rows.filter(|&row| values.array().is_valid(row) && equal(row)).take(1).map(as_t).collect()
            }
        }
    }

    fn text(&self, id: NodeId) -> Option<String> {
        let values = self.of(id);
        values.array().is_valid(0).then(|| match self.ty(id) {
            Type::Bool => values.bools().value(0).to_string(),
            Type::Int => values.ints().value(0).to_string(),
            Type::Float => values.floats().value(0).to_string(),
            Type::Text => self.values.text(values.symbols().value(0)).to_owned(),
        })
    }
}

fn as_t(row: usize) -> i64 {
    i64::try_from(row).map_or(i64::MAX, |row| row + 1)
}

pub fn ranges(timesteps: &[i64]) -> String {
    let run = |run: &[i64]| match run {
        [first, .., last] => format!("{first}-{last}"),
        one => one.first().map_or_else(String::new, ToString::to_string),
    };
    timesteps.chunk_by(|a, b| a + 1 == *b).map(run).collect::<Vec<_>>().join(", ")
}

fn decided(timesteps: &[i64]) -> String {
    if timesteps.is_empty() { "no step".to_owned() } else { format!("t = {}", ranges(timesteps)) }
}

impl fmt::Display for Evidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", visible(&self.episode_id), counted(self.length.unsigned_abs(), "step"))?;
        for metric in &self.metrics {
            let value = metric.value.map_or_else(|| "undefined".to_owned(), |value| value.to_string());
            write!(f, "\n\n{} = {value}   decided at {}", metric.metric, decided(&metric.timesteps))?;
            for fact in &metric.facts {
                let value = fact.value.as_deref().unwrap_or("null");
                let name = fact.name.as_ref().map_or_else(String::new, |name| format!("{name} = "));
                write!(f, "\n  {name}{} is {}", visible(&fact.expression), visible(value))?;
                if !fact.is_of_episode {
                    write!(f, "   ({})", decided(&fact.timesteps))?;
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::ranges;

    #[test]
    fn timesteps_print_as_ranges() {
        for (timesteps, expected) in [(&[][..], ""), (&[4], "4"), (&[1, 2, 3], "1-3"), (&[1, 3, 4, 9], "1, 3-4, 9")] {
            assert_eq!(ranges(timesteps), expected);
        }
    }
}

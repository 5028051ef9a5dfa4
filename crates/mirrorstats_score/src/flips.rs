//! Two definitions over the same traces: both tables, and the timesteps that decided each difference, in one scan.

use std::collections::BTreeMap;
use std::num::NonZeroUsize;

use arrow::array::{ArrayRef, BooleanArray};
use arrow::compute::cast;
use arrow::compute::kernels::{boolean, cmp};
use arrow::datatypes::DataType;

use super::error::{EngineError, ScoreError};
use super::evidence::{Evidence, Reader};
use super::kernels::evaluate::{BatchScores, Evaluated};
use super::kernels::segments::truths;
use super::physical::{Metric, PhysicalPlan, Scores};
use super::score_traces::{collect, header, projection, view};
use super::tables::builder::episode_ids;
use super::tables::table::EpisodeTable;
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::scan::EpisodeBatch;

#[derive(Clone, Debug)]
pub struct ScoredPair {
    pub tables: [EpisodeTable; 2],
    /// For each definitions, the steps that decided the differing metrics, by episode. Only episodes with a difference
    /// that both filters keep are listed.
    pub evidence: [BTreeMap<String, Evidence>; 2],
}

/// Scores all episodes of some traces under two definitions, and explains each episode in which they differ.
pub fn score_pair(
    traces: &TraceSet,
    definitions: [&Definitions; 2],
    labels: &[String],
    threads: NonZeroUsize,
) -> Result<ScoredPair, ScoreError> {
    let plan = PhysicalPlan::of(&definitions.map(|definitions| &definitions.plan));
    let candidates = Candidates::of(&plan);
    let [old, new] = definitions.map(|definitions| candidates.alone(definitions));
    let readers = [Reader::of(&old), Reader::of(&new)];
    let mut wide = plan.clone();
    for reader in &readers {
        reader.add_to(&mut wide);
    }
    let projection = projection(traces, &definitions, &wide, labels)?;
    let headers = definitions.map(|definitions| header(definitions, labels)).into();
    let mut evidence = [BTreeMap::new(), BTreeMap::new()];
    let tables = collect(
        traces,
        &projection,
        headers,
        threads,
        |batch| {
            let values = plan.evaluate(&view(batch))?;
            let scores = plan.scores.iter().map(|scores| values.scores(scores)).collect::<Result<Vec<_>, _>>()?;
            let explained = candidates.explained(batch, &values, &scores, &readers)?;
            Ok((scores, explained))
        },
        |explained| {
            for (side, explained) in evidence.iter_mut().zip(explained) {
                side.extend(explained.into_iter().map(|episode| (episode.episode_id.clone(), episode)));
            }
        },
    )?;
    let tables = tables.try_into().expect("a table per header");
    Ok(ScoredPair { tables, evidence })
}

/// The metrics that both definitions have but compute in different steps; equal steps give equal values.
struct Candidates {
    sides: [Scores; 2],
}

impl Candidates {
    fn of(plan: &PhysicalPlan) -> Self {
        let [old, new] = plan.scores.as_slice() else { unreachable!("the plan has two sets of definitions") };
        let differs = |old: &&Metric, new: &&Metric| old.name == new.name && old.step != new.step;
        let pairs =
            new.metrics.iter().filter_map(|new| Some((old.metrics.iter().find(|old| differs(old, &new))?, new)));
        let (old, new) = pairs.map(|(old, new)| (old.clone(), new.clone())).unzip();
        Self { sides: [old, new].map(|metrics| Scores { metrics, filter: None }) }
    }

    fn alone(&self, definitions: &Definitions) -> Definitions {
        let mut alone = definitions.clone();
        alone.plan.outputs.retain(|output| self.sides[0].metrics.iter().any(|metric| metric.name == output.name));
        alone.plan.filter = None;
        alone
    }

    fn explained(
        &self,
        batch: &EpisodeBatch,
        values: &Evaluated,
        scores: &[BatchScores],
        readers: &[Reader<'_>; 2],
    ) -> Result<[Vec<Evidence>; 2], EngineError> {
        let Some(differs) = self.differs(values)? else { return Ok([Vec::new(), Vec::new()]) };
        let kept = scores.iter().filter_map(|scores| scores.kept.as_ref());
        let wanted = kept.fold(differs.values().clone(), |wanted, kept| &wanted & &truths(kept));
        if wanted.count_set_bits() == 0 {
            return Ok([Vec::new(), Vec::new()]);
        }
        let ids = episode_ids(batch);
        let of_side = |reader: &Reader<'_>| -> Result<Vec<Evidence>, EngineError> {
            wanted.set_indices().map(|row| reader.episode(batch, row, &ids[row])).collect()
        };
        Ok([of_side(&readers[0])?, of_side(&readers[1])?])
    }

    /// For each episode, true if some metric differs; `None` if no metric can differ.
    fn differs(&self, values: &Evaluated) -> Result<Option<BooleanArray>, EngineError> {
        let [old, new] = [values.scores(&self.sides[0])?, values.scores(&self.sides[1])?];
        let pairs = old.metrics.iter().zip(&new.metrics);
        Ok(pairs
            .map(|(old, new)| distinct(old, new))
            .reduce(|some, more| boolean::or(&some, &more).expect("both have a value per episode")))
    }
}

/// True where the values of two columns of truth values or integers differ; null is an ordinary value.
fn distinct(old: &ArrayRef, new: &ArrayRef) -> BooleanArray {
    let ints = |column: &ArrayRef| cast(column, &DataType::Int64).expect("truth values and integers become integers");
    cmp::distinct(&ints(old), &ints(new)).expect("both are integers of the same length")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::explain_each;
    use crate::score_traces::{Request, definitions, score};
    use crate::vocabulary::trace_columns;
    use mirrorstats_trace::inputs;

    #[test]
    fn one_scan_gives_both_tables_and_the_evidence_of_differences() {
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
        let inputs = inputs::resolve(&[format!("{root}/fixtures/paper").into()], std::io::empty()).unwrap();
        let traces = TraceSet::open(&inputs).unwrap();
        let inclusive = format!("{root}/examples/definitions/inclusive.toml");
        let [old, new] = ["paper", &inclusive].map(|name| definitions(&traces, &Request::of(name)).unwrap());
        let threads = NonZeroUsize::new(2).unwrap();
        let pair = score_pair(&traces, [&old, &new], &[], threads).unwrap();
        let columns = trace_columns(&traces);
        let filtered = [&old, &new].map(|all| all.clone().filtered("--where", "seed = 1", &columns).unwrap());
        let kept = score_pair(&traces, [&filtered[0], &filtered[1]], &[], threads).unwrap();
        let of_seed = |id: &str| pair.tables[0].keys.iter().any(|key| key.episode_id == id && key.seed == 1);
        for (kept, all) in kept.evidence.iter().zip(&pair.evidence) {
            assert!(kept.iter().eq(all.iter().filter(|(id, _)| of_seed(id))) && kept.len() < all.len());
        }
        for (table, definitions) in pair.tables.iter().zip([&old, &new]) {
            assert_eq!(*table, score(&traces, definitions, &[], threads).unwrap());
        }
        let row = |table: &EpisodeTable, row| table.metrics.iter().map(|metric| metric.get(row)).collect::<Vec<_>>();
        let [before, after] = &pair.tables;
        let differ = (0..before.len()).filter(|at| row(before, *at) != row(after, *at));
        let ids: std::collections::BTreeSet<String> =
            differ.map(|at| before.keys.get(at).episode_id.to_owned()).collect();
        assert!(ids.len() > 3, "the definitions differ on this data");
        for (evidence, definitions) in pair.evidence.iter().zip([&old, &new]) {
            assert!(evidence.keys().eq(&ids));
            let whole = explain_each(&traces, definitions, &ids, threads).unwrap();
            for (id, evidence) in evidence {
                let same = |metric| whole[id].metrics.iter().any(|whole| whole == metric);
                assert!(!evidence.metrics.is_empty() && evidence.metrics.iter().all(same), "{id}");
            }
        }
    }
}

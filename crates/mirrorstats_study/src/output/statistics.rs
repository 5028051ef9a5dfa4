//! Statistics of a study: each verdict gets the declared design, the exclusions and the declarations.

use std::collections::{BTreeMap, BTreeSet};

use mirrorstats_analysis::plan::departures::Looks;
use mirrorstats_analysis::statistics::{Options, Selection, Sequential, Statistics};
use mirrorstats_exact::budget::Limit;
use mirrorstats_metric::names::is_about;
use mirrorstats_score::cells::Cells;
use mirrorstats_score::tables::lost_counts::LostCounts;
use mirrorstats_score::tables::table::{CONDITION, EpisodeTable};
use mirrorstats_score::vocabulary;
use mirrorstats_statistics::design::{Cluster, Design, DesignKind};
use mirrorstats_trace::beside::labels;
use mirrorstats_trace::footers::declared::{self, Declared, Origin};

use crate::losses::Counted;
use crate::{LostAs, Study, StudyError, pooled};

impl Study {
    /// The filter. It depends on results if it uses more than the values recorded before an episode begins.
    pub(crate) fn selection(&self, episodes: &EpisodeTable) -> Option<Selection> {
        let condition = self.question.filter.clone()?;
        // A coder has seen the outcome.
        let is_recorded = |name: &str| episodes.label(name).is_some() && !name.starts_with(labels::PREFIX);
        let is_key = |name: &str| is_recorded(name) || vocabulary::is_constant(name);
        let by_results = !is_about(&condition, &is_key);
        Some(Selection { condition, by_results })
    }

    /// The statistics of the cells: intervals, tests, comparisons. Errors: as [`Study::score`]; sums of squares beyond
    /// 128 bits.
    pub fn statistics(&self, options: &Options) -> Result<Statistics, StudyError> {
        let counted = self.counted_scores()?;
        let cells = self.cells_of(&counted.results.episodes)?;
        self.statistics_of(&counted, &cells, options)
    }

    fn counted_scores(&self) -> Result<Counted, StudyError> {
        let results = self.score()?;
        self.check_filter(results.episodes.len())?;
        Ok(self.counted(results))
    }

    pub(crate) fn pooled(&self, episodes: &EpisodeTable) -> Result<Option<Vec<String>>, StudyError> {
        self.question.pool.then(|| pooled::told(episodes, &self.question.by_over(episodes))).transpose()
    }

    pub(crate) fn undecided(&self, lost: &LostCounts) -> LostCounts {
        if self.question.lost == LostAs::Nothing { lost.clone() } else { LostCounts::default() }
    }

    pub(crate) fn statistics_of(
        &self,
        counted: &Counted,
        cells: &Cells,
        options: &Options,
    ) -> Result<Statistics, StudyError> {
        let Counted { results, lost, .. } = counted;
        let declared = &results.episodes.declared;
        let (is_known, total) = (results.lost.is_some() || declared.losses_recorded || !lost.is_empty(), lost.total());
        let beside = self.undecided(lost);
        let (design, selection) = (design_of(declared), self.selection(&results.episodes));
        let replies = counted.replies();
        let lost = is_known.then_some(beside);
        let failures = (self.question.lost == LostAs::Failure && total > 0).then_some(total);
        let as_failures = failures.map(|total| format!("{total} lost episodes counted as failures"));
        let primary = self.plan.as_ref().and_then(|plan| plan.primary.clone());
        let pooled = self.pooled(&results.episodes)?;
        let mut options = Options { lost, design, selection, pooled, replies, primary, ..options.clone() };
        let departures = self.departures(&results.episodes, &options, Looks::Once);
        let departed = departures.as_ref().map_or(0, Vec::len);
        let departed = (departed > 0).then(|| format!("departures from the registered plan: {departed}"));
        let copies = self.copies(&results.episodes)?;
        let copy_phrase = copies.as_ref().map(|copies| copies.phrase.clone());
        options.caveats = as_failures.into_iter().chain(departed).chain(copy_phrase).collect();
        let mut statistics = Statistics::from_table(&results.episodes, cells, &options)?;
        statistics.departures = departures;
        if let Some(total) = failures {
            let words = format!("{total} lost episodes are counted as failures in every rate that each episode has.");
            statistics.warnings.push(words);
        }
        statistics.warnings.extend(copies.map(|copies| copies.sentence));
        statistics.warnings.extend(self.stale_checksums());
        Ok(statistics)
    }

    /// Statistics for a study in progress: confidence sequences and e-values.
    pub fn sequential(&self, options: &Options) -> Result<Sequential, StudyError> {
        let episodes = self.counted_scores()?.results.episodes;
        check_comparisons(&episodes)?;
        let (design, selection) = (design_of(&episodes.declared), self.selection(&episodes));
        let options = Options { design, selection, pooled: self.pooled(&episodes)?, ..options.clone() };
        let departures = self.departures(&episodes, &options, Looks::Any);
        Ok(Sequential { departures, ..Sequential::from_table(&episodes, &options)? })
    }
}

pub(crate) fn design_of(declared: &Declared) -> Design {
    let kind = |origin| match origin {
        Origin::Recording => DesignKind::Recording,
        Origin::Import => DesignKind::Import,
        Origin::Reconstruction => DesignKind::Reconstruction,
    };
    let cluster = |cluster| match cluster {
        declared::Cluster::Seed => Cluster::Seed,
    };
    Design { kind: declared.origin.map(kind), cluster: declared.cluster.map(cluster) }
}

/// Every pair of models is compared, so a report grows with the square of the number of models, while the traces grow
/// linearly. A hundred models in five experiments under ten metrics are 247,500; a comparison takes half a kilobyte.
const MOST_COMPARISONS: Limit =
    Limit::new("comparisons of two models under a metric; leave models or metrics out", 400_000);

pub(crate) fn check_comparisons(episodes: &EpisodeTable) -> Result<(), StudyError> {
    let pairs = |count: u64| count.saturating_mul(count.saturating_sub(1)) / 2;
    let pairs = subjects(episodes).into_iter().map(pairs).fold(0, u64::saturating_add);
    Ok(MOST_COMPARISONS.check(pairs.saturating_mul(episodes.metrics.len() as u64))?)
}

/// 50,000 cells of five episodes took 3 s of processor time and 307 MB in a release build.
const MOST_VERDICTS: Limit = Limit::new("cells of a gate; choose some with --where", 50_000);

pub(crate) fn check_verdicts(episodes: &EpisodeTable) -> Result<(), StudyError> {
    Ok(MOST_VERDICTS.check(subjects(episodes).into_iter().sum())?)
}

/// The models with their conditions in each experiment.
fn subjects(episodes: &EpisodeTable) -> Vec<u64> {
    let conditions = episodes.label(CONDITION);
    let mut subjects = BTreeMap::<_, BTreeSet<_>>::new();
    for row in 0..episodes.len() {
        let subject = (episodes.keys.models().code(row), conditions.and_then(|conditions| conditions.get(row)));
        subjects.entry(episodes.keys.experiments().code(row)).or_default().insert(subject);
    }
    subjects.values().map(|subjects| subjects.len() as u64).collect()
}

//! Statistics of a study: each verdict gets the exclusions and declarations.

use ::report::cells::Cells;
use ::report::plan::departures::Looks;
use ::report::statistics::{Options, Replies, Selection, Sequential, Statistics};
use metric::names::is_about;
use score::lost_counts::LostCounts;
use score::table::EpisodeTable;
use score::vocabulary;
use trace::labels;

use crate::design::design_of;
use crate::losses::Counted;
use crate::results::Outputs;
use crate::{LostAs, Study, StudyError, pooled, size};

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

    /// The statistics of the cells: intervals, tests, comparisons.
    ///
    /// # Errors
    /// As [`Study::score`]; sums of squares beyond 128 bits.
    pub fn statistics(&self, options: &Options) -> Result<Statistics, StudyError> {
        let results = self.scan(Outputs { losses: true, ..Outputs::default() })?;
        self.check_filter(results.episodes.len())?;
        let counted = self.counted(results);
        let cells = self.cells_of(&counted.results.episodes)?;
        self.statistics_of(&counted, &cells, options)
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
        let replies = Replies::of(counted.all.as_ref().unwrap_or(&results.episodes));
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
        let mut statistics = Statistics::of(&results.episodes, cells, &options)?;
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
        let results = self.scan(Outputs { losses: true, ..Outputs::default() })?;
        self.check_filter(results.episodes.len())?;
        let episodes = self.counted(results).results.episodes;
        size::check_comparisons(&episodes)?;
        let (design, selection) = (design_of(&episodes.declared), self.selection(&episodes));
        let options = Options { design, selection, pooled: self.pooled(&episodes)?, ..options.clone() };
        let departures = self.departures(&episodes, &options, Looks::Any);
        Ok(Sequential { departures, ..Sequential::of(&episodes, &options)? })
    }
}

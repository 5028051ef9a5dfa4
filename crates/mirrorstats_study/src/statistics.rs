//! Statistics of a study: each verdict gets the declared design, the exclusions and the declarations.

use std::collections::{BTreeMap, BTreeSet};

use mirrorstats_analysis::plan::departures::Looks;
use mirrorstats_analysis::statistics::{Options, Sequential, Statistics};
use mirrorstats_exact::budget::Limit;
use mirrorstats_score::tables::table::{CONDITION, EpisodeTable};

use crate::caveats::{departed, design_of, pooled_cells, selection, undecided};
use crate::copies::copies;
use crate::grouped::Grouped;
use crate::losses::{Counted, LostAs};
use crate::{Study, StudyError};

/// The statistics of the cells: intervals, tests, comparisons. Errors: sums of squares beyond 128 bits.
pub fn statistics(grouped: &Grouped<'_>, options: &Options) -> Result<Statistics, StudyError> {
    let Grouped { study, counted, cells } = grouped;
    let Counted { results, lost, .. } = counted;
    let (episodes, total) = (&results.episodes, lost.total());
    let is_known = results.lost.is_some() || episodes.declared.losses_recorded || !lost.is_empty();
    let failures = (study.question.lost == LostAs::Failure && total > 0).then_some(total);
    let mut options = Options {
        lost: is_known.then(|| undecided(study, lost)),
        design: design_of(&episodes.declared),
        selection: selection(study, episodes),
        pooled: pooled_cells(study, episodes)?,
        replies: counted.replies(),
        primary: study.plan.as_ref().and_then(|plan| plan.primary.clone()),
        ..options.clone()
    };
    let departures = departed(study, episodes, &options, Looks::Once);
    let count = departures.as_ref().map_or(0, Vec::len);
    let copies = copies(study, results)?;
    let as_failures = failures.map(|total| format!("{total} lost episodes counted as failures"));
    let departed = (count > 0).then(|| format!("departures from the registered plan: {count}"));
    let caveat = copies.as_ref().map(|copies| copies.phrase.clone());
    options.caveats = as_failures.into_iter().chain(departed).chain(caveat).collect();
    let mut statistics = Statistics::from_table(episodes, cells, &options)?;
    statistics.departures = departures;
    let as_failures = failures
        .map(|total| format!("{total} lost episodes are counted as failures in every rate that each episode has."));
    statistics
        .warnings
        .extend(as_failures.into_iter().chain(copies.map(|copies| copies.sentence)).chain(study.stale_checksums()));
    Ok(statistics)
}

/// Statistics for a study in progress: confidence sequences and e-values. Errors: as [`Study::score`]; a filter that
/// keeps no episode.
pub fn sequential(study: &Study, options: &Options) -> Result<Sequential, StudyError> {
    let results = study.score()?;
    study.check_filter(results.episodes.len())?;
    let episodes = Counted::of(results, study.question.lost).results.episodes;
    check_comparisons(&episodes)?;
    let (design, selection) = (design_of(&episodes.declared), selection(study, &episodes));
    let options = Options { design, selection, pooled: pooled_cells(study, &episodes)?, ..options.clone() };
    let departures = departed(study, &episodes, &options, Looks::Any);
    Ok(Sequential { departures, ..Sequential::from_table(&episodes, &options)? })
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

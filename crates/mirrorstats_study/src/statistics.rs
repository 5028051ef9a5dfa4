//! Statistics of a study: each verdict gets the declared design, the exclusions and the declarations.

use mirrorstats_analysis::plan::departures::Looks;
use mirrorstats_analysis::statistics::{DesignAudit, Options, Sequential, Statistics};

use crate::caveats::{departed, design_of, pooled_cells, selection, undecided};
use crate::copies::{Copies, copies, suspected};
use crate::losses::{Counted, LostAs};
use crate::results::Outputs;
use crate::study::Grouped;
use crate::{Study, StudyError};

/// The statistics of the cells: intervals, tests, comparisons. Errors: sums of squares beyond 128 bits.
pub fn statistics(grouped: &Grouped<'_>, asked: &Options) -> Result<Statistics, StudyError> {
    let Grouped { study, counted, cells } = grouped;
    let episodes = &counted.results.episodes;
    let Context { options, departures, failures, copies } = Context::of(study, counted, asked, Looks::Once)?;
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
pub fn sequential(study: &Study, asked: &Options) -> Result<Sequential, StudyError> {
    let results = study.scan(Outputs { copy_candidates: true, design: true, ..Outputs::default() })?;
    study.check_filter(results.episodes.len())?;
    let counted = Counted::of(results, study.question.lost);
    study.cells_of(&counted.results.episodes)?;
    let Context { options, departures, .. } = Context::of(study, &counted, asked, Looks::Any)?;
    Ok(Sequential { departures, ..Sequential::from_table(&counted.results.episodes, &options)? })
}

/// The design audit of a study. Errors: as of its statistics.
pub fn design_audit(grouped: &Grouped<'_>) -> Result<DesignAudit, StudyError> {
    let Grouped { study, counted, .. } = grouped;
    let Context { options, .. } = Context::of(study, counted, &Options::default(), Looks::Once)?;
    Ok(DesignAudit::from_table(&counted.results.episodes, &options)?)
}

/// The context of every verdict: the same for all statistics.
struct Context {
    options: Options,
    departures: Option<Vec<String>>,
    /// The lost episodes that count as failures.
    failures: Option<u64>,
    copies: Option<Copies>,
}

impl Context {
    fn of(study: &Study, counted: &Counted, asked: &Options, looks: Looks) -> Result<Self, StudyError> {
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
            ..asked.clone()
        };
        let departures = departed(study, episodes, &options, looks);
        let count = departures.as_ref().map_or(0, Vec::len);
        let copies = copies(study, results)?;
        let as_failures = failures.map(|total| format!("{total} lost episodes counted as failures"));
        let departed = (count > 0).then(|| format!("departures from the registered plan: {count}"));
        let exact = copies.as_ref().map(|it| it.phrase.clone());
        options.caveats = as_failures.into_iter().chain(departed).collect();
        options.copies = exact.into_iter().chain(suspected(study, results)?).collect();
        Ok(Self { options, departures, failures, copies })
    }
}

//! Caveats of answers: the filter, pooled cells, lost episodes, the declared design, departures from a registered plan.

use mirrorstats_analysis::plan::departures::{Looks, departures};
use mirrorstats_analysis::statistics::{Options, Selection};
use mirrorstats_metric::names::is_about;
use mirrorstats_score::cells::group::GroupError;
use mirrorstats_score::tables::lost_counts::LostCounts;
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_score::vocabulary;
use mirrorstats_statistics::design::{Cluster, Design, DesignKind};
use mirrorstats_trace::beside::labels;
use mirrorstats_trace::footers::declared::{self, Declared, Origin};

use crate::losses::LostAs;
use crate::{Study, pooled};

/// The filter. It depends on results if it uses more than the values recorded before an episode begins.
pub(crate) fn selection(study: &Study, episodes: &EpisodeTable) -> Option<Selection> {
    let condition = study.question.filter.clone()?;
    // A coder has seen the outcome.
    let is_recorded = |name: &str| episodes.label(name).is_some() && !name.starts_with(labels::PREFIX);
    let is_key = |name: &str| is_recorded(name) || vocabulary::is_constant(name);
    let by_results = !is_about(&condition, &is_key);
    Some(Selection { condition, by_results })
}

/// The departures from the registered plan; `None` without a plan.
pub(crate) fn departed(study: &Study, episodes: &EpisodeTable, options: &Options, looks: Looks) -> Option<Vec<String>> {
    Some(departures(study.plan.as_ref()?, episodes, options, looks))
}

pub(crate) fn pooled_cells(study: &Study, episodes: &EpisodeTable) -> Result<Option<Vec<String>>, GroupError> {
    study.question.pool.then(|| pooled::mixtures(episodes, &study.question.by_over(episodes))).transpose()
}

/// The lost episodes that no denominator has.
pub(crate) fn undecided(study: &Study, lost: &LostCounts) -> LostCounts {
    if study.question.lost == LostAs::Nothing { lost.clone() } else { LostCounts::default() }
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

//! Limits on answers that may grow faster than their inputs.

use std::collections::{BTreeMap, BTreeSet};

use mirrorstats_exact::budget::{Exceeded, Limit};
use mirrorstats_score::tables::table::{CONDITION, EpisodeTable};

/// Every pair of models is compared, so a report grows with the square of the number of models, while the traces grow
/// linearly. A hundred models in five experiments under ten metrics are 247,500; a comparison takes half a kilobyte.
const MOST_COMPARISONS: Limit =
    Limit::new("comparisons of two models under a metric; leave models or metrics out", 400_000);

/// 50,000 cells of five episodes took 3 s of processor time and 307 MB in a release build.
const MOST_VERDICTS: Limit = Limit::new("cells of a gate; choose some with --where", 50_000);

pub(crate) fn check_comparisons(episodes: &EpisodeTable) -> Result<(), Exceeded> {
    let pairs = |count: u64| count.saturating_mul(count.saturating_sub(1)) / 2;
    let pairs = subjects(episodes).into_iter().map(pairs).fold(0, u64::saturating_add);
    MOST_COMPARISONS.check(pairs.saturating_mul(episodes.metrics.len() as u64))
}

pub(crate) fn check_verdicts(episodes: &EpisodeTable) -> Result<(), Exceeded> {
    MOST_VERDICTS.check(subjects(episodes).into_iter().sum())
}

fn subjects(episodes: &EpisodeTable) -> Vec<u64> {
    let conditions = episodes.label(CONDITION);
    let mut subjects = BTreeMap::<_, BTreeSet<_>>::new();
    for row in 0..episodes.len() {
        let subject = (episodes.keys.model.code(row), conditions.and_then(|conditions| conditions.get(row)));
        subjects.entry(episodes.keys.experiment.code(row)).or_default().insert(subject);
    }
    subjects.values().map(|subjects| subjects.len() as u64).collect()
}

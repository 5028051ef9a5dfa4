//! Limits the size of a report. Every pair of models is compared, so a report grows with the square of the number of
//! models, while the traces grow linearly.

use std::collections::{BTreeMap, BTreeSet};

use super::error::StudyError;
use exact::budget::Limit;
use score::table::{CONDITION, EpisodeTable};

/// A hundred models in five experiments under ten metrics are 247,500; a comparison takes half a kilobyte.
const MOST_COMPARISONS: Limit =
    Limit::new("comparisons of two models under a metric; leave models or metrics out", 400_000);

pub(super) fn check_comparisons(episodes: &EpisodeTable) -> Result<(), StudyError> {
    let conditions = episodes.label(CONDITION);
    let mut subjects = BTreeMap::<_, BTreeSet<_>>::new();
    for row in 0..episodes.len() {
        let subject = (episodes.keys.models().code(row), conditions.and_then(|conditions| conditions.get(row)));
        subjects.entry(episodes.keys.experiments().code(row)).or_default().insert(subject);
    }
    let pairs = |count: usize| (count as u64).saturating_mul(count.saturating_sub(1) as u64) / 2;
    let pairs = subjects.values().fold(0_u64, |sum, subjects| sum.saturating_add(pairs(subjects.len())));
    Ok(MOST_COMPARISONS.check(pairs.saturating_mul(episodes.metrics.len() as u64))?)
}

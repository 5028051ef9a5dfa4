//! Published values that no episodes can explain.

use super::published::{Pair, Print, Value};

/// A metric whose printed values cannot all be true, given what is already known of the pair.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{experiment}, {model}, {metric}: published {published}; {because}")]
pub struct Contradiction {
    /// `E1`..`E5`.
    pub experiment: String,
    /// The model as tables name it.
    pub model: String,
    /// The metric or metrics that cannot be met.
    pub metric: String,
    /// The published text of the metric.
    pub published: String,
    /// The broken condition.
    pub because: String,
}

impl Contradiction {
    /// A contradiction in a metric of this pair.
    pub fn new(pair: &Pair, metric: &str, because: impl Into<String>) -> Self {
        let published: Vec<String> = pair.prints(metric).iter().map(shown).collect();
        Self {
            experiment: pair.experiment.clone(),
            model: pair.model.clone(),
            metric: metric.to_owned(),
            published: published.join(" and "),
            because: because.into(),
        }
    }
}

fn shown(print: &Print) -> String {
    let place = format!("{:?}", print.source).to_lowercase();
    match &print.value {
        Some(Value { mean, se }) => format!("{mean} ± {se} ({place})"),
        None => format!("-- ({place})"),
    }
}

//! The filter that selected the episodes.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use exact::escape::visible;

/// A filter over episodes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Selection {
    /// The condition, as typed.
    pub condition: String,
    /// True if it depends on what the agents did, and not on what was recorded alone.
    pub by_results: bool,
}

impl Selection {
    pub(super) fn phrase(&self) -> String {
        let condition = visible(&self.condition);
        if self.by_results {
            format!("episodes chosen by their results: `{condition}`")
        } else {
            format!("only episodes where `{condition}`")
        }
    }

    /// The sentence beside tables and conclusions.
    pub fn sentence(&self) -> String {
        let chosen = if self.by_results {
            "; the filter chose them by their results, so no number here is about a model as such: a guesser's correct \
             episodes are all correct"
        } else {
            ""
        };
        format!("Only episodes where `{}`{chosen}.", visible(&self.condition))
    }
}

//! Where a replay and its trace part ways.

/// Where a replay and its trace part ways.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, schemars::JsonSchema)]
pub struct Divergence {
    /// The episode.
    pub episode_id: String,
    /// The step; 0 for what holds for the episode.
    pub t: i32,
    /// The column.
    pub column: String,
    /// What the trace has.
    pub expected: String,
    /// What the replay gives.
    pub found: String,
}

//! The first difference between a replay and its trace.

/// The first difference between a replay and its trace.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, schemars::JsonSchema)]
pub struct Divergence {
    /// The episode.
    pub episode_id: String,
    /// The step; 0 for what holds for the episode.
    pub t: i32,
    /// The column.
    pub column: String,
    /// The value in the trace.
    pub expected: String,
    /// The value of the replay.
    pub found: String,
}

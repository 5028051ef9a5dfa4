use std::path::{Path, PathBuf};

use mirrorstats_exact::budget::Exceeded;
use mirrorstats_sim::scene::SCENE_VERSION;

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

#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    #[error(
        "the trace does not say how its world was made (no `world` in the metadata `mirrorstats.recording`)\n  help: traces of `mirrorstats record` do"
    )]
    NoRecipe,
    #[error("the world's configuration in the trace cannot be read: {0}")]
    Recipe(String),
    #[error(
        "the world's configuration in the trace is not the one it was recorded with: expected the hash {expected}, found {found}"
    )]
    Changed { expected: String, found: String },
    #[error(
        "the trace's worlds were drawn by version {found} of the scenes, and this program draws version {SCENE_VERSION}\n  help: replay it with the program that recorded it"
    )]
    Scenes { found: String },
    #[error("episode `{episode}`: {fault}")]
    World { episode: String, fault: String },
    #[error("no trace has the episode `{0}`; `mirrorstats trace info --episodes` lists the episodes")]
    NoEpisode(String),
    #[error("`{episode}` has no frame of step {t}")]
    NoFrame { episode: String, t: i32 },
    #[error("the frame of step {0} is no PNG")]
    NotPng(i32),
    #[error("the frame of step {0}: {1}")]
    Frame(i32, Exceeded),
    #[error(
        "the episode cannot be rendered again: at t = {} `{}` was {}, and is {} now; take its log",
        _0.t, _0.column, _0.expected, _0.found
    )]
    Diverged(Divergence),
    #[error(
        "`{}`, episode `{episode}`: {fault}\n  help: the log is damaged or was changed: restore it, or render the episode from its trace",
        log.display()
    )]
    InLog { log: PathBuf, episode: String, fault: String },
    #[error(
        "episode `{episode}`: `{trace}` and `{}` do not belong together: expected rows with the hash {traced}, as in the trace, found {logged}\n  help: name the right one, or move the other one away",
        log.display()
    )]
    Apart { episode: String, trace: String, traced: String, log: PathBuf, logged: String },
    #[error("`{trace}`: {fault}")]
    InTrace { trace: String, fault: Box<Self> },
    /// An error of a trace, a log, the world or the disk.
    #[error(transparent)]
    Other(#[from] Box<dyn std::error::Error + Send + Sync>),
}

impl ReplayError {
    /// A trace and a log with different hashes of an episode's rows.
    pub fn apart(episode: &str, (trace, traced): (&str, &str), (log, logged): (&Path, &str)) -> Self {
        let [episode, trace, traced, logged] = [episode, trace, traced, logged].map(str::to_owned);
        Self::Apart { episode, trace, traced, log: log.to_owned(), logged }
    }

    pub fn other(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        Self::Other(error.into())
    }
}

//! Domains: which columns of the schema mean something in a trace.
//!
//! Every domain has identity and time. The columns of the mirror's world are names like any other elsewhere.

use serde_json::Value;

use super::{Column, Kind, column};
use crate::read::open::FileColumn;

/// The subject of a trace's episodes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Domain {
    /// Embodied agents before a mirror: the whole schema holds.
    #[default]
    Mirror,
    /// Anything else: identity and time, and the columns of the file's own.
    Own,
}

/// The name of the mirror's domain.
pub const MIRROR: &str = "mirror";

/// The columns that every trace has, whatever its domain.
const IDENTITY: [&str; 6] = ["episode_id", "model", "experiment", "seed", "run", "t"];

/// Columns that mean the same in every domain where they have the schema's type.
const GENERAL: [&str; 10] = [
    "condition",
    "scene",
    "repetition",
    "fingerprint",
    "participant",
    "episode_hash",
    "latency_ms",
    "prompt_tokens",
    "completion_tokens",
    "cost_usd",
];

/// Columns that a trace of the mirror's domain has and no other one: a file without any of them is about something else.
const MARKS: [&str; 4] = ["body_color", "self_color", "selected_cube", "mirror_visible"];

impl Domain {
    /// The domain of a file with these columns: its recording names it. Where it does not, a file with an identity and without
    /// any column of the mirror is of its own domain, and all others are traces of the mirror, damaged ones too.
    pub(crate) fn of_file(columns: &[FileColumn], recording: Option<&str>) -> Self {
        let recording: Option<Value> = recording.and_then(|text| serde_json::from_str(text).ok());
        if let Some(name) = recording.as_ref().and_then(|recording| recording["domain"].as_str()) {
            return Self::named(name);
        }
        let has = |name: &&str| columns.iter().any(|column| column.name == *name);
        if IDENTITY.iter().all(has) && !MARKS.iter().any(has) { Self::Own } else { Self::Mirror }
    }

    /// The domain of this name.
    pub fn named(name: &str) -> Self {
        if name == MIRROR { Self::Mirror } else { Self::Own }
    }

    /// Returns true if the schema's column means something here.
    pub fn has(self, column: &Column) -> bool {
        self == Self::Mirror || is_general(column.name)
    }

    /// The schema's column of this name, in this domain.
    pub fn column(self, name: &str) -> Option<&'static Column> {
        column(name).filter(|column| self.has(column))
    }
}

/// A column that definitions of their own domain declare.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeclaredColumn {
    pub name: String,
    pub kind: Kind,
    /// The only texts that it holds, null apart; any if empty.
    pub values: Vec<String>,
    /// True if it is the same in all rows of an episode.
    pub constant: bool,
}

/// Returns true if every trace has the column, whatever its domain.
pub fn is_identity(name: &str) -> bool {
    IDENTITY.contains(&name)
}

/// Returns true if a column of the schema is that of every domain.
pub fn is_general(name: &str) -> bool {
    IDENTITY.contains(&name) || GENERAL.contains(&name)
}

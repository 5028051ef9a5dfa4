//! Experiments as data: the world, the prompt, and the decision.
//!
//! ```text
//! assets/experiments/*.toml, a lab's own file ──► file (every fault underlined) ──► Spec ──► Experiment
//!                                                   └── prompt (a folder of templates, hashed)
//! ```
//!
//! `table` reads one `[experiment.NAME]` key by key; [`schema`] has the same shape as types, for the JSON Schema;
//! [`explain`] describes a [`Spec`] in words; [`angle`] has the headings of a body.
//!
//! The paper's five experiments are such files. A trace has the whole [`Spec`] in its footer, so replays and reports
//! need no file.
//!
//! ```
//! use mirrorstats_experiment::Experiment;
//!
//! let experiment = Experiment::parse("E1")?;
//! assert!(experiment.asks_for_cube());
//! # Ok::<(), mirrorstats_experiment::UnknownExperiment>(())
//! ```
//!
//! Rule: an experiment draws nothing, renders nothing and knows no agent; `mirrorstats_sim` and `mirrorstats_agents`
//! read it.

#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod angle;
mod built_in;
pub mod explain;
pub mod file;
pub mod prompt;
pub mod schema;
pub mod spec;
mod table;

use std::cmp::Ordering;
use std::fmt;
use std::hash::{Hash, Hasher};
use std::ops::Deref;
use std::sync::{Arc, LazyLock};

use serde::{Serialize, Serializer};

pub use built_in::{built_in, built_in_names};
use prompt::Templates;
pub use spec::Spec;

/// An experiment: its [`Spec`] and its prompt. A clone shares both.
///
/// Experiments are equal if their [`Spec`]s and places are. The built-in ones are first, in their order, then those of
/// files, by place.
#[derive(Clone)]
pub struct Experiment(Origin);

#[derive(Clone)]
enum Origin {
    /// The index in [`BUILT_IN`].
    BuiltIn(usize),
    File {
        place: usize,
        known: Arc<Known>,
    },
}

struct Known {
    spec: Spec,
    /// Its prompt; empty if it comes from a trace's footer, which has only the hash.
    templates: Templates,
}

static BUILT_IN: LazyLock<Vec<Experiment>> = LazyLock::new(built_in::all);

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no experiment `{name}`: expected {}, or a file such as mine.toml", built_in_names().join(", "))]
pub struct UnknownExperiment {
    pub name: String,
}

impl Experiment {
    /// A mirror and three cubes.
    pub const E1: Self = Self(Origin::BuiltIn(0));
    /// As E1 without the mirror.
    pub const E2: Self = Self(Origin::BuiltIn(1));
    /// As E1 with a false colour stated.
    pub const E3: Self = Self(Origin::BuiltIn(2));
    /// A mirror, three cubes and one to six others.
    pub const E4: Self = Self(Origin::BuiltIn(3));
    /// A mirror, one to six others and clutter; no cube to select.
    pub const E5: Self = Self(Origin::BuiltIn(4));

    pub const PAPER: [Self; 5] = [Self::E1, Self::E2, Self::E3, Self::E4, Self::E5];

    pub fn parse(name: &str) -> Result<Self, UnknownExperiment> {
        let at = built_in_names().iter().position(|known| *known == name);
        at.map(|at| Self(Origin::BuiltIn(at))).ok_or_else(|| UnknownExperiment { name: name.to_owned() })
    }

    /// An experiment of a file, at this place among the others of files.
    fn from_file(place: usize, known: Known) -> Self {
        Self(Origin::File { place, known: Arc::new(known) })
    }

    /// The experiment that a trace's footer declares: the equal built-in one, or one without a prompt.
    pub fn from_footer(spec: Spec) -> Self {
        // Older footers, which lack the definitions, differ in nothing else.
        let unnamed = |known: &Spec| spec.definitions.is_none() && Spec { definitions: None, ..known.clone() } == spec;
        match BUILT_IN.iter().position(|known| **known == spec || unnamed(known)) {
            Some(at) => Self(Origin::BuiltIn(at)),
            None => Self::from_file(0, Known { spec, templates: Templates::default() }),
        }
    }

    /// The same experiment; one of a file gets this place.
    #[must_use]
    pub fn at_place(self, place: usize) -> Self {
        match self.0 {
            Origin::File { known, .. } => Self(Origin::File { place, known }),
            Origin::BuiltIn(_) => self,
        }
    }

    fn known(&self) -> &Known {
        match &self.0 {
            Origin::BuiltIn(at) => BUILT_IN[*at].known(),
            Origin::File { known, .. } => known,
        }
    }

    /// The built-in index, or the place after all built-in ones.
    fn place(&self) -> usize {
        match self.0 {
            Origin::BuiltIn(at) => at,
            Origin::File { place, .. } => BUILT_IN.len() + place,
        }
    }

    pub fn name(&self) -> &str {
        &self.known().spec.name
    }

    pub fn templates(&self) -> &Templates {
        &self.known().templates
    }

    /// A number for an agent's randomness: differs between experiments.
    pub fn number(&self) -> u64 {
        match self.0 {
            Origin::BuiltIn(at @ 0..5) => at as u64 + 1,
            _ => number_of(self.name()) >> 8,
        }
    }
}

fn built_in_specs() -> Vec<&'static Spec> {
    BUILT_IN.iter().map(|known| &**known).collect()
}

/// A number derived from a name: the beginning of its SHA-256.
pub fn number_of(name: &str) -> u64 {
    let hash = mirrorstats_exact::hash::of_bytes(name.as_bytes());
    u64::from_str_radix(&hash[..16], 16).unwrap_or_default()
}

impl Deref for Experiment {
    type Target = Spec;

    fn deref(&self) -> &Spec {
        &self.known().spec
    }
}

impl Ord for Experiment {
    fn cmp(&self, other: &Self) -> Ordering {
        let is_same = std::ptr::eq(self.known(), other.known());
        let text = |one: &Self| serde_json::to_string(&**one).unwrap_or_default();
        let by_text = || if is_same { Ordering::Equal } else { text(self).cmp(&text(other)) };
        self.place().cmp(&other.place()).then_with(by_text)
    }
}

impl PartialOrd for Experiment {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Experiment {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Experiment {}

impl Hash for Experiment {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.place().hash(state);
    }
}

impl fmt::Debug for Experiment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Serialize for Experiment {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

#[cfg(test)]
mod tests;

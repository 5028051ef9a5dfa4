//! Experiments as data: the world, the prompt, and the decision.
//!
//! ```text
//! assets/experiments/*.toml, a lab's own file ──► file (every fault underlined) ──► Spec ──► Experiment (a handle)
//!                                                   └── prompt (a folder of templates, hashed)
//! ```
//!
//! `table` reads one `[experiment.NAME]` key by key; [`schema`] has the same shape as types, for the JSON Schema;
//! [`explain`] describes a [`Spec`] in words; [`balance`] distributes colours equally.
//!
//! The paper's five experiments are such files. A trace has the whole [`Spec`] in its footer, so replays and reports
//! need no file.
//!
//! Rule: an experiment draws nothing, renders nothing and knows no agent; `sim` and `agent` read it.

pub mod balance;
mod built_in;
pub mod explain;
pub mod file;
pub mod load;
pub mod prompt;
pub mod schema;
pub mod spec;
mod table;

use std::fmt;
use std::ops::Deref;
use std::sync::{LazyLock, PoisonError, RwLock};

use serde::{Serialize, Serializer};

pub use built_in::{built_in, built_in_names};
use prompt::Templates;
pub use spec::Spec;

/// The maximum number of experiments in a process: hostile files must not fill its memory.
const MOST: usize = 4096;

/// A registered experiment: a handle to its [`Spec`], as cheap as a number.
///
/// Experiments are ordered by registration: the paper's five first, then those of files.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Experiment(u16);

/// A registered experiment.
#[derive(Debug)]
pub struct Known {
    pub spec: Spec,
    /// Its prompt; empty if it comes from a trace's footer, which has only the hash.
    pub templates: Templates,
}

/// Every experiment of this process. The list only grows, by distinct experiments: reading a file twice adds nothing.
static KNOWN: LazyLock<RwLock<Vec<&'static Known>>> = LazyLock::new(|| {
    let all = built_in::all().into_iter().map(|known| -> &'static Known { Box::leak(Box::new(known)) });
    RwLock::new(all.collect())
});

/// An unknown experiment name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no experiment `{name}`: expected {}, or a file such as mine.toml", built_in_names().join(", "))]
pub struct UnknownExperiment {
    /// The name as written.
    pub name: String,
}

/// Too many experiments for a process.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("more than {MOST} experiments in one process: use fewer files at once")]
pub struct TooMany;

impl Experiment {
    /// A mirror and three cubes.
    pub const E1: Self = Self(0);
    /// As E1 without the mirror.
    pub const E2: Self = Self(1);
    /// As E1 with a false colour stated.
    pub const E3: Self = Self(2);
    /// A mirror, three cubes and one to six others.
    pub const E4: Self = Self(3);
    /// A mirror, one to six others and clutter; no cube to select.
    pub const E5: Self = Self(4);

    pub const PAPER: [Self; 5] = [Self::E1, Self::E2, Self::E3, Self::E4, Self::E5];

    /// The built-in experiment of this name.
    pub fn parse(name: &str) -> Result<Self, UnknownExperiment> {
        let at = built_in_names().iter().position(|known| *known == name);
        at.and_then(|at| u16::try_from(at).ok()).map(Self).ok_or_else(|| UnknownExperiment { name: name.to_owned() })
    }

    /// Registers an experiment; returns the existing one if it is equal.
    pub fn register(known: Known) -> Result<Self, TooMany> {
        let mut all = KNOWN.write().unwrap_or_else(PoisonError::into_inner);
        let same = |other: &&Known| other.spec == known.spec && other.templates == known.templates;
        let at = match all.iter().position(same) {
            Some(at) => at,
            None if all.len() >= MOST => return Err(TooMany),
            None => {
                all.push(Box::leak(Box::new(known)));
                all.len() - 1
            }
        };
        u16::try_from(at).map(Self).map_err(|_| TooMany)
    }

    /// The experiment that a trace's footer declares: the equal registered one, or one without a prompt.
    pub fn of_footer(spec: Spec) -> Result<Self, TooMany> {
        // Older footers, which lack the definitions, differ in nothing else.
        let unnamed = |known: &Spec| spec.definitions.is_none() && Spec { definitions: None, ..known.clone() } == spec;
        let same = {
            let all = KNOWN.read().unwrap_or_else(PoisonError::into_inner);
            all.iter()
                .position(|known| known.spec == spec || unnamed(&known.spec))
                .and_then(|at| u16::try_from(at).ok())
        };
        same.map_or_else(|| Self::register(Known { spec, templates: Templates::default() }), |at| Ok(Self(at)))
    }

    fn known(self) -> &'static Known {
        KNOWN.read().unwrap_or_else(PoisonError::into_inner)[usize::from(self.0)]
    }

    /// Its name in traces and files.
    pub fn name(self) -> &'static str {
        &self.known().spec.name
    }

    pub fn templates(self) -> &'static Templates {
        &self.known().templates
    }

    /// A number for an agent's randomness: differs between experiments.
    pub fn number(self) -> u64 {
        match self {
            Self(at @ 0..5) => u64::from(at) + 1,
            _ => number_of(self.name()) >> 8,
        }
    }
}

fn built_in_specs() -> Vec<&'static Spec> {
    let names = built_in_names().into_iter();
    names.filter_map(|name| Experiment::parse(name).ok()).map(|experiment| &experiment.known().spec).collect()
}

/// A number derived from a name: the beginning of its SHA-256.
pub fn number_of(name: &str) -> u64 {
    let hash = exact::hash::of_bytes(name.as_bytes());
    u64::from_str_radix(&hash[..16], 16).unwrap_or_default()
}

impl Deref for Experiment {
    type Target = Spec;

    fn deref(&self) -> &Spec {
        &self.known().spec
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

impl std::str::FromStr for Experiment {
    type Err = UnknownExperiment;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::parse(name)
    }
}

#[cfg(test)]
mod tests;

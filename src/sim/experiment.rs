//! The five experiments (paper, section 3 and the protocol table).

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::base::names::names;

/// One of the five experiments.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
pub enum Experiment {
    /// A mirror and three cubes.
    E1,
    /// As E1 without the mirror.
    E2,
    /// As E1 with a false colour stated.
    E3,
    /// A mirror, three cubes and one to six others.
    E4,
    /// A mirror, one to six others and clutter; no cube to select.
    E5,
}

/// A name that is no experiment.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no experiment `{0}`: expected one of E1, E2, E3, E4, E5")]
pub struct UnknownExperiment(pub String);

names!(Experiment { E1: "E1", E2: "E2", E3: "E3", E4: "E4", E5: "E5" });

impl Experiment {
    /// The experiment of this name, as [`Experiment::name`] writes it.
    ///
    /// # Errors
    /// When there is none.
    pub fn parse(name: &str) -> Result<Self, UnknownExperiment> {
        Self::named(name).ok_or_else(|| UnknownExperiment(name.to_owned()))
    }

    /// Whether the room has its reflective surface.
    pub const fn has_mirror(self) -> bool {
        !matches!(self, Self::E2)
    }

    /// Whether there are three cubes, of which one is to be selected.
    pub const fn has_candidates(self) -> bool {
        !matches!(self, Self::E5)
    }

    /// Whether others walk about.
    pub const fn has_others(self) -> bool {
        matches!(self, Self::E4 | Self::E5)
    }
}

impl std::str::FromStr for Experiment {
    type Err = UnknownExperiment;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::parse(name)
    }
}

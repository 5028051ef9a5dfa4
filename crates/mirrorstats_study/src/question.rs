//! A question to the inputs: definitions, a filter, metrics, groups.

use std::path::{Path, PathBuf};

use mirrorstats_metric::columns::Columns;
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_score::cells::group::{DEFAULT_BY, KEY_COLUMNS};
use mirrorstats_score::tables::table::{CONDITION, EpisodeTable};
use mirrorstats_score::{score_traces, vocabulary};
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::schema::Domain;

use crate::StudyError;
use crate::losses::LostAs;
use crate::own_definitions::{
    Carried, DEFAULT_DEFINITIONS, OwnDefinitionsError, ScoredAlike, carried, check_domain, chosen, side_by_side,
};

/// Labels of each episode's recording that scores carry if the traces have them.
pub(crate) const STANDING_LABELS: [&str; 4] = [CONDITION, "scene", "fingerprint", "participant"];

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Question {
    /// Definitions by name or path. If absent: those that scores carry, or that the experiments of the traces name.
    pub definitions: Option<PathBuf>,
    /// True to score experiments that need different definitions each by their own; false to refuse them.
    pub each: bool,
    /// The experiments by their definitions, if each is scored by its own; else empty.
    pub parts: Vec<ScoredAlike>,
    /// The definitions that the traces carry, if none are requested.
    pub carried: Option<Carried>,
    /// A condition on episodes in the language of definitions; all episodes if absent.
    pub filter: Option<String>,
    /// The metrics wanted, by name; all if absent.
    pub metrics: Option<Vec<String>>,
    /// The columns that cells are grouped by. If absent: experiment and model, and the condition if there is any other
    /// than the default.
    pub by: Option<Vec<String>>,
    /// True if a cell may mix episodes that were recorded differently.
    pub pool: bool,
    pub lost: LostAs,
}

impl Question {
    pub fn definitions_name(&self) -> &Path {
        let carried = || self.carried.as_ref().map_or(DEFAULT_DEFINITIONS, |carried| &carried.name);
        self.definitions.as_deref().unwrap_or_else(|| Path::new(carried()))
    }

    pub(crate) fn labels(&self) -> Vec<String> {
        self.by.iter().flatten().filter(|name| !KEY_COLUMNS.contains(&name.as_str())).cloned().collect()
    }

    pub(crate) fn labels_over(&self, traces: &TraceSet) -> Vec<String> {
        let mut labels = self.labels();
        let standing = STANDING_LABELS.into_iter().filter(|name| traces.declares(name));
        add_new(&mut labels, standing.chain(traces.label_columns().iter().map(String::as_str)));
        labels
    }

    pub(crate) fn by_over(&self, episodes: &EpisodeTable) -> Vec<String> {
        let default = || {
            let condition = episodes.has_conditions().then_some(CONDITION);
            DEFAULT_BY.into_iter().chain(condition).map(str::to_owned).collect()
        };
        self.by.clone().unwrap_or_else(default)
    }

    /// Fills in the definitions that the experiments of these traces name, unless the question requests others.
    pub fn resolved(mut self, traces: &TraceSet) -> Result<Self, OwnDefinitionsError> {
        self.carried = if self.definitions.is_none() { carried(traces)? } else { None };
        if self.carried.is_some() {
            return Ok(self);
        }
        if traces.domain() == Domain::Own {
            check_domain(self.definitions_name(), traces)?;
        }
        if self.definitions.is_some() {
            return Ok(self);
        }
        match chosen(traces) {
            Err(OwnDefinitionsError::Differ { groups }) if self.each && groups.iter().all(ScoredAlike::is_built_in) => {
                self.parts = groups;
            }
            name => self.definitions = name?,
        }
        Ok(self)
    }

    pub(crate) fn load(&self, columns: &Columns) -> Result<Definitions, StudyError> {
        if self.definitions.is_none() && !self.parts.is_empty() {
            let whole = side_by_side(&self.parts, columns)?;
            return whole.ok_or_else(|| OwnDefinitionsError::Differ { groups: self.parts.clone() }.into());
        }
        Ok(match &self.carried {
            Some(carried) => carried.load(columns)?,
            None => Definitions::load(self.definitions_name(), columns)?,
        })
    }

    pub(crate) fn bind(&self, traces: &TraceSet) -> Result<Definitions, StudyError> {
        let asked = self.clone().resolved(traces)?;
        Ok(score_traces::checked(traces, asked.bind_to(&vocabulary::trace_columns(traces))?)?)
    }

    pub fn bind_to(&self, columns: &Columns) -> Result<Definitions, StudyError> {
        self.applied(self.load(columns)?, columns)
    }

    pub(crate) fn applied(&self, mut definitions: Definitions, columns: &Columns) -> Result<Definitions, StudyError> {
        if let Some(filter) = &self.filter {
            definitions = definitions.filtered("--where", filter, columns)?;
        }
        if let Some(metrics) = &self.metrics {
            definitions.select(metrics)?;
        }
        Ok(definitions)
    }
}

/// Adds the names that a list lacks.
pub(crate) fn add_new<'n>(list: &mut Vec<String>, names: impl Iterator<Item = &'n str>) {
    for name in names {
        if !list.iter().any(|known| known == name) {
            list.push(name.to_owned());
        }
    }
}

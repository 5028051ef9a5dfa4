//! The definitions of each experiment: named by the footer, or those of the built-in experiment with its name.
//!
//! Rule: by default, each experiment is scored by its own definitions. Definitions that include all others score a
//! mixture; other mixtures are refused, with questions that work. Requested definitions must score all that they keep.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::error::kinds;
use crate::{ErrorKind, StudyError};
use mirrorstats_metric::columns::Columns;
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_metric::file::{self, FileError};
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_trace::footers::declared_experiment::DeclaredExperiment;
use mirrorstats_trace::read::open::{TraceFile, TraceSet};
use mirrorstats_trace::schema::RECORDING_KEY;
use serde::Deserialize;

pub(crate) const DEFAULT_DEFINITIONS: &str = "paper";

#[derive(Debug, thiserror::Error)]
pub enum OwnDefinitionsError {
    #[error("expected experiments that the same definitions score, found {}", differing(.groups))]
    Differ { groups: Vec<ScoredAlike> },
    #[error(
        "{}: expected the definition file `{}`{}, which scores these episodes, found its name alone\n  \
         help: a trace carries no definition file: give it with --definitions FILE",
        .group.experiments.iter().map(String::as_str).collect::<Vec<_>>().join(", "),
        .group.definitions,
        .group.hash.as_deref().map(|hash| format!(" (sha256 {hash})")).unwrap_or_default()
    )]
    Elsewhere { group: ScoredAlike },
    #[error(
        "expected traces that carry the same definitions, found `{}` in {} and `{}` in {}\n  \
         help: name the definitions for all of them with --definitions, or give the files one by one",
        .names[0], .files[0], .names[1], .files[1]
    )]
    CarriedDiffer { files: [String; 2], names: [String; 2] },
    #[error(
        "`{file}` has no column of the domain `mirror`: expected definitions of its own domain, found `{definitions}`\n  \
         help: give --definitions a file with `domain = \"NAME\"` and a `[column.NAME]` for each column that it reads"
    )]
    OtherDomain { file: String, definitions: String },
}

impl From<OwnDefinitionsError> for StudyError {
    fn from(error: OwnDefinitionsError) -> Self {
        let is_elsewhere = matches!(error, OwnDefinitionsError::Elsewhere { .. });
        Self::new(if is_elsewhere { ErrorKind::Definitions } else { ErrorKind::Input }, error)
    }
}

/// Requested definitions do not score an experiment whose own definitions would.
#[derive(Debug, thiserror::Error)]
#[error(
    "{experiment}: expected definitions that score it, as `{own}` do, found `{definitions}`, whose zeros would mean nothing\n  \
     help: leave --definitions out, or give --definitions {own}; a file of your own scores it with `include = [\"{own}\"]`, \
     or with a table `[experiment.{experiment}]`; `--where` leaves its episodes out"
)]
pub(crate) struct NotScored {
    pub experiment: String,
    pub definitions: String,
    pub own: String,
}

kinds! { Definitions: NotScored; }

fn differing(groups: &[ScoredAlike]) -> String {
    let one = |group: &ScoredAlike| format!("`{}` for {}", group.definitions, group.condition);
    let ask = |group: &ScoredAlike| format!("--where \"{}\" --definitions {}", group.condition, group.definitions);
    let found = groups.iter().map(one).collect::<Vec<_>>().join(", ");
    format!("{found}\n  help: ask for each by itself: {}", groups.iter().map(ask).collect::<Vec<_>>().join("; or "))
}

/// Experiments that the same definitions score.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ScoredAlike {
    pub definitions: String,
    /// SHA-256 of a definition file that is not built in.
    pub hash: Option<String>,
    /// The experiments by name, without those that no footer names.
    pub experiments: BTreeSet<String>,
    pub condition: String,
}

impl ScoredAlike {
    pub(crate) fn is_built_in(&self) -> bool {
        self.hash.is_none() && file::built_in(&self.definitions).is_some()
    }
}

/// Definitions that traces carry, since they were imported with them.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
pub struct Carried {
    pub(crate) name: String,
    pub(crate) text: String,
}

impl Carried {
    pub(crate) fn of(definitions: &Definitions) -> Self {
        Self { name: definitions.catalog.name.clone(), text: definitions.as_one_file() }
    }

    pub(crate) fn load(&self, columns: &Columns) -> Result<Definitions, FileError> {
        Definitions::from_toml(&self.name, &self.text, columns)
    }

    fn of_file(file: &TraceFile) -> Option<Self> {
        // Most recordings carry none, and are long.
        let has = |text: &str| text.contains("\"definitions\":{\"name\"");
        file.metadata_value(RECORDING_KEY).filter(|text| has(text))?;
        serde_json::from_value(file.recording()["definitions"].clone()).ok()
    }
}

/// The definitions that these traces carry; `None` if no trace carries any.
pub(crate) fn carried(traces: &TraceSet) -> Result<Option<Carried>, OwnDefinitionsError> {
    let mut found: Option<(&TraceFile, Carried)> = None;
    for file in traces.files() {
        match (Carried::of_file(file), &found) {
            (Some(own), Some((first, known))) if own != *known => {
                let files = [first.name(), file.name()].map(str::to_owned);
                return Err(OwnDefinitionsError::CarriedDiffer { files, names: [known.name.clone(), own.name] });
            }
            (Some(own), None) => found = Some((file, own)),
            _ => {}
        }
    }
    Ok(found.map(|(_, carried)| carried))
}

/// The definitions of reaching, whose traces have no colours.
const WITHOUT_COLORS: &str = "reach";

/// The definitions that an experiment names, and the hash of a file; `None` for the default ones.
fn own(declared: &DeclaredExperiment) -> Option<(String, Option<String>)> {
    if let Some(name) = &declared.definitions {
        return Some((name.clone(), declared.definitions_hash.clone()));
    }
    // Older traces name no definitions: built-in definitions list the experiment, or the task has no colours.
    let lists = |name: &&str| file::read(name).is_ok_and(|document| document.experiments.contains_key(&declared.name));
    let listed = file::built_in_names().into_iter().find(lists);
    let name = listed.or_else(|| (!declared.absent.is_empty()).then_some(WITHOUT_COLORS))?;
    (name != DEFAULT_DEFINITIONS).then(|| (name.to_owned(), None))
}

fn groups(traces: &TraceSet) -> Vec<ScoredAlike> {
    let mut by_name: BTreeMap<(String, Option<String>), BTreeSet<String>> = BTreeMap::new();
    let default = || (DEFAULT_DEFINITIONS.to_owned(), None);
    let mut unnamed = None;
    for file in traces.files() {
        if file.experiments().is_empty() {
            unnamed = Some(default());
            by_name.entry(default()).or_default();
        }
        for declared in file.experiments() {
            let names = by_name.entry(own(declared).unwrap_or_else(default)).or_default();
            names.insert(declared.name.clone());
        }
    }
    let all: Vec<(String, Option<String>)> = by_name.keys().cloned().collect();
    for one in &all {
        let includes = |(other, hash): &&(String, Option<String>)| {
            let built_on = file::built_in(other).and_then(|_| file::read(other).ok()).map(|document| document.built_on);
            (other, hash) != (&one.0, &one.1) && hash.is_none() && built_on.is_some_and(|on| on.contains(&&*one.0))
        };
        let Some(other) = all.iter().find(includes).filter(|_| one.1.is_none()) else { continue };
        let names = by_name.remove(one).unwrap_or_default();
        by_name.entry(other.clone()).or_default().extend(names);
        unnamed = unnamed.map(|unnamed| if unnamed == *one { other.clone() } else { unnamed });
    }
    let listed = |names: &mut dyn Iterator<Item = &String>| {
        names.map(|name| format!("'{}'", name.replace('\'', "''"))).collect::<Vec<_>>().join(", ")
    };
    let group = |(key, experiments): (&(String, Option<String>), &BTreeSet<String>)| {
        let others = by_name.iter().filter(|(other, _)| *other != key).flat_map(|(_, names)| names);
        let condition = if unnamed.as_ref() == Some(key) {
            format!("experiment not in ({})", listed(&mut others.into_iter()))
        } else {
            format!("experiment in ({})", listed(&mut experiments.iter()))
        };
        let (definitions, hash) = key.clone();
        ScoredAlike { definitions, hash, experiments: experiments.clone(), condition }
    };
    by_name.iter().map(group).collect()
}

/// The definitions that score all experiments of some traces as their own definitions do; `None` for the default ones.
pub(crate) fn chosen(traces: &TraceSet) -> Result<Option<PathBuf>, OwnDefinitionsError> {
    let groups = groups(traces);
    match &groups[..] {
        [] => Ok(None),
        [one] if one.is_built_in() => {
            Ok(Some(&one.definitions).filter(|name| *name != DEFAULT_DEFINITIONS).map(PathBuf::from))
        }
        [one] => Err(OwnDefinitionsError::Elsewhere { group: one.clone() }),
        _ => Err(OwnDefinitionsError::Differ { groups }),
    }
}

/// Refuses definitions of the mirror for traces of another domain. Unreadable definitions are reported when loaded.
pub(crate) fn check_domain(definitions: &Path, traces: &TraceSet) -> Result<(), OwnDefinitionsError> {
    let is_mirror = file::read(definitions).is_ok_and(|document| document.domain.is_none());
    let first = traces.files().first().filter(|_| is_mirror);
    first.map_or(Ok(()), |first| {
        let (file, definitions) = (first.name().to_owned(), definitions.display().to_string());
        Err(OwnDefinitionsError::OtherDomain { file, definitions })
    })
}

/// All experiments in one, each under its own definitions; `None` if two of them define one name differently.
pub(crate) fn side_by_side(groups: &[ScoredAlike], columns: &Columns) -> Result<Option<Definitions>, FileError> {
    let part = |group: &ScoredAlike| {
        let definitions = Definitions::load(&group.definitions, columns)?;
        let elsewhere = |name: &&String| groups.iter().any(|other| other.experiments.contains(*name));
        let known = definitions.catalog.experiment.keys().filter(|name| !elsewhere(name));
        let experiments = group.experiments.iter().chain(known).cloned().collect();
        Ok((definitions, experiments))
    };
    let parts = groups.iter().map(part).collect::<Result<Vec<_>, FileError>>()?;
    Ok(Definitions::side_by_side(&parts, columns).transpose()?)
}

/// Refuses definitions that do not score an experiment whose own definitions would: a false zero is no score.
pub(crate) fn check_scored(
    definitions: &Definitions,
    traces: &TraceSet,
    episodes: &EpisodeTable,
) -> Result<(), NotScored> {
    unscored(definitions, traces, |name| episodes.keys.iter().any(|key| key.experiment == name)).map_or(Ok(()), Err)
}

pub(crate) fn unscored(
    definitions: &Definitions,
    traces: &TraceSet,
    is_kept: impl Fn(&str) -> bool,
) -> Option<NotScored> {
    let declared = traces.files().iter().flat_map(TraceFile::experiments);
    let mut not_scored = declared.filter_map(|declared| {
        let (own, hash) = own(declared)?;
        (!definitions.scores(&declared.name, &own, hash.as_deref())).then_some((&declared.name, own))
    });
    let (experiment, own) = not_scored.find(|(name, _)| is_kept(name))?;
    let (experiment, definitions) = (experiment.clone(), definitions.catalog.name.clone());
    Some(NotScored { experiment, definitions, own })
}

//! Definition files as written: parses TOML, checks every key, and reports faults with their places.
//!
//! This file knows the keys of a definition file, which `shape` declares, but not the meaning of expressions.

use std::path::Path;

use indexmap::IndexMap;

use super::catalogs::catalog::{Experiment, Factor};
use super::columns::{Column, Level};
use super::shape::{ColumnShape, DefinitionFile, ExperimentShape, MetricShape};
use crate::columns::Type;
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::chance::Chance;
use mirrorstats_exact::hash;
use mirrorstats_exact::ratio::Ratio;
use mirrorstats_exact::suggest::did_you_mean;
use mirrorstats_toml_spec::{At, Fault, Faults, FileKind, FileText, Part, Place, Source, Written};

/// Definitions are written by hand, or by a program that spells out many similar metrics.
const KIND: FileKind = FileKind {
    name: "definition file",
    names: "definitions",
    check: "mirrorstats definitions check FILE",
    built_in: &[
        ("paper", include_str!("../../../assets/definitions/paper.toml")),
        ("extended", include_str!("../../../assets/definitions/extended.toml")),
        ("battery", include_str!("../../../assets/definitions/battery.toml")),
        ("evidence", include_str!("../../../assets/definitions/evidence.toml")),
        ("reach", include_str!("../../../assets/definitions/reach.toml")),
        ("reach-fallback", include_str!("../../../assets/definitions/reach-fallback.toml")),
        ("robots", include_str!("../../../examples/domains/robots.toml")),
        ("tools", include_str!("../../../examples/domains/tools.toml")),
    ],
    largest: Limit::new("bytes of a definition file", 1 << 20),
    most_keys: Limit::new("keys in a definition file", 10_000),
    most_includes: Limit::new("includes, those of included files counted", 256),
};

/// The most digits after the point of a column or of `round`: nanometres of a metre.
pub(crate) const MOST_DECIMALS: u8 = 9;

/// The domain of definitions that name none: the columns and rules of the mirror are known.
const MIRROR: &str = "mirror";

/// A definition file and its includes, merged in order: later entries replace earlier ones.
#[derive(Clone, Debug, Default)]
pub struct Document {
    pub name: String,
    /// SHA-256 of the file's text; absent for built-in texts and texts without a file.
    pub file_hash: Option<String>,
    pub built_on: Vec<&'static str>,
    pub open: bool,
    /// The subject of the traces, any name; absent for the mirror.
    pub domain: Option<String>,
    pub columns: IndexMap<String, ColumnEntry>,
    pub lets: IndexMap<String, (Written, Place)>,
    pub metrics: IndexMap<String, MetricEntry>,
    pub experiments: IndexMap<String, ExperimentEntry>,
    /// `[factor.NAME]` tables, with the places of the experiments in `values`.
    pub factors: IndexMap<String, (Factor, Vec<Place>)>,
}

/// A `[column.NAME]` table.
#[derive(Clone, Debug)]
pub struct ColumnEntry {
    pub place: Place,
    pub column: Column,
    /// The only texts in it, except null; any if empty.
    pub values: Vec<String>,
    pub unit: String,
    /// The digits after the point of a float.
    pub decimals: Option<u8>,
    pub help: String,
}

/// A `[metric.NAME]` table.
#[derive(Clone, Debug)]
pub struct MetricEntry {
    pub place: Place,
    pub said: MetricShape,
    pub value: Written,
    pub when: Option<Written>,
    pub chance: Option<Ratio>,
    pub finished: Place,
    pub completes: Place,
}

/// An `[experiment.NAME]` table.
#[derive(Clone, Debug)]
pub struct ExperimentEntry {
    /// As in the catalog, except that its `order` is open.
    pub experiment: Experiment,
    /// `order`; the position in the file if absent.
    pub order: Option<i64>,
    /// The places of the metrics in `chance` and `reference`, by the key and the metric.
    pub levels: IndexMap<(&'static str, String), Place>,
    /// The places of the experiment and of the metrics in `control`.
    pub control: Option<(Place, Vec<Place>)>,
}

#[derive(Debug, thiserror::Error)]
pub enum FileError {
    #[error("cannot read the definition file `{path}`; {}", KIND.did_you_mean(path))]
    Unreadable { path: String, source: std::io::Error },
    #[error("{0}")]
    Faults(#[from] Faults),
}

pub fn built_in_names() -> Vec<&'static str> {
    KIND.built_in_names()
}

pub fn built_in(name: &str) -> Option<&'static str> {
    KIND.built_in_text(name)
}

pub fn read(name_or_path: impl AsRef<Path>) -> Result<Document, FileError> {
    let path = name_or_path.as_ref();
    let unreadable = |source| FileError::Unreadable { path: path.display().to_string(), source };
    let name = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    document(name, KIND.open(path, path).map_err(unreadable)?)
}

/// Reads definitions from a text; includes are relative to `folder`, the current one if absent.
pub(crate) fn read_source(name: String, source: Source, folder: Option<&Path>) -> Result<Document, FileError> {
    document(name, FileText::inline(source, folder))
}

fn document(name: String, file: FileText) -> Result<Document, FileError> {
    let file_hash = file.path.is_some().then(|| hash::of_bytes(file.source.text.as_bytes()));
    let mut document = Document { name, file_hash, ..Document::default() };
    KIND.read(file, |at, part, faults| document.add(at, part, faults))?;
    Ok(document)
}

impl Document {
    pub fn unknown_metric(&self, name: &str, place: &Place) -> Option<Fault> {
        unknown(&self.metrics, "metric", name, place)
    }

    pub(super) fn unknown_experiment(&self, name: &str, place: &Place) -> Option<Fault> {
        unknown(&self.experiments, "experiment", name, place)
    }

    fn add(&mut self, at: &At<'_>, part: &Part, faults: &mut Vec<Fault>) {
        self.built_on.extend(part.built_in);
        let Some(file) = mirrorstats_toml_spec::read::<DefinitionFile>(at, "a definition file", faults) else { return };
        self.open = file.open.unwrap_or(self.open);
        if let Some(domain) = file.domain {
            self.domain = Some(domain).filter(|name| name != MIRROR);
        }
        for (name, at) in at.within("let") {
            self.lets.insert(name.to_owned(), (at.expression(), at.name_place()));
        }
        for ((name, said), (_, at)) in file.column.into_iter().zip(at.within("column")) {
            if said.ty != Type::Text && !said.values.is_empty() {
                let fault = at.key("values").item(0).fault("`values` lists the texts of a column that is not text");
                faults.push(fault.help("give the column `type = \"text\"`, or leave the list out"));
            }
            if said.decimals.is_some_and(|decimals| said.ty != Type::Float || decimals > MOST_DECIMALS) {
                let message = format!("`decimals` needs a column of floats and a number from 0 to {MOST_DECIMALS}");
                faults.push(at.key("decimals").fault(&message).help("an integer column is exact without it"));
            }
            let level = if said.constant { Level::Episode } else { Level::Step };
            let column = Column { ty: said.ty, level };
            let ColumnShape { values, unit, decimals, help, .. } = said;
            let entry = ColumnEntry { place: at.name_place(), column, values, unit, decimals, help };
            self.columns.insert(name, entry);
        }
        for ((name, said), (_, at)) in file.experiment.into_iter().zip(at.within("experiment")) {
            self.experiments.insert(name, ExperimentEntry::new(said, &at, faults));
        }
        for ((name, said), (_, at)) in file.factor.into_iter().zip(at.within("factor")) {
            let places = at.within("values").map(|(_, at)| at.name_place()).collect();
            self.factors.insert(name, (said, places));
        }
        for ((name, said), (_, at)) in file.metric.into_iter().zip(at.within("metric")) {
            self.metrics.insert(name, MetricEntry::new(said, &at, faults));
        }
    }
}

fn unknown<T>(known: &IndexMap<String, T>, noun: &str, name: &str, place: &Place) -> Option<Fault> {
    if known.contains_key(name) {
        return None;
    }
    let near = did_you_mean(name, known.keys().map(String::as_str));
    Some(Fault::new(place.clone(), format!("`{name}` is no {noun} of these definitions")).help_if(near))
}

impl MetricEntry {
    fn new(said: MetricShape, at: &At<'_>, faults: &mut Vec<Fault>) -> Self {
        Self {
            place: at.name_place(),
            value: at.key("value").expression(),
            when: at.get("when").map(|when| when.expression()),
            chance: at.get("chance").and_then(|level| level.parse(faults)),
            finished: at.key("finished").place(),
            completes: at.key("completes").place(),
            said,
        }
    }

    pub(super) fn relations(&self) -> impl Iterator<Item = (&'static str, &str, &Place)> {
        let finished = self.said.finished.iter().map(|name| ("finished", name.as_str(), &self.finished));
        finished.chain(self.said.completes.iter().map(|name| ("completes", name.as_str(), &self.completes)))
    }
}

/// A chance level, or `None` for the word `none`; `None` at all if it is invalid.
pub fn chance_level(at: &At<'_>, faults: &mut Vec<Fault>) -> Option<Option<Chance>> {
    if at.written() == "none" {
        return Some(None);
    }
    let mut strategies = at.entries().peekable();
    if strategies.peek().is_none() {
        return at.parse(faults).map(|level| Some(Chance::Of(level)));
    }
    let levels = strategies.map(|(name, at)| Some((name.to_owned(), at.parse(faults)?)));
    levels.collect::<Option<_>>().map(|levels| Some(Chance::ByStrategy(levels)))
}

impl ExperimentEntry {
    fn new(said: ExperimentShape, at: &At<'_>, faults: &mut Vec<Fault>) -> Self {
        let mut levels = IndexMap::new();
        let (mut chance, mut reference) = (IndexMap::new(), IndexMap::new());
        for (metric, at) in at.within("chance") {
            let Some(level) = chance_level(&at, faults) else { continue };
            chance.insert(metric.to_owned(), level);
            levels.insert(("chance", metric.to_owned()), at.name_place());
        }
        for (metric, at) in at.within("reference") {
            reference.insert(metric.to_owned(), at.items().filter_map(|level| level.parse(faults)).collect());
            levels.insert(("reference", metric.to_owned()), at.name_place());
        }
        let places =
            at.get("control").map(|at| (at.key("of").place(), at.within("on").map(|(_, at)| at.place()).collect()));
        let ExperimentShape { title, order, control, .. } = said;
        let experiment = Experiment { title, order: 0, chance, reference, is_declared: false, control };
        Self { experiment, order, levels, control: places }
    }
}

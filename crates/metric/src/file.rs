//! Definition files as written: TOML in, every key accounted for, faults with their places.
//!
//! This file knows what may stand in a definition file and nothing of what an expression means.
//!
//! ```toml
//! include = ["paper"]              # built-in names, or paths relative to this file
//! open = false                     # whether unlisted experiments are accepted
//! domain = "robots"                # what the traces are about; `mirror` if absent
//! [column.grip_force]              # a column of your own traces
//! type = "float"                   # bool, int, float or text
//! unit = "N"
//! [column.outcome]
//! type = "text"
//! constant = true                  # the same in all rows of an episode
//! values = ["success", "timeout"]  # the only texts that it holds, null apart
//! [let]
//! done = "first(action = 'done')"
//! [experiment.E1]
//! title = "Active mirror-based self-identification"
//! order = 1
//! chance = { TSA = "1/3" }         # "none" where a metric's own chance does not apply
//! [metric.TSA]
//! title = "Task Success Accuracy"
//! value = "coalesce(at(choice, done) = body_color, false)"
//! ```

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::{fs, io};

use indexmap::IndexMap;

use super::catalog::{Better, StandardError};
use super::columns::{Column, Level, Type};
use super::measure::{Measures, ValueRange};
use exact::budget::Limit;
use exact::ratio::Ratio;
use exact::suggest::nearest;
use exact::{hash, input};
use toml_spec::Written;
use toml_spec::{Fault, Faults, Place, Source};
use toml_spec::{IncludeKind, Includes};
use toml_spec::{Keys, key_count, parse_toml};

/// The built-in definition files, by name.
const BUILT_IN: [(&str, &str); 5] = [
    ("paper", include_str!("../../../assets/definitions/paper.toml")),
    ("extended", include_str!("../../../assets/definitions/extended.toml")),
    ("battery", include_str!("../../../assets/definitions/battery.toml")),
    ("reach", include_str!("../../../assets/definitions/reach.toml")),
    ("reach-fallback", include_str!("../../../assets/definitions/reach-fallback.toml")),
];

/// A definition file and all that it includes, merged in order: what comes later replaces what came before.
#[derive(Clone, Debug, Default)]
pub struct Document {
    /// The file's own name, without folder and ending.
    pub name: String,
    /// SHA-256 of the file's own text; absent for a text that is no file of one's own.
    pub file_hash: Option<String>,
    /// The built-in definitions that it is or includes, by name.
    pub built_on: Vec<&'static str>,
    /// Whether unlisted experiments are accepted.
    pub open: bool,
    /// What the traces are about, where that is not the mirror: any name.
    pub domain: Option<String>,
    /// Declared columns of the user's own.
    pub columns: IndexMap<String, ColumnEntry>,
    /// Named expressions.
    pub lets: IndexMap<String, (Written, Place)>,
    pub metrics: IndexMap<String, MetricEntry>,
    pub experiments: IndexMap<String, ExperimentEntry>,
}

/// A `[column.NAME]` table.
#[derive(Clone, Debug)]
pub struct ColumnEntry {
    pub place: Place,
    pub column: Column,
    /// The only texts that it holds, null apart; any if empty.
    pub values: Vec<String>,
    pub unit: String,
    /// For a reader of the column; may be empty.
    pub help: String,
}

/// A `[metric.NAME]` table.
#[derive(Clone, Debug)]
pub struct MetricEntry {
    pub place: Place,
    /// `title`, the name itself if absent.
    pub title: Option<String>,
    pub unit: Option<(String, Place)>,
    pub better: Better,
    pub section: String,
    pub help: String,
    pub value: Written,
    pub when: Option<Written>,
    pub se: StandardError,
    pub chance: Option<Ratio>,
    pub measures: Option<Measures>,
    pub range: Option<ValueRange>,
    pub finished: Option<(String, Place)>,
    pub completes: Option<(String, Place)>,
}

/// An `[experiment.NAME]` table.
#[derive(Clone, Debug)]
pub struct ExperimentEntry {
    pub title: String,
    /// `order`, the position in the file if absent.
    pub order: Option<i64>,
    /// `chance`, by metric.
    pub chance: IndexMap<String, (Option<Ratio>, Place)>,
    /// `reference`, by metric.
    pub reference: IndexMap<String, (Vec<Ratio>, Place)>,
}

/// A definition file that could not be read at all.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The file is not there or not readable.
    #[error("cannot read the definition file `{path}`; {}", built_in_help(path))]
    Unreadable {
        /// As it was typed.
        path: String,
        /// Why.
        source: std::io::Error,
    },
    /// The file has faults.
    #[error(transparent)]
    Faults(#[from] Faults),
}

/// The names of the built-in definition files.
pub fn built_in_names() -> Vec<&'static str> {
    BUILT_IN.iter().map(|(name, _)| *name).collect()
}

/// What a name that gives no file may have been meant to be.
fn built_in_help(name: &str) -> String {
    match nearest(name, built_in_names()) {
        Some(near) => format!("did you mean the built-in `{near}`?"),
        None => format!("built-in definitions are {}", built_in_names().join(", ")),
    }
}

/// The text of a built-in definition file.
pub fn built_in(name: &str) -> Option<&'static str> {
    BUILT_IN.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// Reads a built-in definition file by name, or any other by path.
pub fn read(name_or_path: impl AsRef<Path>) -> Result<Document, FileError> {
    let name_or_path = name_or_path.as_ref();
    let file = find(name_or_path.to_str(), name_or_path)
        .map_err(|source| FileError::Unreadable { path: name_or_path.display().to_string(), source })?;
    let name = name_or_path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    Reading::of(name, file)
}

/// Reads definitions from a text; includes are relative to `folder`, the current one if absent.
pub fn read_source(name: String, source: Source, folder: Option<&Path>) -> Result<Document, FileError> {
    Reading::of(name, DefinitionFile { source, folder: folder.map(Path::to_owned), place: None })
}

/// The domain of definitions that name none: the columns of the mirror are known, with their rules.
const MIRROR: &str = "mirror";
/// Definitions are written by hand, or by a program that spells out a family of metrics.
const LARGEST: Limit = Limit::new("bytes of a definition file", 1 << 20);
/// Keys of a file, tables included.
const MOST_KEYS: Limit = Limit::new("keys in a definition file", 10_000);
/// How definition files include others.
const INCLUDED: IncludeKind = IncludeKind {
    name: "definition file",
    check: "mirrorstats definitions check FILE",
    most: Limit::new("includes, those of included files counted", 256),
};

/// A definition file's text, and where it is.
struct DefinitionFile {
    source: Source,
    folder: Option<PathBuf>,
    /// Its one place on disk, whatever it is called; `None` for a text that is no file.
    place: Option<PathBuf>,
}

fn find(name: Option<&str>, path: &Path) -> io::Result<DefinitionFile> {
    if let Some((name, text)) = name.and_then(|name| Some((name, built_in(name)?))) {
        let source = Source { name: format!("{name}.toml"), text: text.to_owned() };
        return Ok(DefinitionFile { source, folder: None, place: None });
    }
    let text = input::text(path, LARGEST)?;
    let source = Source { name: path.display().to_string(), text };
    Ok(DefinitionFile { source, folder: path.parent().map(Path::to_owned), place: fs::canonicalize(path).ok() })
}

struct Reading {
    document: Document,
    faults: Vec<Fault>,
    includes: Includes,
}

impl Reading {
    fn of(name: String, file: DefinitionFile) -> Result<Document, FileError> {
        let mut reading = Self {
            document: Document {
                name,
                file_hash: file.place.is_some().then(|| hash::of_bytes(file.source.text.as_bytes())),
                ..Document::default()
            },
            faults: Vec::new(),
            includes: Includes::new(INCLUDED),
        };
        reading.file(file);
        if reading.faults.is_empty() { Ok(reading.document) } else { Err(Faults(reading.faults).in_order().into()) }
    }

    fn file(&mut self, file: DefinitionFile) {
        let source = Arc::new(file.source);
        let (table, faults) = parse_toml(&source);
        if !faults.is_empty() {
            self.faults.extend(faults);
            return;
        }
        if let Err(exceeded) = MOST_KEYS.check(key_count(table.get_ref())) {
            self.faults.push(Fault::new(Place { source, span: 0..0 }, exceeded.to_string()));
            return;
        }
        let is_own = |(_, text): &&(&str, &str)| file.place.is_none() && *text == source.text;
        self.document.built_on.extend(BUILT_IN.iter().find(is_own).map(|(name, _)| *name));
        self.includes.enter(&source.name, file.place);
        let mut root = Keys::new(&source, table.get_ref(), "a definition file");
        if let Some(includes) = root.texts("include", &mut self.faults) {
            for (name, place) in includes {
                self.include(&name, place, file.folder.as_deref());
            }
        }
        if let Some(open) = root.truth("open", &mut self.faults) {
            self.document.open = open;
        }
        if let Some((domain, _)) = root.text("domain", &mut self.faults) {
            self.document.domain = Some(domain).filter(|name| name != MIRROR);
        }
        self.columns(&mut root);
        self.lets(&mut root);
        self.experiments(&mut root);
        self.metrics(&mut root);
        root.refuse_the_rest(&mut self.faults);
        self.includes.leave();
    }

    fn include(&mut self, name: &str, place: Place, folder: Option<&Path>) {
        let Self { includes, faults, .. } = self;
        let Some(path) = includes.follow(name, &place, folder, faults) else { return };
        match find(Some(name), &path) {
            Ok(file) if includes.leads_back(&file.source.name, file.place.as_deref(), &place, faults) => {}
            Ok(file) => {
                let before = faults.len();
                self.file(file);
                self.includes.conceal(before, place, &mut self.faults);
            }
            Err(error) => {
                let help = format!("a path is relative to this file; {}", built_in_help(name));
                let message = format!("cannot read the definition file `{}`: {error}", path.display());
                includes.tell(Fault::new(place, message).help(help), faults);
            }
        }
    }

    fn columns(&mut self, root: &mut Keys) {
        for (name, place, mut keys) in root.tables("column", &mut self.faults) {
            let types = [("bool", Type::Bool), ("int", Type::Int), ("float", Type::Float), ("text", Type::Text)];
            let ty = keys.choice("type", &types, &mut self.faults);
            let constant = keys.truth("constant", &mut self.faults).unwrap_or(false);
            let values = keys.texts("values", &mut self.faults).unwrap_or_default();
            let [unit, help] =
                ["unit", "help"].map(|key| keys.text(key, &mut self.faults).map_or_else(String::new, |(text, _)| text));
            keys.refuse_the_rest(&mut self.faults);
            if let Some((_, place)) = values.first().filter(|_| ty.is_some_and(|ty| ty != Type::Text)) {
                let fault = Fault::new(place.clone(), "`values` lists the texts of a column that is not text");
                self.faults.push(fault.help("give the column `type = \"text\"`, or leave the list out"));
            }
            match ty {
                Some(ty) => {
                    let level = if constant { Level::Episode } else { Level::Step };
                    let values = values.into_iter().map(|(text, _)| text).collect();
                    let entry = ColumnEntry { place, column: Column { ty, level }, values, unit, help };
                    self.document.columns.insert(name, entry);
                }
                None => self.missing(place, "type", "a column"),
            }
        }
    }

    fn lets(&mut self, root: &mut Keys) {
        let Some(mut keys) = root.table("let", &mut self.faults) else { return };
        for name in keys.names() {
            let place = keys.key_place(&name);
            if let Some(written) = keys.expression(&name, &mut self.faults) {
                self.document.lets.insert(name, (written, place));
            }
        }
    }

    fn metrics(&mut self, root: &mut Keys) {
        for (name, place, mut keys) in root.tables("metric", &mut self.faults) {
            let faults = &mut self.faults;
            let better = [("higher", Better::Higher), ("lower", Better::Lower), ("neither", Better::Neither)];
            let se = [("sample", StandardError::Sample), ("population", StandardError::Population)];
            let title = keys.text("title", faults).map(|(text, _)| text);
            let unit = keys.text("unit", faults);
            let better = keys.choice("better", &better, faults).unwrap_or(Better::Neither);
            let section = keys.text("section", faults).map_or_else(String::new, |(text, _)| text);
            let help = keys.text("help", faults).map_or_else(String::new, |(text, _)| text);
            let se = keys.choice("se", &se, faults).unwrap_or_default();
            let chance = keys.ratio("chance", faults);
            let measures = keys.choice("measures", &Measures::NAMES, faults);
            let range = keys.table("range", faults).map(|range| value_range(range, faults));
            let finished = keys.text("finished", faults);
            let completes = keys.text("completes", faults);
            let when = keys.expression("when", faults);
            let present = keys.has("value");
            let value = keys.expression("value", faults);
            keys.refuse_the_rest(faults);
            match value {
                Some(value) => {
                    let entry = MetricEntry {
                        place,
                        title,
                        unit,
                        better,
                        section,
                        help,
                        value,
                        when,
                        se,
                        chance,
                        measures,
                        range,
                        finished,
                        completes,
                    };
                    self.document.metrics.insert(name, entry);
                }
                None if present => {}
                None => self.missing(place, "value", "a metric"),
            }
        }
    }

    fn experiments(&mut self, root: &mut Keys) {
        for (name, _, mut keys) in root.tables("experiment", &mut self.faults) {
            let faults = &mut self.faults;
            let title = keys.text("title", faults).map_or_else(String::new, |(text, _)| text);
            let order = keys.integer("order", faults);
            let chance = match keys.table("chance", faults) {
                Some(levels) => levels.each(|levels, name| levels.level(name, faults)),
                None => IndexMap::new(),
            };
            let reference = match keys.table("reference", faults) {
                Some(levels) => levels.each(|levels, name| levels.ratios(name, faults)),
                None => IndexMap::new(),
            };
            keys.refuse_the_rest(faults);
            self.document.experiments.insert(name, ExperimentEntry { title, order, chance, reference });
        }
    }

    fn missing(&mut self, place: Place, key: &str, what: &str) {
        self.faults.push(Fault::new(place, format!("{what} needs `{key}`")).help(format!("add `{key} = \"...\"`")));
    }
}

fn value_range(mut keys: Keys, faults: &mut Vec<Fault>) -> ValueRange {
    let range = ValueRange { least: keys.integer("least", faults), most: keys.integer("most", faults) };
    keys.refuse_the_rest(faults);
    range
}

//! A checked definition file: its catalog for readers, its plan for the kernels.

use std::path::Path;

use indexmap::IndexMap;

use super::bind::{self, Binding};
use super::catalogs::catalog::{Better, Catalog, Control, DecimalColumn, Experiment, Kind, Metric, by_order, is_share};
use super::catalogs::measure;
use super::columns::{ColumnOrigin, Columns, KnownColumn, Level, Type};
use super::file::{self, ColumnEntry, Document, FileError};
use super::logical_plan::plan::{NodeId, Output, Plan};
use mirrorstats_exact::hash;
use mirrorstats_exact::suggest::did_you_mean;
use mirrorstats_toml_spec::{Fault, Faults, Source, Written};

#[derive(Clone, Debug)]
pub struct Definitions {
    pub catalog: Catalog,
    pub plan: Plan,
    document: Document,
}

impl Definitions {
    /// Reads and checks a built-in file by name (`paper`, `extended`, `battery`, `evidence`, `reach`,
    /// `reach-fallback`), or any other by path. `columns` are those of the traces; the columns that the file declares
    /// are added.
    pub fn load(name_or_path: impl AsRef<Path>, columns: &Columns) -> Result<Self, FileError> {
        Ok(Self::check(file::read(name_or_path.as_ref())?, columns, None)?)
    }

    pub fn from_toml(name: &str, text: &str, columns: &Columns) -> Result<Self, FileError> {
        let source = Source { name: format!("{name}.toml"), text: text.to_owned() };
        Ok(Self::check(file::read_source(name.to_owned(), source, None)?, columns, None)?)
    }

    /// Definitions without metrics that accept every experiment, for a scan that filters or counts.
    pub fn without_metrics(columns: &Columns) -> Result<Self, Faults> {
        Self::check(Document { name: "episodes".to_owned(), open: true, ..Document::default() }, columns, None)
    }

    pub fn filtered(self, shown: &str, condition: &str, columns: &Columns) -> Result<Self, Faults> {
        let source = Source { name: shown.to_owned(), text: condition.to_owned() };
        Self::check(self.document, columns, Some(&Written::whole(source.into())))
    }

    /// The same definitions with another expression for this `let`, checked anew, without a filter and with all
    /// metrics.
    pub fn with_condition_let(
        &self,
        name: &str,
        shown: &str,
        expression: &str,
        columns: &Columns,
    ) -> Result<Self, ReplaceError> {
        let node = self.plan.lets.iter().find(|(known, _)| known == name).map(|(_, node)| self.plan.node(*node));
        match node {
            Some(node) if node.ty == Type::Bool && node.level == Level::Step => {}
            Some(node) => {
                let found = format!("{}, {}", node.ty.name(), per(node.level));
                return Err(ReplaceError::NoCondition { name: name.to_owned(), found });
            }
            None => {
                let known: Vec<&str> = self.plan.lets.iter().map(|(known, _)| known.as_str()).collect();
                let found = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
                return Err(ReplaceError::NoLet { name: name.to_owned(), found });
            }
        }
        let mut document = self.document.clone();
        let written = Written::whole(Source { name: shown.to_owned(), text: expression.to_owned() }.into());
        if let Some((text, place)) = document.lets.get_mut(name) {
            *place = written.everywhere();
            *text = written;
        }
        Ok(Self::check(document, columns, None)?)
    }

    pub fn select(&mut self, names: &[String]) -> Result<(), UnknownMetric> {
        if let Some(name) = names.iter().find(|name| !self.catalog.metric.contains_key(*name)) {
            return Err(UnknownMetric::new(name, &self.catalog.metric.keys().cloned().collect::<Vec<_>>()));
        }
        self.plan.select(names);
        Ok(())
    }

    /// The `let` or metric of exactly this node; a `let` comes first.
    pub fn name_of(&self, node: NodeId) -> Option<String> {
        let lets = self.plan.lets.iter().find(|(_, known)| *known == node).map(|(name, _)| name.clone());
        lets.or_else(|| self.plan.outputs.iter().find(|output| output.node == node).map(|output| output.name.clone()))
    }

    /// Returns true if these definitions can score an experiment with the definitions `own`: they are or include those,
    /// they have a table for it, or they have no tables. If `own` is a file, any file may be a later version of it.
    pub fn scores(&self, experiment: &str, own: &str, own_hash: Option<&str>) -> bool {
        let document = &self.document;
        let is_own = own_hash.map_or_else(|| document.built_on.contains(&own), |_| document.file_hash.is_some());
        is_own || document.experiments.is_empty() || document.experiments.contains_key(experiment)
    }

    /// Merges definitions, each for its own experiments: elsewhere its metrics are undefined. `None` if two of them
    /// give a name different meanings.
    pub fn side_by_side(parts: &[(Self, Vec<String>)], columns: &Columns) -> Option<Result<Self, Faults>> {
        let names: Vec<&str> = parts.iter().map(|(part, _)| part.document.name.as_str()).collect();
        let mut whole = Document { name: names.join("+"), open: true, ..Document::default() };
        for (part, experiments) in parts {
            let Document { domain, columns, lets, metrics, experiments: known, factors, built_on, .. } =
                part.document.clone();
            whole.domain = whole.domain.or(domain);
            let same = |(name, (written, _)): (&String, &(Written, _))| {
                whole.lets.get(name).is_none_or(|(other, _): &(Written, _)| other.text == written.text)
            };
            let is_new = |name: &String| !whole.metrics.contains_key(name) && !whole.lets.contains_key(name);
            if !lets.iter().all(same) || !metrics.keys().all(is_new) {
                return None;
            }
            let quoted: Vec<String> =
                experiments.iter().map(|name| format!("'{}'", name.replace('\'', "''"))).collect();
            let here = format!("experiment in ({})", quoted.join(", "));
            whole.built_on.extend(built_on);
            whole.lets.extend(lets);
            whole.columns.extend(columns);
            whole.experiments.extend(known);
            whole.factors.extend(factors);
            whole.metrics.extend(metrics.into_iter().map(|(name, entry)| {
                let when = entry.when.map_or_else(|| here.clone(), |when| format!("({}) and {here}", when.text));
                let when = Written::whole(Source { name: "the experiments".to_owned(), text: when }.into());
                (name, file::MetricEntry { when: Some(when), ..entry })
            }));
        }
        Some(Self::check(whole, columns, None))
    }

    pub fn declared_columns(&self) -> impl Iterator<Item = (&str, &ColumnEntry)> {
        self.document.columns.iter().map(|(name, entry)| (name.as_str(), entry))
    }

    pub(super) fn document(&self) -> &Document {
        &self.document
    }

    fn check(document: Document, columns: &Columns, filter: Option<&Written>) -> Result<Self, Faults> {
        let mut columns = columns.clone();
        if document.domain.is_some() {
            columns.leave_mirror();
        }
        let mut faults = declare(&document, &mut columns);
        faults.extend(experiment_faults(&document));
        faults.extend(measure::relation_faults(&document));
        let binding = bind::bind(&document, &columns, filter).map_err(|more| faults.extend(more));
        if let Ok(binding) = &binding {
            faults.extend(level_faults(&document, binding));
            faults.extend(duration_faults(&document, binding));
            faults.extend(measure::faults(&document, binding));
        }
        let Some(binding) = binding.ok().filter(|_| faults.is_empty()) else { return Err(Faults(faults).in_order()) };
        Ok(Self { catalog: catalog(&document, &binding), plan: binding.plan, document })
    }
}

#[derive(Debug, thiserror::Error)]
pub enum ReplaceError {
    #[error(
        "expected a `let` named `{name}`, which says at which steps there is evidence, found {found}\n  \
         help: name the condition in the definition file, `{name} = \"mirror_visible\"` under `[let]`, and use it in the metrics"
    )]
    NoLet { name: String, found: String },
    #[error(
        "expected the `let` `{name}` to be true or false, one value per step, found {found}\n  \
         help: let `{name}` say at which steps there is evidence, such as \"mirror_visible\""
    )]
    NoCondition { name: String, found: String },
    #[error("{0}")]
    Faults(#[from] Faults),
}

const fn per(level: Level) -> &'static str {
    match level {
        Level::Constant => "a constant",
        Level::Episode => "one value per episode",
        Level::Step => "one value per step",
    }
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown metric `{name}`: {help}")]
pub struct UnknownMetric {
    name: String,
    help: String,
}

impl UnknownMetric {
    pub fn new(name: &str, known: &[String]) -> Self {
        let near = did_you_mean(name, known.iter().map(String::as_str));
        Self { name: name.to_owned(), help: near.unwrap_or_else(|| format!("metrics are {}", known.join(", "))) }
    }
}

/// Adds the columns that a document declares, unless they contradict the schema or the traces.
fn declare(document: &Document, columns: &mut Columns) -> Vec<Fault> {
    let mut faults = Vec::new();
    for (name, ColumnEntry { place, column: declared, values, decimals, .. }) in &document.columns {
        let known = columns.known(name);
        if name == "t" || known.is_some_and(|known| known.is_of_schema() && known.column != *declared) {
            let message = format!("`{name}` is a column of every trace and cannot be declared as another");
            faults.push(
                Fault::new(place.clone(), message).help("remove the declaration: `mirrorstats trace schema` has it"),
            );
        } else if let Some(found) = known.filter(|known| known.origin == ColumnOrigin::Own).map(|known| known.column.ty)
            && found != declared.ty
        {
            let (declared, found) = (declared.ty.name(), found.name());
            let message = format!("`{name}` is declared as {declared}, and is {found} in the traces");
            faults.push(Fault::new(place.clone(), message).help("declare it as the traces have it"));
        } else {
            let own = KnownColumn::new(*declared, ColumnOrigin::Own);
            columns.add(name.clone(), KnownColumn { values: values.clone(), ..own });
            columns.set_decimals(name, *decimals);
        }
    }
    faults
}

fn experiment_faults(document: &Document) -> Vec<Fault> {
    let mut faults = Vec::new();
    for (own, entry) in &document.experiments {
        let levels = entry.levels.iter().map(|((_, name), place)| (name, place));
        let control = entry.experiment.control.as_ref().zip(entry.control.as_ref());
        let compared = control.iter().flat_map(|(control, (_, places))| control.on.iter().zip(places));
        let named = levels.chain(compared);
        faults.extend(named.filter_map(|(name, place)| document.unknown_metric(name, place)));
        let Some((Control { of, .. }, (place, _))) = control else { continue };
        if of == own {
            faults.push(Fault::new(place.clone(), format!("`{own}` cannot be its own control")));
        } else {
            faults.extend(document.unknown_experiment(of, place));
        }
    }
    for (factor, places) in document.factors.values() {
        let named = factor.values.keys().zip(places);
        faults.extend(named.filter_map(|(name, place)| document.unknown_experiment(name, place)));
    }
    faults
}

/// A duration counts steps: its methods count the episodes that still run at each of them.
fn duration_faults(document: &Document, binding: &Binding) -> Vec<Fault> {
    let is_decimal = |name: &String| binding.output(name).is_some_and(|output| output.decimals > 0);
    let durations = document.metrics.iter().filter(|(name, entry)| entry.said.finished.is_some() && is_decimal(name));
    let fault = |(name, entry): (&String, &file::MetricEntry)| {
        Fault::new(entry.finished.clone(), format!("the duration `{name}` has decimals; expected a number of steps"))
            .help("leave out `finished`, or round it to whole steps: `round(x, 0)`")
    };
    durations.map(fault).collect()
}

fn level_faults(document: &Document, binding: &Binding) -> Vec<Fault> {
    let of_metrics = document.metrics.iter().filter_map(|(name, entry)| Some((name, entry.chance?, &entry.place)));
    let of_experiments = document.experiments.values().flat_map(|entry| {
        let levels = entry.experiment.levels();
        levels.map(|(key, name, level)| (name, level, &entry.levels[&(key, name.clone())]))
    });
    let mut faults = Vec::new();
    for (name, level, place) in of_metrics.chain(of_experiments) {
        let is_rate = binding.output(name).is_some_and(|output| output.kind == Kind::Rate);
        if is_rate && !is_share(level) {
            let message = format!("the chance level of the rate `{name}` is {level}; expected a fraction from 0 to 1");
            faults.push(Fault::new(place.clone(), message));
        }
    }
    faults
}

fn catalog(document: &Document, binding: &Binding) -> Catalog {
    let mut catalog = Catalog {
        name: document.name.clone(),
        hash: String::new(),
        domain: document.domain.clone(),
        // A file that lists no experiments accepts all.
        open: document.open || document.experiments.is_empty(),
        lets: document.lets.iter().map(|(name, (written, _))| (name.clone(), written.text.clone())).collect(),
        columns: decimal_columns(document),
        metric: metrics(document, binding),
        experiment: experiments(document),
        factor: document.factors.iter().map(|(name, (factor, _))| (name.clone(), factor.clone())).collect(),
    };
    catalog.hash = content_hash(&catalog);
    catalog
}

/// The hash of the meaning of the definitions: comments, layout and the file's name do not count.
fn content_hash(catalog: &Catalog) -> String {
    let nameless = Catalog { name: String::new(), hash: String::new(), ..catalog.without_declared() };
    let text = serde_json::to_string(&nameless).expect("a catalog holds texts, integers and maps with text keys");
    hash::of_bytes(text.as_bytes())
}

fn decimal_columns(document: &Document) -> IndexMap<String, DecimalColumn> {
    let column = |(name, entry): (&String, &ColumnEntry)| {
        let (ty, constant) = (entry.column.ty, entry.column.level == Level::Episode);
        let column = DecimalColumn { ty, constant, decimals: entry.decimals?, unit: entry.unit.clone() };
        Some((name.clone(), column))
    };
    document.columns.iter().filter_map(column).collect()
}

fn metrics(document: &Document, binding: &Binding) -> IndexMap<String, Metric> {
    let metric = |((name, entry), output): ((&String, &file::MetricEntry), &Output)| {
        let (kind, decimals) = (output.kind, output.decimals);
        let default_unit = || match (&binding.units[name], kind) {
            (Some(unit), Kind::Quantity) => unit.clone(),
            _ if decimals > 0 => String::new(),
            _ => kind.default_unit().to_owned(),
        };
        let said = entry.said.clone();
        let metric = Metric {
            title: said.title.unwrap_or_else(|| name.clone()),
            kind,
            unit: said.unit.unwrap_or_else(default_unit),
            decimals,
            better: said.better.unwrap_or(Better::Neither),
            section: said.section,
            help: said.help,
            value: entry.value.text.clone(),
            when: entry.when.as_ref().map(|when| when.text.clone()),
            se: said.se,
            chance: entry.chance,
            measures: said.measures,
            range: said.range,
            finished: said.finished,
            completes: said.completes,
        };
        (name.clone(), metric)
    };
    document.metrics.iter().zip(&binding.plan.outputs).map(metric).collect()
}

fn experiments(document: &Document) -> IndexMap<String, Experiment> {
    let experiment = |(position, (name, entry)): (i64, (&String, &file::ExperimentEntry))| {
        let order = entry.order.unwrap_or(position);
        (name.clone(), Experiment { order, ..entry.experiment.clone() })
    };
    let mut experiments: IndexMap<String, Experiment> = (1..).zip(&document.experiments).map(experiment).collect();
    experiments.sort_by(by_order);
    experiments
}

#[cfg(test)]
mod tests {
    use super::{Definitions, ReplaceError};
    use crate::tests::schema_columns;

    #[test]
    fn a_replaced_condition_equals_an_edited_file() {
        let columns = schema_columns();
        let paper = Definitions::load("paper", &columns).unwrap();
        let replaced = paper.with_condition_let("visible", "test", "mirror_self_px >= 7", &columns).unwrap();
        let text = "include = [\"paper\"]\n[let]\nvisible = \"mirror_self_px >= 7\"\n";
        let edited = Definitions::from_toml("edited", text, &columns).unwrap();
        assert_eq!((&replaced.catalog.hash, &replaced.plan), (&edited.catalog.hash, &edited.plan));
        assert_ne!(replaced.catalog.hash, paper.catalog.hash);
    }

    #[test]
    fn an_unknown_unsuitable_or_invalid_condition_is_refused() {
        let columns = schema_columns();
        let paper = Definitions::load("paper", &columns).unwrap();
        let error = |name: &str, text: &str| paper.with_condition_let(name, "test", text, &columns).unwrap_err();
        assert!(matches!(error("seen", "true"), ReplaceError::NoLet { .. }));
        assert!(matches!(error("done", "true"), ReplaceError::NoCondition { .. }));
        assert!(matches!(error("visible", "mirror_self_pix > 1"), ReplaceError::Faults(_)));
    }
}

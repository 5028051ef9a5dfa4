//! Experiments that traces declare and the definitions lack: they extend a catalog to cover all episodes of the traces.
//!
//! Rule: the definitions take precedence; files that declare the same experiment must agree. The order of the files
//! only affects which of them an error names first.

use std::fmt::Debug;

use indexmap::IndexMap;

use mirrorstats_exact::chance::Chance;
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::ratio::Ratio;
use mirrorstats_metric::catalogs::catalog::{Catalog, Experiment, Kind, is_share};
use mirrorstats_trace::footers::declared_experiment::DeclaredExperiment;
use mirrorstats_trace::read::open::TraceSet;

/// An experiment that two files declare differently, or with a level that no rate can have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{file}: expected {expected}, found {found}\n  help: {help}")]
pub struct DeclarationError {
    pub file: String,
    pub expected: String,
    pub found: String,
    pub help: &'static str,
}

/// Experiments, each with the first file that declares it.
#[derive(Clone, Debug, Default)]
pub struct Declarations(IndexMap<String, (String, Experiment)>);

impl Declarations {
    pub fn add(&mut self, file: &str, name: &str, experiment: Experiment) -> Result<(), DeclarationError> {
        let Some((first_file, known)) = self.0.get(name) else {
            self.0.insert(name.to_owned(), (file.to_owned(), experiment));
            return Ok(());
        };
        let Some((what, first, second)) = difference(known, &experiment) else { return Ok(()) };
        Err(DeclarationError {
            file: file.to_owned(),
            expected: format!(
                "the {what} of the experiment `{}` as `{first_file}` declares it, {first}",
                visible(name)
            ),
            found: second,
            help: "leave one of the files out, or say in a definition file what counts, under `[experiment.NAME]`",
        })
    }
}

pub fn declare(catalog: &mut Catalog, traces: &TraceSet) -> Result<(), DeclarationError> {
    let (declarations, errors) = declarations(catalog, traces);
    if let Some(error) = errors.into_iter().next() {
        return Err(error);
    }
    catalog.declare(declarations.0.into_iter().map(|(name, (_, experiment))| (name, experiment)));
    Ok(())
}

/// All errors that [`declare`] can return, in the order of the files.
pub fn faults(catalog: &Catalog, traces: &TraceSet) -> Vec<DeclarationError> {
    declarations(catalog, traces).1
}

fn declarations(catalog: &Catalog, traces: &TraceSet) -> (Declarations, Vec<DeclarationError>) {
    let (mut found, mut errors) = (Declarations::default(), Vec::new());
    for file in traces.files() {
        for declared in file.experiments().iter().filter(|declared| !catalog.experiment.contains_key(&declared.name)) {
            let experiment = resolved(declared, catalog);
            errors.extend(no_share(file.name(), &declared.name, &experiment, catalog));
            errors.extend(found.add(file.name(), &declared.name, experiment).err());
        }
    }
    (found, errors)
}

/// The order of an experiment that is declared without one: after all others.
const LAST: i64 = i64::MAX;

/// A declaration for the catalog: last if it gives no order, without levels of unknown metrics.
fn resolved(declared: &DeclaredExperiment, catalog: &Catalog) -> Experiment {
    let has = |metric: &String| catalog.metric.contains_key(metric);
    let mut experiment = Experiment {
        title: declared.title.clone().unwrap_or_default(),
        order: declared.order.unwrap_or(LAST),
        chance: declared.chance.clone(),
        reference: declared.reference.clone(),
        is_declared: true,
        control: None,
    };
    experiment.chance.retain(|metric, _| has(metric));
    experiment.reference.retain(|metric, _| has(metric));
    experiment
}

fn no_share(file: &str, name: &str, experiment: &Experiment, catalog: &Catalog) -> Option<DeclarationError> {
    let is_rate = |metric: &String| catalog.metric.get(metric).is_some_and(|metric| metric.kind == Kind::Rate);
    let mut wrong = experiment.levels().filter(|(_, metric, level)| is_rate(metric) && !is_share(*level));
    let (kind, metric, level) = wrong.next()?;
    let (name, metric) = (visible(name), visible(metric));
    Some(DeclarationError {
        file: file.to_owned(),
        expected: format!(
            "the {kind} level of the rate {metric} of the experiment `{name}` to be a fraction from 0 to 1"
        ),
        found: level.to_string(),
        help: "correct the level in the footer, or set it in a definition file under `[experiment.NAME]`",
    })
}

fn difference(one: &Experiment, other: &Experiment) -> Option<(String, String, String)> {
    if one.title != other.title {
        let quoted = |title: &str| match title {
            "" => "not given".to_owned(),
            title => format!("`{}`", visible(title)),
        };
        return Some(("title".to_owned(), quoted(&one.title), quoted(&other.title)));
    }
    if one.order != other.order {
        let words = |order: i64| if order == LAST { "not given".to_owned() } else { order.to_string() };
        return Some(("order".to_owned(), words(one.order), words(other.order)));
    }
    differing_level("chance", &one.chance, &other.chance, |level| spelled(level.as_ref()))
        .or_else(|| differing_level("reference", &one.reference, &other.reference, |levels| listed(levels)))
}

fn differing_level<T: PartialEq + Debug>(
    kind: &str,
    one: &IndexMap<String, T>,
    other: &IndexMap<String, T>,
    words: impl Fn(&T) -> String,
) -> Option<(String, String, String)> {
    let mut metrics = one.keys().chain(other.keys());
    let metric = metrics.find(|metric| one.get(*metric) != other.get(*metric))?;
    let of = |levels: &IndexMap<String, T>| levels.get(metric).map_or_else(|| "not given".to_owned(), &words);
    Some((format!("{kind} level of {}", visible(metric)), of(one), of(other)))
}

pub fn spelled(level: Option<&Chance>) -> String {
    level.map_or_else(|| "none".to_owned(), ToString::to_string)
}

pub fn listed(levels: &[Ratio]) -> String {
    levels.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

//! Compares experiments in traces with those in the definitions. The definitions take precedence, and differences are
//! reported. Files must agree on experiments that the definitions do not know.

use mirrorstats_exact::escape::visible;
use mirrorstats_metric::catalogs::catalog::{Catalog, Experiment};
use mirrorstats_score::tables::declared_experiments::{DeclarationError, faults, listed, spelled};
use mirrorstats_trace::diagnostic::{Code, Finding};
use mirrorstats_trace::footers::declared_experiment::DeclaredExperiment;
use mirrorstats_trace::read::open::{TraceFile, TraceSet};

/// A note for each title, order or level in a footer that differs from the definitions, or whose metric they lack. An
/// error for each experiment that only footers know, if they disagree.
pub(crate) fn experiment_findings(catalog: &Catalog, traces: &TraceSet) -> Vec<Finding> {
    let mut found: Vec<Finding> = traces.files().iter().flat_map(|file| notes(file, catalog)).collect();
    found.extend(faults(catalog, traces).into_iter().map(finding));
    found
}

fn finding(error: DeclarationError) -> Finding {
    Finding::new(Code::InvalidMetadata, error.file, error.expected, error.found).with_help(error.help)
}

fn notes(file: &TraceFile, catalog: &Catalog) -> Vec<Finding> {
    let mut found = Vec::new();
    for declared in file.experiments() {
        found.extend(overridden(file.name(), declared, catalog));
        found.extend(unknown_levels(file.name(), declared, catalog));
    }
    found
}

fn overridden(file: &str, declared: &DeclaredExperiment, catalog: &Catalog) -> Vec<Finding> {
    let Some(known) = catalog.experiment.get(&declared.name) else { return Vec::new() };
    let finding = |(what, expected, found): (String, String, String)| {
        let expected = format!("the {what} of `{}` as the definitions give it: {expected}", visible(&declared.name));
        Finding::new(Code::ExperimentOverridden, file, expected, found)
    };
    differences(declared, known).into_iter().map(finding).collect()
}

fn unknown_levels(file: &str, declared: &DeclaredExperiment, catalog: &Catalog) -> Vec<Finding> {
    let chance = declared.chance.keys().map(|metric| ("chance", metric));
    let levels = chance.chain(declared.reference.keys().map(|metric| ("reference", metric)));
    let unknown = levels.filter(|(_, metric)| !catalog.metric.contains_key(*metric));
    let finding = |(kind, metric): (&str, &String)| {
        let name = visible(&declared.name);
        let expected = format!("each {kind} level of `{name}` to be that of a metric of the definitions");
        Finding::new(Code::UnknownLevel, file, expected, format!("one of `{}`", visible(metric)))
    };
    unknown.map(finding).collect()
}

fn differences(declared: &DeclaredExperiment, known: &Experiment) -> Vec<(String, String, String)> {
    let mut found = Vec::new();
    let quoted = |text: &str| format!("`{}`", visible(text));
    if let Some(title) = declared.title.as_deref().filter(|title| !known.title.is_empty() && *title != known.title) {
        found.push(("title".to_owned(), quoted(&known.title), quoted(title)));
    }
    if let Some(order) = declared.order.filter(|order| *order != known.order) {
        found.push(("order".to_owned(), known.order.to_string(), order.to_string()));
    }
    let chance = declared.chance.iter().filter_map(|(metric, level)| {
        let own = known.chance.get(metric).filter(|own| *own != level)?;
        Some((format!("chance level of {}", visible(metric)), spelled(own.as_ref()), spelled(level.as_ref())))
    });
    let reference = declared.reference.iter().filter_map(|(metric, levels)| {
        let own = known.reference.get(metric).filter(|own| *own != levels)?;
        Some((format!("reference level of {}", visible(metric)), listed(own), listed(levels)))
    });
    found.extend(chance.chain(reference));
    found
}

#[cfg(test)]
mod tests {
    use super::{DeclaredExperiment, differences};
    use mirrorstats_exact::chance::Chance;
    use mirrorstats_exact::ratio::Ratio;
    use mirrorstats_metric::definitions::Definitions;
    use mirrorstats_score::vocabulary::schema_columns;

    #[test]
    fn differing_declarations_are_reported_and_missing_ones_are_not() {
        let catalog = Definitions::load("paper", &schema_columns()).unwrap().catalog;
        let known = &catalog.experiment["E5"];
        let mut declared = DeclaredExperiment {
            name: "E5".to_owned(),
            title: Some(known.title.clone()),
            order: Some(known.order),
            chance: known.chance.clone(),
            reference: known.reference.clone(),
            definitions: None,
            definitions_hash: None,
            absent: Vec::new(),
            answers: Vec::new(),
        };
        declared.chance.insert("NEW".to_owned(), None);
        assert!(differences(&declared, known).is_empty());
        assert!(differences(&DeclaredExperiment { title: None, order: None, ..declared.clone() }, known).is_empty());
        declared.title = Some("Other".to_owned());
        declared.order = Some(6);
        declared.chance.insert("TSA".to_owned(), "1/4".parse::<Ratio>().ok().map(Chance::Of));
        declared.reference.insert("TSA".to_owned(), vec!["1/10".parse().unwrap()]);
        let found = differences(&declared, known);
        let told: Vec<_> = found.iter().map(|(what, own, other)| [what, own, other].map(String::as_str)).collect();
        assert_eq!(told[0], ["title", "`Robust self-identification under occlusion`", "`Other`"]);
        assert_eq!(told[1], ["order", "5", "6"]);
        assert_eq!(told[2], ["chance level of TSA", "none", "1/4"]);
        assert_eq!(told[3], ["reference level of TSA", "1/10, 1/11", "1/10"]);
    }
}

//! What a trace says of its experiment beside what the definitions say: the definitions count, and the difference is told.

use serde_json::Value;

use super::error::StudyError;
use crate::base::escape::visible;
use crate::metric::catalog::{Catalog, Experiment};
use crate::metric::definitions::Definitions;
use crate::score::score_traces::schema_columns;
use crate::trace::diagnostic::{Code, Finding};
use crate::trace::inputs::Input;
use crate::trace::open::TraceFile;
use crate::trace::schema::RECORDING_KEY;

/// A note for each title and chance level in a footer that the definitions give otherwise. Files that cannot be opened say
/// nothing here.
///
/// # Errors
/// Every fault of the definitions.
pub fn overridden_experiments(definitions: &str, inputs: &[Input]) -> Result<Vec<Finding>, StudyError> {
    let catalog = Definitions::load(definitions, &schema_columns())?.catalog;
    let files = inputs.iter().filter_map(|input| TraceFile::open(input).ok());
    Ok(files.flat_map(|file| of_file(&file, &catalog)).collect())
}

fn of_file(file: &TraceFile, catalog: &Catalog) -> Vec<Finding> {
    let recording: Value =
        file.metadata_value(RECORDING_KEY).and_then(|text| serde_json::from_str(text).ok()).unwrap_or_default();
    let told = &recording["experiment"];
    let Some((name, known)) = told["name"].as_str().and_then(|name| Some((name, catalog.experiment.get(name)?))) else {
        return Vec::new();
    };
    differences(told, known)
        .into_iter()
        .map(|(what, expected, found)| {
            let expected = format!("the {what} of `{}` as the definitions give it: {expected}", visible(name));
            Finding::new(Code::ExperimentOverridden, file.name(), expected, found)
        })
        .collect()
}

/// What differs, as the definitions and as the trace have it. What only one of them gives is no difference.
fn differences(told: &Value, known: &Experiment) -> Vec<(String, String, String)> {
    let mut found = Vec::new();
    let quoted = |text: &str| format!("`{}`", visible(text));
    if let Some(title) = told["title"].as_str().filter(|title| !known.title.is_empty() && *title != known.title) {
        found.push(("title".to_owned(), quoted(&known.title), quoted(title)));
    }
    for (metric, level) in told["chance"].as_object().into_iter().flatten() {
        let own = known.chance.get(metric).map(|own| own.map_or_else(|| "none".to_owned(), |own| own.to_string()));
        let level = level.as_str().map_or_else(|| level.to_string(), str::to_owned);
        if let Some(own) = own.filter(|own| *own != level) {
            found.push((format!("chance level of {}", visible(metric)), own, visible(&level)));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::{differences, schema_columns};
    use crate::metric::definitions::Definitions;

    #[test]
    fn a_title_and_a_level_that_differ_are_told_and_others_are_not() {
        let catalog = Definitions::load("paper", &schema_columns()).unwrap().catalog;
        let known = &catalog.experiment["E1"];
        let same = json!({ "name": "E1", "title": known.title, "chance": { "TSA": "1/3", "NEW": "1/2" } });
        assert!(differences(&same, known).is_empty());
        let other = json!({ "name": "E1", "title": "Other", "chance": { "TSA": "1/4" } });
        let found = differences(&other, known);
        assert_eq!(found.len(), 2);
        assert_eq!(found[0].2, "`Other`");
        assert_eq!(found[1], ("chance level of TSA".to_owned(), "1/3".to_owned(), "1/4".to_owned()));
    }
}

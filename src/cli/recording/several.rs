//! Several recordings in one command: the options of `record` in a study file, once per condition and model, and how all of
//! them ended.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use crate::cli::Options;
use crate::cli::commands::record::Recorded;
use crate::cli::outcome::{Failure, Outcome};
use crate::cli::recording::RecordAnswer;
use exact::budget::Limit;
use exact::input;

/// A study file is written by hand.
const LARGEST: Limit = Limit::new("bytes of a study file", 1 << 20);
/// The condition without a name.
const DEFAULT: &str = "default";

/// Options of `record` without their dashes: for all, over those for one condition, over those for one model.
#[derive(Debug, Deserialize)]
struct StudyFile {
    #[serde(default)]
    condition: BTreeMap<String, Options>,
    #[serde(default)]
    model: BTreeMap<String, Options>,
    #[serde(flatten)]
    options: Options,
}

/// The options of each recording of a study, by condition and model.
pub fn recordings(path: &Path) -> Result<Vec<Options>, Failure> {
    let place = path.display();
    let fault =
        |fault: &dyn std::fmt::Display| Failure::input(format!("the study in `{place}` cannot be used: {fault}"));
    let text = input::text(path, LARGEST).map_err(|error| fault(&error))?;
    let mut study: StudyFile = toml::from_str(&text).map_err(|error| fault(&error))?;
    if study.model.is_empty() {
        return Err(fault(&"expected a table for each model, such as [model.\"Claude Sonnet 4.6\"], found none"));
    }
    if study.condition.is_empty() {
        study.condition.insert(DEFAULT.to_owned(), Options::new());
    }
    let StudyFile { condition, model, options } = study;
    let each = condition.iter().flat_map(|of_condition| model.iter().map(move |of_model| (of_condition, of_model)));
    Ok(each
        .map(|((condition, of_condition), (model, of_model))| {
            let mut all = options.clone();
            all.entry("agent").or_insert_with(|| "vlm".into());
            all.insert("model".to_owned(), model.as_str().into());
            if condition != DEFAULT {
                all.insert("condition".to_owned(), condition.as_str().into());
            }
            all.extend(of_condition.clone());
            all.extend(of_model.clone());
            all
        })
        .collect())
}

/// The reason why a recording could not go on.
pub fn stopped(recorded: &Result<Recorded, Failure>) -> Option<String> {
    match recorded {
        Ok(recorded) => recorded.gave_up.clone(),
        Err(failure) => Some(failure.to_string()),
    }
}

/// The exit code of several recordings.
pub fn outcome(all: Vec<Result<Recorded, Failure>>, asked: usize) -> Result<Outcome, Failure> {
    let stopped = all.iter().filter_map(stopped).count();
    let mut outcome = Outcome::Done;
    for recorded in all {
        let failure = match recorded {
            Ok(Recorded { gave_up: Some(reason), .. }) => Failure::input(reason),
            Ok(recorded) => {
                outcome = worse(outcome, outcome_of(&recorded.answer));
                continue;
            }
            Err(failure) => failure,
        };
        return Err(match asked {
            1 => failure,
            _ => Failure::input(format!(
                "{stopped} of {asked} recordings were stopped; the first: {failure}\n  help: the same command goes on with all of them"
            )),
        });
    }
    Ok(outcome)
}

fn worse(one: Outcome, other: Outcome) -> Outcome {
    match (one, other) {
        (Outcome::Interrupted, _) | (_, Outcome::Interrupted) => Outcome::Interrupted,
        (Outcome::Done, other) => other,
        (one, _) => one,
    }
}

fn outcome_of(answer: &RecordAnswer) -> Outcome {
    match (answer.stopped, answer.lost.is_empty()) {
        (true, _) => Outcome::Interrupted,
        (false, true) => Outcome::Done,
        (false, false) => Outcome::CheckFailed,
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::recordings;

    #[test]
    fn a_study_is_options_by_condition_and_model() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("study.toml");
        let of = |text: &str| {
            std::fs::write(&path, text).unwrap();
            recordings(&path).map(serde_json::Value::from_iter)
        };
        let study =
            "seeds = 1\nno-log = true\nkeep-going = false\n[model.\"B 1\"]\nmax-cost = 2.5\n[model.a]\nseeds = 3\n";
        let all = json!({"agent": "vlm", "seeds": 1, "no-log": true, "keep-going": false, "model": "B 1"});
        let mut expected = [all.clone(), all];
        expected[0]["max-cost"] = json!(2.5);
        expected[1]["seeds"] = json!(3);
        expected[1]["model"] = json!("a");
        let expected = json!(expected);
        assert_eq!(of(study).unwrap(), expected);
        let conditions = "[model.a]\n[condition.near]\nconfig = \"near.toml\"\n[condition.default]\n";
        let plain = json!({"agent": "vlm", "model": "a"});
        let near = json!({"agent": "vlm", "model": "a", "condition": "near"});
        let expected = json!([plain, {"agent": "vlm", "model": "a", "condition": "near", "config": "near.toml"}]);
        assert_eq!(of(conditions).unwrap(), expected);
        assert_eq!(of("[model.a]\n[condition.near]\n").unwrap(), json!([near]));
        assert!(of("seeds = 1\n").unwrap_err().to_string().contains("expected a table for each model"));
        assert!(of("seeds = \n").unwrap_err().to_string().contains("study.toml"));
    }
}

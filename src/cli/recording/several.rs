//! Several recordings in one command: the options of `record` in a study file, once per condition and model, and their
//! joint outcome.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use clap::Command;
use serde_json::Value;
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

use crate::cli::config::{self, OptionFile};
use crate::cli::recording::{RecordAnswer, Recorded};
use crate::cli::{Failure, NAME, Options, Outcome};
use mirrorstats_exact::budget::{Budget, Limit};
use mirrorstats_exact::{input, suggest};
use mirrorstats_toml_spec::{Source, parse_toml};

const LARGEST: Limit = Limit::new("bytes of a study file", 1 << 20);
const MOST_RECORDINGS: Limit = Limit::new("recordings of a study, conditions times models", 2000);
/// Each recording has a copy of the options for all.
const MOST_COPIED: Limit = Limit::new("bytes of options of a study, those of all its recordings together", 16 << 20);
const DEFAULT: &str = "default";

const RECORD: &str = "record";

/// The options of each recording of a study: options of `record`, which are those of `A`, without dashes. Those for a model override those for a
/// condition, which override those for all.
pub fn recordings<A: clap::Args>(path: &Path) -> Result<Vec<Options>, Failure> {
    let place = path.display();
    let fault =
        |fault: &dyn std::fmt::Display| Failure::input(format!("the study in `{place}` cannot be used: {fault}"));
    let text = input::text(path, LARGEST).map_err(|error| fault(&error))?;
    let source = Arc::new(Source { name: place.to_string(), text });
    let (table, faults) = parse_toml(&source);
    let command = Command::new(NAME).subcommand(A::augment_args(Command::new(RECORD)));
    let choices = config::choices(&command, "");
    let mut reader = OptionFile::new(&source, &choices, faults);
    let (mut options, mut conditions, mut models) = (Options::new(), BTreeMap::new(), BTreeMap::new());
    for (key, value) in table.get_ref() {
        match (key.get_ref().as_ref(), value.get_ref()) {
            ("condition", DeValue::Table(of)) => conditions = sections(&mut reader, of),
            ("model", DeValue::Table(of)) => models = sections(&mut reader, of),
            (name, DeValue::Table(_)) => {
                let near = suggest::nearest(name, ["condition", "model"]).map(|near| format!("did you mean `{near}`?"));
                reader.fault(key.span(), format!("expected [condition.NAME] or [model.NAME], found [{name}]"), near);
            }
            _ => insert(&mut reader, &mut options, key, value),
        }
    }
    let (options, mut conditions, models) = reader.finish((options, conditions, models))?;
    if models.is_empty() {
        return Err(fault(&"expected a table for each model, such as [model.\"Claude Sonnet 4.6\"], found none"));
    }
    if conditions.is_empty() {
        conditions.insert(DEFAULT.to_owned(), Options::new());
    }
    let count = (conditions.len() as u64).saturating_mul(models.len() as u64);
    MOST_RECORDINGS.check(count).map_err(|exceeded| fault(&exceeded))?;
    let copied = Budget::new(MOST_COPIED);
    for (of, times) in [(&conditions, models.len()), (&models, conditions.len())] {
        let bytes: u64 = of.iter().map(|(name, of)| name.len() as u64 + bytes_of(of)).sum();
        copied.spend(bytes.saturating_mul(times as u64)).map_err(|exceeded| fault(&exceeded))?;
    }
    copied.spend(bytes_of(&options).saturating_mul(count)).map_err(|exceeded| fault(&exceeded))?;
    let each = conditions.iter().flat_map(|condition| models.iter().map(move |model| (condition, model)));
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

fn bytes_of(options: &Options) -> u64 {
    options.iter().map(|(key, value)| (key.len() + value.to_string().len()) as u64).sum()
}

fn sections(reader: &mut OptionFile<'_>, table: &DeTable<'_>) -> BTreeMap<String, Options> {
    let mut found = BTreeMap::new();
    for (name, value) in table {
        let mut options = Options::new();
        match value.get_ref() {
            DeValue::Table(of) => of.iter().for_each(|(key, value)| insert(reader, &mut options, key, value)),
            other => {
                reader.fault(value.span(), format!("expected a table of options, found {}", other.type_str()), None);
            }
        }
        found.insert(name.get_ref().to_string(), options);
    }
    found
}

fn insert(reader: &mut OptionFile<'_>, to: &mut Options, key: &Spanned<DeString<'_>>, value: &Spanned<DeValue<'_>>) {
    if let Some(setting) = reader.setting(key, value, Some(RECORD)) {
        to.insert(setting.option, json(value.get_ref(), &setting.values));
    }
}

/// A TOML value as JSON, with its words in their typed form.
fn json(value: &DeValue<'_>, typed: &[String]) -> Value {
    match (value, typed) {
        (DeValue::Array(_), all) => all.iter().map(|word| Value::from(word.as_str())).collect(),
        (DeValue::String(_), [word]) => word.as_str().into(),
        (_, [word]) => serde_json::from_str(word).unwrap_or_else(|_| word.as_str().into()),
        _ => Value::Null,
    }
}

/// The reason why a recording could not continue.
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

    use crate::cli::commands::record::RecordArgs;

    fn recordings(path: &std::path::Path) -> Result<Vec<crate::cli::Options>, crate::cli::Failure> {
        super::recordings::<RecordArgs>(path)
    }

    #[test]
    fn a_study_file_gives_options_per_condition_and_model() {
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
    #[test]
    fn every_fault_of_a_study_is_underlined_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("study.toml");
        let text = "sede = 1\nrepeats = \"two\"\n[modle.a]\n[model.a]\nmax-cots = 2\n[condition]\nnear = 3\n";
        std::fs::write(&path, text).unwrap();
        let told = recordings(&path).unwrap_err().to_string();
        for words in [
            "no option `--sede` of `record`",
            "did you mean `seed",
            "invalid value 'two'",
            "expected [condition.NAME] or [model.NAME], found [modle]",
            "did you mean `model`?",
            "no option `--max-cots` of `record`",
            "did you mean `max-cost`?",
            "expected a table of options, found integer",
        ] {
            assert!(told.contains(words), "{words}: {told}");
        }
        std::fs::write(&path, "[model.a]\n[condition.short]\nprompt = \"short\"\n").unwrap();
        let told = recordings(&path).unwrap_err().to_string();
        assert!(told.contains("`scenes = \"NAME\"`"), "{told}");
    }
}

//! The options of `record` in a study file, once per condition and model.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use clap::Command;
use serde_json::Value;
use toml::de::{DeTable, DeValue};

use crate::cli::config::{self, OptionFile};
use crate::cli::{Failure, NAME, Options};
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
    check::<A>(&source)?;
    let mut options: Options = toml::from_str(&source.text).map_err(|error| fault(&error))?;
    let [mut conditions, models] = ["condition", "model"].map(|kind| sections(&mut options, kind));
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

/// The tables `[kind.NAME]` by name, taken out of a study.
fn sections(study: &mut Options, kind: &str) -> BTreeMap<String, Options> {
    let tables = study.remove_entry(kind).and_then(|(key, value)| match value {
        Value::Object(tables) => Some(tables),
        option => {
            study.insert(key, option);
            None
        }
    });
    let tables = tables.into_iter().flatten();
    tables.filter_map(|(name, table)| Some((name, serde_json::from_value(table).ok()?))).collect()
}

/// Refuses a study with an unknown table or option, or an invalid value.
fn check<A: clap::Args>(source: &Arc<Source>) -> Result<(), Failure> {
    let (table, faults) = parse_toml(source);
    let command = Command::new(NAME).subcommand(A::augment_args(Command::new(RECORD)));
    let choices = config::choices(&command, "");
    let mut reader = OptionFile::new(source, &choices, faults);
    for (key, value) in table.get_ref() {
        match (key.get_ref().as_ref(), value.get_ref()) {
            ("condition" | "model", DeValue::Table(tables)) => check_tables(&mut reader, tables),
            (name, DeValue::Table(_)) => {
                let near = suggest::nearest(name, ["condition", "model"]).map(|near| format!("did you mean `{near}`?"));
                reader.fault(key.span(), format!("expected [condition.NAME] or [model.NAME], found [{name}]"), near);
            }
            _ => {
                reader.setting(key, value, Some(RECORD));
            }
        }
    }
    reader.finish(())
}

fn check_tables(reader: &mut OptionFile<'_>, tables: &DeTable<'_>) {
    for table in tables.values() {
        let DeValue::Table(options) = table.get_ref() else {
            let found = table.get_ref().type_str();
            reader.fault(table.span(), format!("expected a table of options, found {found}"), None);
            continue;
        };
        for (key, value) in options {
            reader.setting(key, value, Some(RECORD));
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::RecordArgs;

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
    }
}

//! The experiments that a footer declares: `experiment` or `experiments` in `mirrorstats.recording`, spelled as in a
//! definition file.
//!
//! Rule: keys that analysis does not need are ignored. An invalid value of a needed key is a fault of the file.

use std::fmt::Display;

use indexmap::IndexMap;
use serde_json::Value;

use crate::diagnostic::{Code, Finding};
use crate::episodes::answers;
use crate::schema::{DeclaredColumn, RECORDING_KEY, of_some_tasks};
use mirrorstats_exact::chance::Chance;
use mirrorstats_exact::ratio::Ratio;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeclaredExperiment {
    /// The value of the column `experiment` in its episodes; not empty.
    pub name: String,
    pub title: Option<String>,
    pub order: Option<i64>,
    /// Chance levels by metric; `None` says that the metric has none in this experiment.
    pub chance: IndexMap<String, Option<Chance>>,
    pub reference: IndexMap<String, Vec<Ratio>>,
    /// The definitions that score it, by name or by the path of the file; `None` if not declared.
    pub definitions: Option<String>,
    pub definitions_hash: Option<String>,
    /// Columns of `of_some_tasks` without a meaning in its task, in this order.
    pub absent: Vec<&'static str>,
    pub answers: Vec<DeclaredColumn>,
}

const HELP: &str = "write it as a definition file has it under `[experiment.NAME]`, or remove the key from the footer";

pub(crate) fn of_recording(file: &str, recording: &Value) -> Result<Vec<DeclaredExperiment>, Box<Finding>> {
    read(recording).map_err(|finding| Box::new(Finding { file: file.to_owned(), ..*finding }))
}

pub(crate) fn absent(declared: &[DeclaredExperiment]) -> Vec<&'static str> {
    let say_so = |name: &str| declared.iter().all(|experiment| experiment.absent.contains(&name));
    of_some_tasks().filter(|name| !declared.is_empty() && say_so(name)).collect()
}

fn read(recording: &Value) -> Result<Vec<DeclaredExperiment>, Box<Finding>> {
    let several = match &recording["experiments"] {
        Value::Null => &[],
        Value::Array(several) => several.as_slice(),
        other => return Err(fault("experiments", "a list of objects", other)),
    };
    let several = several.iter().enumerate().map(|(at, value)| (format!("experiments[{at}]"), value));
    // A bare name describes the rows but declares nothing.
    let one = Some(&recording["experiment"]).filter(|value| !value.is_null() && !value.is_string());
    let mut found: IndexMap<String, DeclaredExperiment> = IndexMap::new();
    for (key, value) in one.map(|value| ("experiment".to_owned(), value)).into_iter().chain(several) {
        let new = DeclaredExperiment::read(&key, value)?;
        let known = found.entry(new.name.clone()).or_insert_with(|| new.clone());
        if *known != new {
            return Err(fault(key, "what the same footer declares of this name elsewhere", value));
        }
    }
    Ok(found.into_values().collect())
}

impl DeclaredExperiment {
    fn read(key: &str, value: &Value) -> Result<Self, Box<Finding>> {
        let members = value.as_object().ok_or_else(|| fault(key, "an object", value))?;
        let member = |name: &str| members.get(name).filter(|value| !value.is_null());
        let text = |name: &str, expected| match member(name) {
            None => Ok(None),
            Some(Value::String(text)) => Ok(Some(text.clone())),
            Some(other) => Err(fault(format!("{key}.{name}"), expected, other)),
        };
        let missing = || fault(format!("{key}.name"), "a name", members.get("name").unwrap_or(&Value::Null));
        let name = text("name", "a name")?.filter(|name| !name.is_empty()).ok_or_else(missing)?;
        let whole =
            |order: &Value| order.as_i64().ok_or_else(|| fault(format!("{key}.order"), "a whole number", order));
        Ok(Self {
            name,
            title: text("title", "a text")?,
            order: member("order").map(whole).transpose()?,
            chance: levels(&format!("{key}.chance"), member("chance"), chance)?,
            reference: levels(&format!("{key}.reference"), member("reference"), reference)?,
            definitions: text("definitions", "the name of definitions")?,
            definitions_hash: text("definitions_hash", "a hash")?,
            absent: columns(&format!("{key}.absent"), member("absent"))?,
            answers: answers::declared(value),
        })
    }
}

fn levels<T>(
    key: &str,
    value: Option<&Value>,
    read: impl Fn(&str, &Value) -> Result<T, Box<Finding>>,
) -> Result<IndexMap<String, T>, Box<Finding>> {
    let members = match value {
        None => return Ok(IndexMap::new()),
        Some(Value::Object(members)) => members,
        Some(other) => return Err(fault(key, "an object with the names of metrics as keys", other)),
    };
    let one = |(metric, level): (&String, &Value)| Ok((metric.clone(), read(&format!("{key}.{metric}"), level)?));
    members.iter().map(one).collect()
}

fn columns(key: &str, value: Option<&Value>) -> Result<Vec<&'static str>, Box<Finding>> {
    let known = |name: &Value| of_some_tasks().find(|known| *name == **known);
    let Some(value) = value else { return Ok(Vec::new()) };
    let named: Option<Vec<_>> = value.as_array().and_then(|names| names.iter().map(known).collect());
    let expected = || format!("a list of `{}`", of_some_tasks().collect::<Vec<_>>().join("`, `"));
    let named = named.ok_or_else(|| fault(key, &expected(), value))?;
    Ok(of_some_tasks().filter(|known| named.contains(known)).collect())
}

fn chance(key: &str, value: &Value) -> Result<Option<Chance>, Box<Finding>> {
    if value == "none" {
        return Ok(None);
    }
    let of_strategy = |(name, level): (&String, &Value)| Some((name.clone(), ratio(level)?));
    let level = match value.as_object() {
        Some(levels) => levels.iter().map(of_strategy).collect::<Option<_>>().map(Chance::ByStrategy),
        None => ratio(value).map(Chance::Of),
    };
    level.map(Some).ok_or_else(|| fault(key, "a fraction such as `1/3`, or `none`", value))
}

fn reference(key: &str, value: &Value) -> Result<Vec<Ratio>, Box<Finding>> {
    let levels = value.as_array().map(|levels| levels.iter().map(ratio).collect::<Option<Vec<_>>>());
    levels.flatten().ok_or_else(|| fault(key, "a list of fractions such as `1/10`", value))
}

fn ratio(value: &Value) -> Option<Ratio> {
    match value {
        Value::String(text) => text.parse().ok(),
        Value::Number(number) => number.to_string().parse().ok(),
        _ => None,
    }
}

/// The finding for an invalid declaration, without its file.
fn fault(key: impl Display, expected: &str, found: &Value) -> Box<Finding> {
    const SHOWN: usize = 80;
    let text = found.to_string();
    let shown: String = text.chars().take(SHOWN).collect();
    let rest = if shown.len() < text.len() { ".." } else { "" };
    let found = if found.is_null() { "none".to_owned() } else { format!("`{shown}{rest}`") };
    let expected = format!("`{RECORDING_KEY}.{key}` to be {expected}");
    Box::new(Finding::new(Code::InvalidMetadata, "", expected, found).with_help(HELP))
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::{DeclaredExperiment, absent, of_recording};
    use crate::footers::recording as parsed;

    fn declared(recording: &Value) -> Result<Vec<DeclaredExperiment>, String> {
        of_recording("a.parquet", recording).map_err(|finding| finding.to_string())
    }

    #[test]
    fn one_or_several_are_read_and_other_keys_are_not() {
        let six = json!({ "name": "E6", "title": "Delayed", "order": 6, "actions": 7,
                          "chance": { "TSA": "2/6", "X": "none", "Y": 0.25, "Z": { "a": "1/3", "b": 0.5 } }, "reference": { "TSA": ["1/10", 0] } });
        let found = declared(&json!({ "experiment": six, "experiments": [six, { "name": "E7" }] })).unwrap();
        let names: Vec<&str> = found.iter().map(|found| found.name.as_str()).collect();
        assert_eq!(names, ["E6", "E7"]);
        let [six, seven] = &found[..] else { panic!("{found:?}") };
        assert_eq!((six.title.as_deref(), six.order), (Some("Delayed"), Some(6)));
        let chance: Vec<String> = six.chance.values().map(|level| format!("{level:?}")).collect();
        assert_eq!((six.chance["TSA"].as_ref().unwrap().to_string(), chance[1].as_str()), ("1/3".to_owned(), "None"));
        assert_eq!(six.chance["Z"].as_ref().unwrap().to_string(), "1/3 by a or 1/2 by b");
        assert_eq!(six.chance["Y"].as_ref().unwrap().to_string(), "1/4");
        assert_eq!(six.reference["TSA"].iter().map(ToString::to_string).collect::<Vec<_>>(), ["1/10", "0"]);
        assert_eq!((&seven.title, seven.order, seven.chance.len()), (&None, None, 0));
    }

    #[test]
    fn a_column_is_absent_if_every_experiment_declares_it_absent() {
        let of = |recording: Value| absent(&of_recording("a.parquet", &recording).unwrap());
        let both = json!({ "name": "A", "absent": ["selected_cube", "self_color"] });
        let one = json!({ "name": "B", "absent": ["self_color"] });
        assert_eq!(of(json!({ "experiment": both })), ["self_color", "selected_cube"]);
        assert_eq!(of(json!({ "experiments": [both, one] })), ["self_color"]);
        let none =
            [json!({ "experiments": [both, { "name": "C" }] }), json!({ "experiment": "A" }), json!({}), json!([])];
        assert!(none.into_iter().all(|recording| of(recording).is_empty()));
    }

    #[test]
    fn a_missing_or_empty_declaration_is_accepted() {
        for text in [
            None,
            Some("no JSON"),
            Some("7"),
            Some("{}"),
            Some(r#"{"experiment":null,"experiments":null}"#),
            Some(r#"{"experiment":"E1"}"#),
        ] {
            assert_eq!(of_recording("a.parquet", &parsed(text)).unwrap(), [], "{text:?}");
        }
    }

    #[test]
    fn each_invalid_member_is_named() {
        let of = |key: &str, value: Value| json!({ "experiment": { "name": "E6", key: value } });
        for (recording, words) in [
            (json!({ "experiment": ["E6"] }), "`mirrorstats.recording.experiment` to be an object\n  found `[\"E6\"]`"),
            (json!({ "experiment": {} }), "experiment.name` to be a name\n  found none"),
            (of("name", json!("")), "experiment.name` to be a name\n  found `\"\"`"),
            (of("title", json!(7)), "experiment.title` to be a text\n  found `7`"),
            (of("order", json!(1.5)), "experiment.order` to be a whole number\n  found `1.5`"),
            (of("chance", json!({ "TSA": "abc" })), "experiment.chance.TSA` to be a fraction such as `1/3`, or `none`"),
            (
                of("chance", json!({ "TSA": { "a": 1, "b": "c" } })),
                "experiment.chance.TSA` to be a fraction such as `1/3`, or",
            ),
            (of("chance", json!([1])), "experiment.chance` to be an object"),
            (
                of("absent", json!(["t"])),
                "experiment.absent` to be a list of `body_color`, `action`, `self_color`, `selected_cube`\n  found `[\"t\"]`",
            ),
            (of("reference", json!({ "TSA": "1/3" })), "experiment.reference.TSA` to be a list of fractions"),
            (json!({ "experiments": {} }), "experiments` to be a list of objects"),
            (json!({ "experiments": [{ "name": "E6" }, 7] }), "experiments[1]` to be an object\n  found `7`"),
            (
                json!({ "experiments": [{ "name": "E6" }, { "name": "E6", "order": 2 }] }),
                "experiments[1]` to be what the same footer declares of this name elsewhere",
            ),
        ] {
            let error = declared(&recording).unwrap_err();
            assert!(error.starts_with("invalid-metadata: a.parquet\n  expected ") && error.contains(words), "{error}");
        }
    }
}

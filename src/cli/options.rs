//! Options of a command that were not typed: from a study file, or from Python.

use std::ffi::OsString;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use serde_json::{Map, Value};

use crate::cli::{Failure, NAME};

/// Options by name without dashes. `true` sets a flag, `false` and null leave an option out, a list repeats it.
pub type Options = Map<String, Value>;

/// A command's options. Settings in a file or in the environment are ignored.
pub fn options_of<A: clap::Args>(verb: &str, options: &Options) -> Result<A, Failure> {
    let name = format!("{NAME} {verb}");
    let command = A::augment_args(clap::Command::new(name.clone()).bin_name(&name).no_binary_name(true));
    let words = options.iter().flat_map(|(key, value)| words(key, value));
    let parsed = command.try_get_matches_from(words).and_then(|matches| A::from_arg_matches(&matches));
    parsed.map_err(|error| Failure::input(message(&error)))
}

pub fn option_names<A: clap::Args>() -> Vec<String> {
    let command = A::augment_args(clap::Command::new(NAME));
    command.get_arguments().filter_map(|argument| argument.get_long().map(str::to_owned)).collect()
}

fn message(error: &clap::Error) -> String {
    let context = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.clone()),
        Some(ContextValue::Strings(texts)) => texts.first().cloned(),
        _ => None,
    };
    // Without the placeholder of the value.
    let name = |kind| context(kind).map(|text| text.split(' ').next().unwrap_or_default().to_owned());
    let (name, other) = (name(ContextKind::InvalidArg).unwrap_or_default(), name(ContextKind::PriorArg));
    let value = context(ContextKind::InvalidValue).unwrap_or_default();
    match (error.kind(), std::error::Error::source(error), other) {
        (ErrorKind::ArgumentConflict, _, Some(other)) => format!("{name} cannot be used with {other}"),
        (ErrorKind::TooManyValues, ..) => format!("{name}: expected true or false, found `{value}`"),
        (_, Some(source), _) if source.to_string().contains(&value) => format!("{name}: {source}"),
        (_, Some(source), _) => format!("{name}: {source}, found `{value}`"),
        _ => error.to_string().trim_start_matches("error: ").lines().next().unwrap_or_default().to_owned(),
    }
}

// Clap parses options from words.
fn words(key: &str, value: &Value) -> Vec<OsString> {
    match value {
        Value::Null | Value::Bool(false) => Vec::new(),
        Value::Bool(true) => vec![format!("--{key}").into()],
        Value::Array(values) => values.iter().flat_map(|value| words(key, value)).collect(),
        Value::String(text) => vec![format!("--{key}={text}").into()],
        other => vec![format!("--{key}={other}").into()],
    }
}

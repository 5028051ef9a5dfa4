//! A file that says what differs, laid over the default key by key.
//!
//! Rule: the default decides which keys there are and of what type each is.

use serde::de::DeserializeOwned;
use toml::Spanned;
use toml::Table;
use toml::Value;
use toml::de::{DeTable, DeValue};

use super::Fault;
use exact::suggest::nearest;

/// The default with the values of `text` over it.
pub(super) fn over_default<T: DeserializeOwned>(default: &str, text: &str) -> Result<T, Fault> {
    let mut merged: Table = default.parse().expect("the built-in configuration is tested to parse");
    let parsed = DeTable::parse(text).map_err(|error| Fault {
        line: error.span().map(|span| line_at(text, span.start)),
        text: format!("not TOML: {}", error.message()),
    })?;
    lay(text, &mut merged, parsed.get_ref(), "")?;
    merged.try_into().map_err(|error: toml::de::Error| Fault { line: None, text: error.message().to_owned() })
}

/// The line where `text` sets a key such as `room.size`.
pub(super) fn line_of(text: &str, key: &str) -> Option<usize> {
    let parsed = DeTable::parse(text).ok()?;
    let mut table = parsed.get_ref();
    let mut names = key.split('.').peekable();
    loop {
        let (at, value) = table.get_key_value(names.next()?)?;
        match (names.peek(), value.get_ref()) {
            (None, _) => return Some(line_at(text, at.span().start)),
            (Some(_), DeValue::Table(inner)) => table = inner,
            (Some(_), _) => return None,
        }
    }
}

fn line_at(text: &str, offset: usize) -> usize {
    1 + text.bytes().take(offset).filter(|byte| *byte == b'\n').count()
}

fn lay(text: &str, under: &mut Table, over: &DeTable<'_>, path: &str) -> Result<(), Fault> {
    for (key, value) in over {
        let name: &str = key.get_ref();
        let path = if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
        let fault = |words| Fault { line: Some(line_at(text, key.span().start)), text: words };
        let Some(known) = under.get_mut(name) else {
            return Err(fault(unknown(&path, under.keys(), name)));
        };
        match (known, value.get_ref()) {
            (Value::Table(inner), DeValue::Table(values)) => lay(text, inner, values, &path)?,
            (Value::Array(parts), DeValue::Array(values)) if name.ends_with("color") && parts.len() != values.len() => {
                return Err(fault(format!("`{path}` is red, green and blue, but has {} parts", values.len())));
            }
            (known, _) => *known = fitting(known, text, value).map_err(|words| fault(format!("`{path}` {words}")))?,
        }
    }
    Ok(())
}

fn unknown<'a>(path: &str, keys: impl Iterator<Item = &'a String>, name: &str) -> String {
    let keys: Vec<&str> = keys.map(String::as_str).collect();
    match nearest(name, keys.iter().copied()) {
        Some(near) => format!("no key `{path}`: did you mean `{near}`?"),
        None => format!("no key `{path}`: expected one of {}", keys.join(", ")),
    }
}

/// The value, where it is of the type of the default's.
fn fitting(known: &Value, text: &str, value: &Spanned<DeValue<'_>>) -> Result<Value, String> {
    let written = text.get(value.span()).unwrap_or_default();
    let found = format!("x = {written}").parse::<Table>().ok().and_then(|mut table| table.remove("x"));
    match (known, found) {
        (Value::Float(_), Some(Value::Integer(whole))) => i32::try_from(whole)
            .map(|whole| Value::Float(f64::from(whole)))
            .map_err(|_| format!("is too large: {whole}")),
        (Value::Integer(_), Some(Value::Integer(whole))) => {
            u32::try_from(whole).map(|_| Value::Integer(whole)).map_err(|_| format!("counts something, but is {whole}"))
        }
        (Value::Array(known), Some(Value::Array(values))) => numbers(known, values),
        (known, Some(found)) if known.same_type(&found) => Ok(found),
        _ => Err(format!("is {}, but found {written}", kind(known))),
    }
}

/// An array of numbers; whole ones may stand for others.
fn numbers(known: &[Value], values: Vec<Value>) -> Result<Value, String> {
    let is_float = known.first().is_some_and(Value::is_float);
    let number = |value| match value {
        Value::Integer(whole) if is_float => i32::try_from(whole).map(|whole| Value::Float(f64::from(whole))).ok(),
        value if known.first().is_none_or(|first| first.same_type(&value)) => Some(value),
        _ => None,
    };
    values
        .into_iter()
        .map(number)
        .collect::<Option<Vec<_>>>()
        .map(Value::Array)
        .ok_or_else(|| format!("is a list of {}", if is_float { "numbers" } else { "whole numbers" }))
}

const fn kind(value: &Value) -> &'static str {
    match value {
        Value::String(_) => "a text",
        Value::Integer(_) => "a whole number",
        Value::Float(_) => "a number",
        Value::Boolean(_) => "true or false",
        Value::Datetime(_) => "a date",
        Value::Array(_) => "a list",
        Value::Table(_) => "a table",
    }
}

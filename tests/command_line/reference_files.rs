//! The page of `docs/reference` on files that people write, generated from the JSON Schemas of their types.

use std::fmt::Write as _;
use std::fs;

use serde_json::Value;

use crate::harness::files::repository;
use crate::reference::cell;

/// The files: schema, heading, command that checks one.
const FILES: [(&str, &str, &str); 5] = [
    ("definitions", "Definitions", "mirrorstats definitions check mine.toml"),
    ("style", "Styles", "mirrorstats style check mine.toml"),
    ("experiments", "Experiments", "mirrorstats experiments check mine.toml"),
    ("world-config", "The world: `record --config FILE`", ""),
    ("models", "Models: `record --models FILE`", ""),
];

pub fn page() -> String {
    let mut page =
        "# Files that you write\n\nEach file is TOML. Unknown keys, wrong types and values outside of their range \
                    are errors; each error names its line.\n"
            .to_owned();
    for (name, heading, check) in FILES {
        let path = repository().join("schemas").join(name).with_extension("schema.json");
        let schema: Value = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
        write!(page, "\n## {heading}\n\n{}\n", cell(&schema["description"])).unwrap();
        if !check.is_empty() {
            write!(page, "\n`{check}` checks a file.\n").unwrap();
        }
        table(&schema, &schema, "", &mut page);
    }
    page
}

/// The keys of a table, then those of its subtables.
fn table(root: &Value, schema: &Value, path: &str, page: &mut String) {
    if !path.is_empty() {
        write!(page, "\n### `{path}`\n\n{}\n", cell(&schema["description"])).unwrap();
    }
    writeln!(page, "\n| key | value | default | meaning |\n|---|---|---|---|").unwrap();
    let mut inner = Vec::new();
    for (key, property) in schema["properties"].as_object().into_iter().flatten() {
        let is_needed = schema["required"].as_array().is_some_and(|names| names.contains(&key.as_str().into()));
        let default = match &property["default"] {
            _ if is_needed => "required".to_owned(),
            simple @ (Value::String(_) | Value::Bool(_) | Value::Number(_)) if *simple != "" => format!("`{simple}`"),
            _ => String::new(),
        };
        let (words, meaning) = (value(root, property), cell(&property["description"]));
        writeln!(page, "| `{key}` | {words} | {default} | {meaning} |").unwrap();
        let own = if path.is_empty() { key.clone() } else { format!("{}.{key}", path.trim_matches(['[', ']'])) };
        for one in alternatives(root, property) {
            match one["type"].as_str() {
                Some("object") if one["properties"].is_object() => inner.push((one, format!("[{own}]"))),
                Some("object") => {
                    let of = alternatives(root, &one["additionalProperties"]);
                    inner.extend(of.into_iter().map(|table| (table, format!("[{own}.NAME]"))));
                }
                Some("array") => {
                    inner.extend(
                        alternatives(root, &one["items"]).into_iter().map(|table| (table, format!("[[{own}]]"))),
                    );
                }
                _ => {}
            }
        }
    }
    for (inside, path) in inner.into_iter().filter(|(inside, _)| inside["properties"].is_object()) {
        table(root, inside, &path, page);
    }
}

fn alternatives<'a>(root: &'a Value, schema: &'a Value) -> Vec<&'a Value> {
    if let Some(path) = schema["$ref"].as_str() {
        return alternatives(root, root.pointer(&path[1..]).unwrap());
    }
    match schema["anyOf"].as_array().or(schema["oneOf"].as_array()) {
        Some(several) => several.iter().flat_map(|one| alternatives(root, one)).collect(),
        None if schema["type"] == "null" => Vec::new(),
        None => vec![schema],
    }
}

/// The values of a key, as text.
fn value(root: &Value, schema: &Value) -> String {
    let mut words: Vec<String> = Vec::new();
    for one in alternatives(root, schema) {
        let listed = one["enum"].as_array().cloned().unwrap_or_default();
        let consts: Vec<Value> = if one["const"].is_null() { listed } else { vec![one["const"].clone()] };
        let types = match &one["type"] {
            Value::Array(types) => types.clone(),
            one => vec![one.clone()],
        };
        let kind = types.iter().filter_map(Value::as_str).find(|kind| *kind != "null").unwrap_or("any");
        let range = match (&one["minimum"], &one["maximum"]) {
            (Value::Null, Value::Null) => String::new(),
            (least, Value::Null) => format!(", at least {least}"),
            (Value::Null, most) => format!(", at most {most}"),
            (least, most) => format!(", {least} to {most}"),
        };
        let told = match kind {
            _ if !consts.is_empty() => {
                consts.iter().map(|word| format!("`{}`", cell(word))).collect::<Vec<_>>().join(", ")
            }
            "string" => "text".to_owned(),
            "boolean" => "true or false".to_owned(),
            "integer" => format!("integer{range}"),
            "number" => format!("number{range}"),
            "array" => format!("list of: {}", value(root, &one["items"])),
            "object" if one["properties"].is_object() => "table".to_owned(),
            "object" => format!("table by name: {}", value(root, &one["additionalProperties"])),
            other => other.to_owned(),
        };
        if !words.contains(&told) {
            words.push(told);
        }
    }
    words.join(", ")
}

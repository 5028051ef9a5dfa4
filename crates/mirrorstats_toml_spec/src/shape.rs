//! Files read by type: the JSON Schema of a type gives the keys and their allowed values.
//!
//! A field declares a key once: its name, type, range (`#[schemars(range(..))]`), words (an enum) and description. The
//! schema of the type is the one in `schemas/`, so editors refuse what the program refuses.

use std::sync::Arc;

use indexmap::IndexSet;
use schemars::JsonSchema;
use serde::Deserialize as _;
use serde::de::{DeserializeOwned, IntoDeserializer as _};
use serde_json::Value as Json;
use toml::de::DeValue;
use toml::{Spanned, Table, Value};

use crate::at::{At, parse};
use crate::fault::{Fault, Faults, Source};
use mirrorstats_exact::suggest::{did_you_mean, nearest};

pub struct Shape {
    schema: Json,
    is_overlay: bool,
}

impl Shape {
    pub fn of<T: JsonSchema>() -> Self {
        Self { schema: schemars::schema_for!(T).to_value(), is_overlay: false }
    }

    /// The shape of a file that overlays another one and gives only the differences.
    #[must_use]
    pub fn overlay(self) -> Self {
        Self { is_overlay: true, ..self }
    }

    /// Reads as much of the value as possible; `what` names its kind, such as `an experiment file`.
    ///
    /// Parts with faults are left out, so that the rest can still be checked: a key, or a text of a list. A list of
    /// other values is left out whole, as its positions would change. A required text becomes empty; any other missing
    /// required value makes the result `None`.
    pub fn value(&self, at: &At<'_>, what: &str, faults: &mut Vec<Fault>) -> Option<Value> {
        Walk { shape: self, faults }.value(&self.schema, at, what)
    }
}

/// Reads a value as a type; see [`Shape::value`].
pub fn read<T: JsonSchema + DeserializeOwned>(at: &At<'_>, what: &str, faults: &mut Vec<Fault>) -> Option<T> {
    let value = Shape::of::<T>().value(at, what, faults)?;
    value.try_into().map_err(|error: toml::de::Error| faults.push(at.fault(error.message()))).ok()
}

/// Overlays a value on another one: key by key in tables; lists are replaced whole.
pub fn lay(under: &mut Value, over: Value) {
    match (under, over) {
        (Value::Table(under), Value::Table(over)) => {
            for (key, value) in over {
                lay(under.entry(key).or_insert_with(|| Value::Table(Table::new())), value);
            }
        }
        (under, over) => *under = over,
    }
}

/// Reads a text as a type; `check` refuses what types cannot, given the values.
pub fn read_source<T: JsonSchema + DeserializeOwned>(
    source: Source,
    what: &str,
    check: impl FnOnce(&T, &At<'_>, &mut Vec<Fault>),
) -> Result<T, Faults> {
    let source = Arc::new(source);
    let (root, mut faults) = parse(&source);
    let at = At::root(&source, &root);
    let value = if faults.is_empty() { read(&at, what, &mut faults) } else { None };
    if let Some(value) = &value {
        check(value, &at, &mut faults);
    }
    value.filter(|_| faults.is_empty()).ok_or_else(|| Faults(faults).in_order())
}

struct Walk<'a> {
    shape: &'a Shape,
    faults: &'a mut Vec<Fault>,
}

impl<'a> Walk<'a> {
    fn alternatives(&self, schema: &'a Json) -> Vec<&'a Json> {
        if let Some(target) = schema["$ref"].as_str().and_then(|path| self.shape.schema.pointer(&path[1..])) {
            return self.alternatives(target);
        }
        match schema["anyOf"].as_array().or(schema["oneOf"].as_array()) {
            Some(several) => several.iter().flat_map(|one| self.alternatives(one)).collect(),
            None if schema["type"] == "null" => Vec::new(),
            None => vec![schema],
        }
    }

    fn value(&mut self, schema: &'a Json, at: &At<'_>, what: &str) -> Option<Value> {
        let all = self.alternatives(schema);
        let fitting: Vec<&Json> = all.iter().copied().filter(|one| is_of_type(one, at.value)).collect();
        let Some(first) = fitting.first().copied() else {
            let expected = self.expected(&all);
            let message = format!("expected {expected}, found {}", at.value.type_str());
            self.faults.push(Fault::new(at.place(), message).label(format!("not {expected}")));
            return None;
        };
        match at.value {
            DeValue::String(text) => self.text(&all, at, text).map(Value::String),
            DeValue::Boolean(truth) => Some(Value::Boolean(*truth)),
            DeValue::Integer(number) => {
                let number = i64::from_str_radix(number.as_str(), number.radix());
                let number = number.map_err(|_| self.faults.push(at.fault("the integer is too large"))).ok()?;
                #[expect(clippy::cast_precision_loss, reason = "ranges are small integers")]
                self.in_range(first, at, number as f64).then_some(Value::Integer(number))
            }
            DeValue::Float(number) => {
                let number = number.as_str().replace('_', "").parse().ok()?;
                self.in_range(first, at, number).then_some(Value::Float(number))
            }
            DeValue::Array(_) => self.list(first, at, what).map(Value::Array),
            DeValue::Table(_) => {
                let schema = self.variant(&fitting, at, what)?;
                self.table(schema, at, what).map(Value::Table)
            }
            DeValue::Datetime(_) => None,
        }
    }

    fn text(&mut self, all: &[&'a Json], at: &At<'_>, text: &str) -> Option<String> {
        let (texts, others): (Vec<&Json>, Vec<&Json>) = all.iter().partition(|one| is_of_type(one, at.value));
        let words: Vec<&str> = texts.iter().flat_map(|one| words(one)).collect();
        if texts.iter().any(|one| self::words(one).is_empty()) || words.contains(&text) {
            return Some(text.to_owned());
        }
        let near = did_you_mean(text, words.iter().copied());
        let or = if others.is_empty() { String::new() } else { format!(", or {}", self.expected(&others)) };
        let message = format!("`{}` is one of {}{or}; found `{text}`", at.name, words.join(", "));
        self.faults.push(at.fault(message).help_if(near));
        None
    }

    fn in_range(&mut self, schema: &Json, at: &At<'_>, number: f64) -> bool {
        let most = schema["maximum"].as_f64().or((schema["format"] == "uint32").then_some(f64::from(u32::MAX)));
        let least = schema["minimum"].as_f64();
        // Written so that NaN is outside every range.
        let holds = number >= least.unwrap_or(f64::MIN) && number <= most.unwrap_or(f64::MAX);
        if !holds {
            let range = bounds(least, most, "may be").unwrap_or_else(|| "is finite".to_owned());
            self.faults.push(at.fault(format!("`{}` {range}, but is {number}", at.name)));
        }
        holds
    }

    fn list(&mut self, schema: &'a Json, at: &At<'_>, what: &str) -> Option<Vec<Value>> {
        let (least, most) = (schema["minItems"].as_u64(), schema["maxItems"].as_u64());
        let count = at.items().count() as u64;
        let is_as_long = count >= least.unwrap_or(0) && count <= most.unwrap_or(u64::MAX);
        if !is_as_long {
            let range = bounds(least, most, "may have").unwrap_or_default();
            self.faults.push(at.fault(format!("`{}` {range} items, but has {count}", at.name)));
        }
        let mut values: Vec<Value> = Vec::new();
        for item in at.items() {
            match self.value(&schema["items"], &item, &one_of(what)) {
                Some(value) if schema["uniqueItems"] == true && values.contains(&value) => {
                    self.faults.push(item.fault(format!("`{}` is listed twice", item.written())));
                }
                value => values.extend(value),
            }
        }
        let is_whole = is_as_long && values.len() as u64 == count;
        (is_whole || values.iter().all(Value::is_str)).then_some(values)
    }

    fn variant(&mut self, fitting: &[&'a Json], at: &At<'_>, what: &str) -> Option<&'a Json> {
        let [first, _, ..] = fitting else { return fitting.first().copied() };
        let tag_of = |schema: &'a Json, key: &str| schema["properties"][key]["const"].as_str();
        let tag = first["properties"].as_object()?.keys().find(|key| tag_of(first, key).is_some())?;
        let known: Vec<&str> = fitting.iter().filter_map(|one| tag_of(one, tag)).collect();
        let Some(kind) = at.get(tag) else {
            let fault = Fault::new(at.place(), format!("{what} needs `{tag}`"));
            self.faults.push(fault.help(format!("one of {}", known.join(", "))));
            return None;
        };
        let found = fitting.iter().copied().find(|one| tag_of(one, tag) == kind.value.as_str());
        if found.is_none() {
            let tags: Vec<&'a Json> = fitting.iter().map(|one| &one["properties"][tag]).collect();
            self.text(&tags, &kind, kind.written());
        }
        found
    }

    fn table(&mut self, schema: &'a Json, at: &At<'_>, what: &str) -> Option<Table> {
        let (properties, others) = (&schema["properties"], &schema["additionalProperties"]);
        let mut table = Table::new();
        let mut misspelt = Vec::new();
        for (key, value) in at.entries() {
            let read = match properties.get(key) {
                Some(known) => self.value(known, &value, key),
                None if *others == false => {
                    misspelt.extend(self.unknown(properties, &value, what));
                    None
                }
                None if others.is_object() => self.value(others, &value, &one_of(what)),
                None => self.as_written(&value),
            };
            table.extend(read.map(|read| (key.to_owned(), read)));
        }
        if self.shape.is_overlay {
            return Some(table);
        }
        for key in schema["required"].as_array().into_iter().flatten().filter_map(Json::as_str) {
            if table.contains_key(key) {
                continue;
            }
            let all = self.alternatives(&properties[key]);
            if at.get(key).is_none() && !misspelt.contains(&key) {
                let fault = Fault::new(at.name_place(), format!("{what} needs `{key}`"));
                self.faults.push(fault.help(remedy(key, &all)));
            }
            let is_text = all.iter().all(|one| one["type"] == "string" && words(one).is_empty());
            if !is_text {
                return None;
            }
            table.insert(key.to_owned(), Value::String(String::new()));
        }
        Some(table)
    }

    /// A value of any type.
    fn as_written(&mut self, at: &At<'_>) -> Option<Value> {
        let value = Spanned::new(at.place().span, at.value.clone());
        Value::deserialize(value.into_deserializer()).map_err(|error| self.faults.push(at.fault(error.message()))).ok()
    }

    fn unknown(&mut self, properties: &'a Json, at: &At<'_>, what: &str) -> Option<&'a str> {
        let known: Vec<&str> = properties.as_object().into_iter().flatten().map(|(key, _)| key.as_str()).collect();
        let near = nearest(at.name, known.iter().copied());
        let help = match near {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("keys of {what} are {}", known.join(", ")),
        };
        self.faults.push(Fault::new(at.name_place(), format!("unknown key `{}`", at.name)).help(help));
        near
    }

    fn expected(&self, all: &[&'a Json]) -> String {
        let kinds = all.iter().map(|one| match type_names(one).first().copied() {
            Some("boolean") => "true or false".to_owned(),
            Some("integer") => "an integer".to_owned(),
            Some("number") => "a number".to_owned(),
            Some("object") => "a table".to_owned(),
            Some("array") => {
                let items = self.expected(&self.alternatives(&one["items"]));
                format!("a list of {}s", items.rsplit(' ').next().unwrap_or_default())
            }
            _ => "a text".to_owned(),
        });
        let kinds: IndexSet<String> = kinds.collect();
        kinds.into_iter().collect::<Vec<_>>().join(" or ")
    }
}

fn type_names(schema: &Json) -> Vec<&str> {
    match &schema["type"] {
        Json::String(name) => vec![name],
        Json::Array(names) => names.iter().filter_map(Json::as_str).collect(),
        _ => Vec::new(),
    }
}

fn is_of_type(schema: &Json, value: &DeValue<'_>) -> bool {
    let wanted: &[&str] = match value {
        DeValue::String(_) => &["string"],
        DeValue::Boolean(_) => &["boolean"],
        DeValue::Integer(_) => &["integer", "number"],
        DeValue::Float(_) => &["number"],
        DeValue::Array(_) => &["array"],
        DeValue::Table(_) => &["object"],
        DeValue::Datetime(_) => &[],
    };
    type_names(schema).iter().any(|name| wanted.contains(name))
}

/// The allowed words of a text; empty if any text is allowed.
fn words(schema: &Json) -> Vec<&str> {
    let words = schema["enum"].as_array().map(Vec::as_slice).unwrap_or_default();
    words.iter().chain([&schema["const"]]).filter_map(Json::as_str).collect()
}

fn bounds<T: std::fmt::Display + PartialEq>(least: Option<T>, most: Option<T>, verb: &str) -> Option<String> {
    match (least, most) {
        (Some(least), Some(most)) if least == most => Some(format!("{verb} {least}")),
        (Some(least), Some(most)) => Some(format!("{verb} {least} to {most}")),
        (Some(least), None) => Some(format!("{verb} {least} or more")),
        (None, Some(most)) => Some(format!("{verb} at most {most}")),
        (None, None) => None,
    }
}

fn remedy(key: &str, all: &[&Json]) -> String {
    let words: Vec<&str> = all.iter().flat_map(|one| words(one)).collect();
    match all.first() {
        _ if !words.is_empty() => format!("one of {}", words.join(", ")),
        Some(one) if one["type"] == "string" => format!("add `{key} = \"...\"`"),
        _ => format!("add `{key} = ...`"),
    }
}

/// The name of an entry of a table or list, from that of the whole: `an experiment` of `experiment`.
fn one_of(what: &str) -> String {
    let article = if what.starts_with(['a', 'e', 'i', 'o', 'u']) { "an" } else { "a" };
    format!("{article} {what}")
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use indexmap::IndexMap;
    use schemars::JsonSchema;
    use serde::Deserialize;

    use crate::{At, Faults, Source, parse};

    #[derive(Debug, PartialEq, Deserialize, JsonSchema)]
    #[serde(deny_unknown_fields)]
    struct File {
        #[serde(default)]
        room: IndexMap<String, Room>,
        #[serde(default)]
        #[schemars(length(max = 2), extend("uniqueItems" = true))]
        names: Vec<String>,
    }

    #[derive(Debug, PartialEq, Deserialize, JsonSchema)]
    #[serde(deny_unknown_fields)]
    struct Room {
        title: String,
        #[schemars(range(min = 1.0, max = 9.0))]
        size: Option<f64>,
        #[serde(default)]
        edges: [f64; 2],
        thing: Option<Thing>,
        level: Option<Level>,
    }

    #[derive(Debug, PartialEq, Deserialize, JsonSchema)]
    #[serde(deny_unknown_fields, tag = "kind", rename_all = "lowercase")]
    enum Thing {
        Cube { edge: Option<u32> },
        Ball,
    }

    #[derive(Debug, PartialEq, Deserialize, JsonSchema)]
    #[serde(rename_all = "lowercase")]
    enum Level {
        Random,
        #[serde(untagged)]
        Of(f64),
    }

    fn read(text: &str) -> (Option<File>, Vec<String>) {
        let source = Arc::new(Source { name: "a.toml".to_owned(), text: text.to_owned() });
        let (root, mut faults) = parse(&source);
        let file = super::read(&At::root(&source, &root), "a plan", &mut faults);
        let shown = |fault: &crate::Fault| {
            let (line, column) = fault.line_and_column();
            format!("{line}:{column} {} {}", fault.message, fault.help.as_deref().unwrap_or_default())
                .trim_end()
                .to_owned()
        };
        (file, Faults(faults).in_order().0.iter().map(shown).collect())
    }

    #[test]
    fn a_file_that_fits_is_a_value() {
        let text = "names = ['a', 'b']\n[room.A]\ntitle = 't'\nsize = 2\nedges = [1, 0.5]\n\
                    thing = { kind = 'cube', edge = 0x10 }\nlevel = 'random'\n[room.B]\ntitle = ''\nlevel = 1_0.5";
        let (file, faults) = read(text);
        assert_eq!(faults, [""; 0]);
        let file = file.unwrap();
        let (a, b) = (&file.room["A"], &file.room["B"]);
        assert_eq!((a.size, a.edges, &a.thing), (Some(2.0), [1.0, 0.5], &Some(Thing::Cube { edge: Some(16) })));
        assert_eq!((&a.level, &b.level), (&Some(Level::Random), &Some(Level::Of(10.5))));
    }

    #[test]
    fn every_fault_is_reported_at_its_place_and_the_rest_is_read() {
        let text = "names = ['a', 'a', 3]\nrooms = 1\n[room.A]\ntitel = 'x'\nsize = nan\nedges = [1]\n\
                    thing = { kind = 'cub' }\n[room.B]\nsize = 'big'\nthing = { edge = 1 }\nlevel = 'rndom'\n\
                    [room.C]\ntitle = 1\nthing = { kind = 'ball', edge = 1 }\nlevel = true\n[room.D]\ntitle = 'D'\nzzz = 1";
        let (file, faults) = read(text);
        let file = file.unwrap();
        assert_eq!((file.room.len(), file.room["D"].title.as_str()), (4, "D"));
        insta::assert_snapshot!(faults.join("\n"), @r#"
        1:9 `names` may have at most 2 items, but has 3
        1:15 `a` is listed twice
        1:20 expected a text, found integer
        2:1 unknown key `rooms` did you mean `room`?
        4:1 unknown key `titel` did you mean `title`?
        5:8 `size` may be 1 to 9, but is NaN
        6:9 `edges` may have 2 items, but has 1
        7:18 `kind` is one of cube, ball; found `cub` did you mean `cube`?
        8:7 a room needs `title` add `title = "..."`
        9:8 expected a number, found string
        10:9 thing needs `kind` one of cube, ball
        11:9 `level` is one of random, or a number; found `rndom` did you mean `random`?
        13:9 expected a text, found integer
        14:26 unknown key `edge` keys of thing are kind
        15:9 expected a text or a number, found boolean
        18:1 unknown key `zzz` keys of a room are title, size, edges, thing, level
        "#);
    }
}

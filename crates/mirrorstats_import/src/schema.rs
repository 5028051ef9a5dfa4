//! The JSON Schema of a line of steps, generated from the table of columns.

use serde_json::{Map, Value, json};

use super::columns::{ATTRIBUTION, TEXT, lowest};
use mirrorstats_trace::schema::colors::spelling::WORDS;
use mirrorstats_trace::schema::{COLUMNS, Column, Kind};

/// The JSON Schema of one line: `schemas/step.schema.json`.
pub fn document() -> Value {
    let properties: Map<String, Value> =
        COLUMNS.iter().map(|column| (column.name.to_owned(), property(column))).collect();
    let needed = |column: &&Column| column.required && column.name != ATTRIBUTION;
    let required: Vec<&str> = COLUMNS.iter().filter(needed).map(|column| column.name).collect();
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "A step of an episode",
        "description": "One line of the JSON lines that `mirrorstats import` reads. Lines of an episode may be in any \
                        order and in several files; t says where a step belongs, and runs 1..T without a gap. \
                        An integer may be written with a point, as `2.0`. \
                        Without `self_color`, it is read from `identification`. Other keys become columns of their own: in \
                        all lines true or false, numbers, or text; null anywhere.",
        "type": "object",
        "properties": properties,
        "required": required,
        "anyOf": [{ "required": [ATTRIBUTION] }, { "required": [TEXT] }],
        "propertyNames": { "minLength": 1 },
        "additionalProperties": { "type": ["boolean", "number", "string", "null"] },
    })
}

fn property(column: &Column) -> Value {
    let kind = match column.stored.kind() {
        Kind::Bool => "boolean",
        Kind::Int => "integer",
        Kind::Float => "number",
        Kind::String | Kind::Unsupported => "string",
    };
    let mut property = json!({ "description": describe(column), "type": kind });
    if column.nullable {
        property["type"] = json!([kind, "null"]);
    }
    if let Some((_, highest)) = column.stored.range() {
        property["minimum"] = json!(lowest(column));
        property["maximum"] = json!(highest);
    } else if column.counts {
        property["minimum"] = json!(0);
    }
    if !column.values.is_empty() {
        let nulls = column.nullable.then_some(Value::Null);
        property["enum"] = column.values.iter().map(|value| json!(value)).chain(nulls).collect();
    } else if column.names() {
        property["minLength"] = json!(1);
    }
    if let Some(color) = column.color {
        // The import checks letters beyond ASCII.
        property["pattern"] = json!(r"^[^\sA-Z]+( [^\sA-Z]+)*$");
        let others: Vec<&str> = WORDS.into_iter().filter(|word| color.word != Some(*word)).collect();
        property["not"] = json!({ "enum": others });
    }
    property
}

fn describe(column: &Column) -> String {
    let per = if column.constant { " The same in all steps of an episode." } else { "" };
    let unit = column.unit.map(|unit| format!(" In {unit}.")).unwrap_or_default();
    format!("{}{unit}{per}", column.doc)
}

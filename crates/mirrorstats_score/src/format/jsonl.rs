//! The episode table as JSON lines: one object per episode, keys in the order of the columns.

use std::io::{self, BufReader, Read, Write};

use serde_json::{Map, Value};

use super::{DECLARED_KEY, DeclaredText, FormatError, csv};
use crate::tables::table::EpisodeTable;
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::input::Lines;
use mirrorstats_metric::catalogs::catalog::Catalog;

pub(super) fn write(table: &EpisodeTable, mut out: impl Write) -> Result<(), FormatError> {
    let declared = DeclaredText::of_table(table)?;
    for (row, key) in table.keys.iter().enumerate() {
        let mut object = Map::new();
        object.insert("episode_id".into(), key.episode_id.into());
        object.insert("model".into(), key.model.into());
        object.insert("experiment".into(), key.experiment.into());
        object.insert("seed".into(), key.seed.into());
        object.insert("run".into(), key.run.into());
        for label in &table.labels {
            object.insert(label.name.clone(), label.values.get(row).map_or(Value::Null, Value::from));
        }
        for metric in &table.metrics {
            object.insert(
                metric.name.clone(),
                serde_json::to_value(table.decimal(metric, row)).map_err(io::Error::from)?,
            );
        }
        if let Some(declared) = &declared {
            let value = if row == 0 { declared.as_str().into() } else { Value::Null };
            object.insert(DECLARED_KEY.to_owned(), value);
        }
        serde_json::to_writer(&mut out, &object).map_err(std::io::Error::from)?;
        out.write_all(b"\n")?;
    }
    Ok(out.flush()?)
}

/// A line holds an episode's names, labels and some numbers.
const LONGEST_LINE: Limit = Limit::new("bytes in a line of scores", 16 << 20);

pub(super) fn read(catalog: &Catalog, input: impl Read) -> Result<EpisodeTable, FormatError> {
    let mut header: Vec<String> = Vec::new();
    let mut rows = Vec::new();
    for (at, line) in Lines::new(BufReader::new(input), LONGEST_LINE).enumerate() {
        let fault = |reason: String| FormatError::Line { line: at + 1, reason };
        let object: Map<String, Value> = serde_json::from_slice(&line?).map_err(|error| fault(error.to_string()))?;
        if at == 0 {
            header = object.keys().cloned().collect();
        }
        if object.len() != header.len() || header.iter().any(|name| !object.contains_key(name)) {
            let found: Vec<&str> = object.keys().map(String::as_str).collect();
            let expected = header.join(", ");
            return Err(fault(format!("expected the keys of line 1 ({expected}), found {}", found.join(", "))));
        }
        rows.push(header.iter().map(|name| cell(&object[name])).collect());
    }
    csv::assemble(catalog, &header, rows, 1)
}

/// A value as text. Data frames store nullable integers as floats: `1.0` becomes `1`.
fn cell(value: &Value) -> Option<String> {
    match value {
        Value::Null => None,
        Value::String(text) => Some(text.clone()),
        Value::Number(number) if number.is_f64() => {
            let text = number.to_string();
            Some(text.strip_suffix(".0").map_or(text.clone(), str::to_owned))
        }
        other => Some(other.to_string()),
    }
}

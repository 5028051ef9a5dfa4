//! The episode table as JSON lines: an object an episode, keys in the order of the columns.

use std::io::{BufRead as _, BufReader, Read, Write};

use serde_json::{Map, Value};

use super::{FormatError, csv};
use crate::metric::catalog::Catalog;
use crate::score::table::{EpisodeKey, EpisodeRow, EpisodeTable, Header};

/// Writes a table as JSON lines.
pub(super) struct Writer<W> {
    header: Header,
    out: W,
}

impl<W: Write> Writer<W> {
    pub(super) fn new(header: Header, out: W) -> Self {
        Self { header, out }
    }

    pub(super) fn write(&mut self, row: &EpisodeRow) -> Result<(), FormatError> {
        let EpisodeKey { experiment, model, seed, run, episode_id } = &row.key;
        let mut object = Map::new();
        object.insert("episode_id".into(), episode_id.as_str().into());
        object.insert("model".into(), model.as_str().into());
        object.insert("experiment".into(), experiment.as_str().into());
        object.insert("seed".into(), (*seed).into());
        object.insert("run".into(), (*run).into());
        for (name, label) in self.header.labels.iter().zip(&row.labels) {
            object.insert(name.clone(), label.as_deref().map_or(Value::Null, Value::from));
        }
        for (name, metric) in self.header.metrics.iter().zip(&row.metrics) {
            object.insert(name.clone(), metric.map_or(Value::Null, Value::from));
        }
        serde_json::to_writer(&mut self.out, &object).map_err(std::io::Error::from)?;
        Ok(self.out.write_all(b"\n")?)
    }

    pub(super) fn finish(mut self) -> Result<(), FormatError> {
        Ok(self.out.flush()?)
    }
}

pub(super) fn read(catalog: &Catalog, input: impl Read) -> Result<EpisodeTable, FormatError> {
    let mut header: Vec<String> = Vec::new();
    let mut rows = Vec::new();
    for (at, line) in BufReader::new(input).lines().enumerate() {
        let fault = |reason: String| FormatError::Line { line: at + 1, reason };
        let object: Map<String, Value> = serde_json::from_str(&line?).map_err(|error| fault(error.to_string()))?;
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

fn cell(value: &Value) -> Option<String> {
    match value {
        Value::Null => None,
        Value::String(text) => Some(text.clone()),
        other => Some(other.to_string()),
    }
}

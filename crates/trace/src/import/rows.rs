//! The rows of the second pass: puts the values of a line into the columns of a trace.

use std::io::Write;

use arrow::datatypes::{DataType, Field};
use parquet::errors::Result;

use super::columns::Columns;
use super::line::{self, Members};
use crate::schema::{Kind, Value};
use crate::write::row_groups::{Gathered, RowGroups, field};

pub(super) struct Rows<W: Write + Send> {
    file: RowGroups<W>,
    gathered: Gathered,
}

impl<W: Write + Send> Rows<W> {
    pub(super) fn new(out: W, columns: &Columns, recording: &serde_json::Value) -> Result<Self> {
        let known = columns.known().map(|column| (field(column), Some(column.stored.kind())));
        let own = columns.own().into_iter().map(|own| (Field::new(&own.name, stored(own.kind), true), own.kind));
        let gathered = Gathered::new(known.chain(own));
        Ok(Self { file: RowGroups::new(out, &gathered.layout, Some(recording))?, gathered })
    }

    pub(super) fn add(&mut self, members: &Members) -> Result<(), ()> {
        for (field, values) in self.gathered.layout.fields().iter().zip(&mut self.gathered.columns) {
            let value = members.iter().find(|(key, _)| key == field.name()).map(|(_, value)| value);
            values.push(plain(value, field.data_type())?)?;
        }
        self.gathered.rows += 1;
        Ok(())
    }

    pub(super) fn end_episode(&mut self) -> Result<()> {
        self.file.end_episode(&mut self.gathered)
    }

    pub fn finish(self) -> Result<W> {
        self.file.finish(Some(self.gathered))
    }
}

#[expect(clippy::cast_precision_loss, reason = "the first pass refused what would lose anything in an own column")]
fn plain<'a>(value: Option<&'a line::Value>, stored: &DataType) -> Result<Option<Value<'a>>, ()> {
    Ok(Some(match value {
        None | Some(line::Value::Null) => return Ok(None),
        Some(line::Value::Bool(value)) => Value::Bool(*value),
        Some(line::Value::Int(value)) if stored.is_floating() => Value::Float(*value as f64),
        Some(line::Value::Int(value)) => Value::Int(*value),
        Some(line::Value::LargeInt(value)) if stored.is_floating() => Value::Float(*value as f64),
        Some(line::Value::Float(value)) => Value::Float(*value),
        Some(line::Value::Text(text)) => Value::Text(text),
        Some(_) => return Err(()),
    }))
}

/// The stored type of an own column. If all its values are null, it is compatible with any type in other files.
fn stored(kind: Option<Kind>) -> DataType {
    match kind {
        Some(Kind::Bool) => DataType::Boolean,
        Some(Kind::Int) => DataType::Int64,
        Some(Kind::Float) => DataType::Float64,
        Some(Kind::String) => DataType::Utf8,
        Some(Kind::Unsupported) | None => DataType::Null,
    }
}

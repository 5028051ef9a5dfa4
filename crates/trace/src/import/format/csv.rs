//! CSV: the header names the columns; a column's type must fit all its cells, and an empty cell is null.

use std::fs::File;
use std::io::{BufReader, Seek as _};

use ::csv::{Reader, StringRecord};
use serde_json::Value;

use super::RowSink;
use crate::import::error::ImportError;
use crate::import::mapping::is_general_text;
use crate::schema::Kind;

pub(super) fn read(mut file: &File, rows: &mut RowSink<'_>) -> Result<(), ImportError> {
    let mut reader = Reader::from_reader(BufReader::new(file));
    let names = reader.headers().map_err(|error| unreadable(rows, &error))?.clone();
    if let Some(twice) = names.iter().enumerate().find(|(at, name)| names.iter().take(*at).any(|other| other == *name))
    {
        let found = format!("`{}` twice", exact::escape::visible(twice.1));
        return Err(rows.fault("line 1", "a header with each name once", found, "rename one of the columns"));
    }
    let mut kinds: Vec<_> = names.iter().map(|name| is_general_text(name).then_some(Kind::String)).collect();
    let mut record = StringRecord::new();
    while reader.read_record(&mut record).map_err(|error| unreadable(rows, &error))? {
        for (kind, cell) in kinds.iter_mut().zip(&record) {
            *kind = joined(*kind, kind_of(cell));
        }
    }
    file.rewind().map_err(ImportError::read(&rows.file))?;
    for record in Reader::from_reader(BufReader::new(file)).records() {
        let record = record.map_err(|error| unreadable(rows, &error))?;
        let values: Vec<_> = record.iter().zip(&kinds).map(|(cell, kind)| value(cell, *kind)).collect();
        rows.add(&names.iter().zip(&values).collect::<Vec<_>>())?;
    }
    Ok(())
}

fn kind_of(cell: &str) -> Option<Kind> {
    match cell {
        "" => None,
        cell if cell.eq_ignore_ascii_case("true") || cell.eq_ignore_ascii_case("false") => Some(Kind::Bool),
        cell if cell.parse().is_ok_and(|number: i64| number.to_string() == cell) => Some(Kind::Int),
        cell if is_decimal(cell) || cell.eq_ignore_ascii_case("nan") => Some(Kind::Float),
        _ => Some(Kind::String),
    }
}

/// Accepts numbers, but not texts of digits such as `007`.
fn is_decimal(cell: &str) -> bool {
    let digits = cell.trim_start_matches('-');
    let leads_with_zero = digits.len() > 1 && digits.starts_with('0') && !digits.starts_with("0.");
    !leads_with_zero && cell.parse().is_ok_and(f64::is_finite) && cell.bytes().any(|byte| byte.is_ascii_digit())
}

fn joined(before: Option<Kind>, now: Option<Kind>) -> Option<Kind> {
    match (before, now) {
        (kind, None) | (None, kind) => kind,
        (Some(before), Some(now)) if before == now => Some(now),
        (Some(Kind::Int | Kind::Float), Some(Kind::Int | Kind::Float)) => Some(Kind::Float),
        _ => Some(Kind::String),
    }
}

fn value(cell: &str, kind: Option<Kind>) -> Value {
    match kind {
        _ if cell.is_empty() => Value::Null,
        Some(Kind::Bool) => Value::Bool(cell.eq_ignore_ascii_case("true")),
        Some(Kind::Int) => cell.parse::<i64>().map_or(Value::Null, Value::from),
        Some(Kind::Float) => cell.parse::<f64>().map_or(Value::Null, Value::from),
        _ => Value::String(cell.to_owned()),
    }
}

fn unreadable(rows: &RowSink<'_>, error: &::csv::Error) -> ImportError {
    let line = error.position().map(|at| format!("line {}", at.line())).unwrap_or_default();
    let help = "write it with commas, quotes around cells with commas, and a header";
    rows.fault(&line, "a record with the cells of the header, in UTF-8", error.to_string(), help)
}

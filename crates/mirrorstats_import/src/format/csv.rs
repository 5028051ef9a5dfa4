//! CSV: the header names the columns; cells are separated by commas, or by tabs if the header has no comma.

use std::fs::File;
use std::io::{BufReader, Seek as _};

use ::csv::{ReaderBuilder, StringRecord};

use super::RowSink;
use crate::error::ImportError;
use crate::value::LineValue;
use mirrorstats_exact::budget::Limit;

const LONGEST_HEADER: Limit = Limit::new("bytes in the header of a table", 1 << 20);

pub(super) fn read(mut file: &File, rows: &mut RowSink<'_>) -> Result<(), ImportError> {
    let failed = || ImportError::read(&rows.file);
    let header = mirrorstats_exact::input::line(&mut BufReader::new(file), LONGEST_HEADER).map_err(failed())?;
    file.rewind().map_err(failed())?;
    let is_tabbed = header.contains(&b'\t') && !header.contains(&b',');
    let mut reader =
        ReaderBuilder::new().delimiter(if is_tabbed { b'\t' } else { b',' }).from_reader(BufReader::new(file));
    let names = reader.headers().map_err(|error| unreadable(rows, &error))?.clone();
    if let Some(twice) = names.iter().enumerate().find(|(at, name)| names.iter().take(*at).any(|other| other == *name))
    {
        let found = format!("`{}` twice", mirrorstats_exact::escape::visible(twice.1));
        return Err(rows.fault("line 1", "a header with each name once", found, "rename one of the columns"));
    }
    let mut record = StringRecord::new();
    while reader.read_record(&mut record).map_err(|error| unreadable(rows, &error))? {
        rows.add_cells(&names.iter().zip(record.iter().map(value)).collect::<Vec<_>>())?;
    }
    Ok(())
}

fn value(cell: &str) -> LineValue {
    if cell.is_empty() { LineValue::Null } else { LineValue::Cell(cell.to_owned()) }
}

fn unreadable(rows: &RowSink<'_>, error: &::csv::Error) -> ImportError {
    let line = error.position().map(|at| format!("line {}", at.line())).unwrap_or_default();
    let help = "write it with commas, quotes around cells with commas, and a header";
    rows.fault(&line, "a record with the cells of the header, in UTF-8", error.to_string(), help)
}

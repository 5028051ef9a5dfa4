//! CSV: the header names the columns; cells are separated by commas, or by tabs if the header has no comma.

use std::fs::File;
use std::io::{self, BufReader, Seek as _, SeekFrom};
use std::sync::Arc;

use ::csv::{Error, ReaderBuilder, StringRecord};
use arrow::array::{ArrayRef, LargeStringBuilder};
use serde_json::{Map, Value};

use crate::arrays::table;
use crate::error::ImportError;
use crate::rows::Rows;
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::input;

const LONGEST_HEADER: Limit = Limit::new("bytes in the header of a table", 1 << 20);
const BATCH_ROWS: usize = 4096;
const BATCH_BYTES: usize = 4 << 20;

pub(super) fn read(mut reader: BufReader<File>, rows: &mut Rows<'_>) -> Result<(), ImportError> {
    let (header, lines) = header_of(&mut reader).map_err(ImportError::read(&rows.file))?;
    if lines > 0 {
        rows.notes.count("lines of settings before the header".to_owned(), lines);
    }
    let is_tabbed = header.contains(&b'\t') && !header.contains(&b',');
    let mut reader = ReaderBuilder::new().delimiter(if is_tabbed { b'\t' } else { b',' }).from_reader(reader);
    let names = reader.headers().map_err(|error| unreadable(rows, &error, lines))?.clone();
    if let Some((_, name)) =
        names.iter().enumerate().find(|(at, name)| names.iter().take(*at).any(|other| other == *name))
    {
        let found = format!("`{}` twice", mirrorstats_exact::escape::visible(name));
        let line = format!("line {}", lines + 1);
        return Err(rows.fault(&line, "a header with each name once", found, "rename one of the columns"));
    }
    let mut record = StringRecord::new();
    loop {
        let mut columns: Vec<_> = names.iter().map(|_| LargeStringBuilder::new()).collect();
        let (mut count, mut bytes) = (0, 0);
        while count < BATCH_ROWS
            && bytes < BATCH_BYTES
            && reader.read_record(&mut record).map_err(|error| unreadable(rows, &error, lines))?
        {
            for (column, cell) in columns.iter_mut().zip(&record) {
                column.append_option(Some(cell).filter(|cell| !cell.is_empty()));
            }
            (count, bytes) = (count + 1, bytes + record.as_slice().len());
        }
        if count == 0 {
            return Ok(());
        }
        let columns = columns.iter_mut().map(|column| Arc::new(column.finish()) as ArrayRef);
        let columns = names.iter().map(str::to_owned).zip(columns).collect();
        rows.add_table(&table(columns, count))?;
    }
}

/// The header and the number of lines before it; the file is then at the header. Stable-Baselines3's `Monitor` writes its
/// settings there, as `#` and a JSON object.
fn header_of(reader: &mut BufReader<File>) -> io::Result<(Vec<u8>, u64)> {
    let (mut lines, mut start) = (0, 0);
    loop {
        let line = input::line(reader, LONGEST_HEADER)?;
        let settings = line.strip_prefix(b"#").map(serde_json::from_slice::<Map<String, Value>>);
        if !matches!(settings, Some(Ok(_))) {
            reader.seek(SeekFrom::Start(start))?;
            return Ok((line, lines));
        }
        (lines, start) = (lines + 1, start + line.len() as u64);
    }
}

fn unreadable(rows: &Rows<'_>, error: &Error, lines_before: u64) -> ImportError {
    let line = error.position().map(|at| format!("line {}", lines_before + at.line())).unwrap_or_default();
    let help = "write it with commas, quotes around cells with commas, and a header";
    rows.fault(&line, "a record with the cells of the header, in UTF-8", error.to_string(), help)
}

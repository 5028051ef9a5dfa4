//! The episode table as comma-separated values.

use std::collections::BTreeMap;
use std::io::{Read, Write};

use super::{DECLARED_KEY, DeclaredText, FormatError};
use crate::tables::builder::TableBuilder;
use crate::tables::table::{Declared, EpisodeTable, Header, KeyRef};
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::number::Decimal;
use mirrorstats_metric::catalogs::catalog::Catalog;

pub(super) use crate::tables::columns::KEYS;

pub(super) fn write(table: &EpisodeTable, out: impl Write) -> Result<(), FormatError> {
    let mut writer = csv::Writer::from_writer(out);
    let header = table.header();
    let columns = header.labels.iter().chain(&header.metrics).map(String::as_str);
    let declared = DeclaredText::of_table(table)?;
    writer.write_record(KEYS.into_iter().chain(columns).chain(declared.as_ref().map(|_| DECLARED_KEY))).map_err(io)?;
    for (row, key) in table.keys.iter().enumerate() {
        let (seed, run) = (key.seed.to_string(), key.run.to_string());
        let key = [key.episode_id, key.model, key.experiment, &seed, &run];
        let labels = table.labels.iter().map(|label| label.values.get(row).unwrap_or_default());
        let value = |metric| table.decimal(metric, row).map_or_else(String::new, |value| value.to_string());
        let values = table.metrics.iter().map(value);
        let values: Vec<String> = values.collect();
        let declared = declared.iter().map(|declared| if row == 0 { declared.as_str() } else { "" });
        let cells = key.into_iter().chain(labels).chain(values.iter().map(String::as_str)).chain(declared);
        writer.write_record(cells).map_err(io)?;
    }
    Ok(writer.flush()?)
}

/// The system's own error: `csv` wraps it in an error whose kind does not show, for example, a closed pipe.
fn io(error: csv::Error) -> FormatError {
    FormatError::Io(match error.into_kind() {
        csv::ErrorKind::Io(error) => error,
        other => std::io::Error::other(format!("{other:?}")),
    })
}

pub(super) fn read(catalog: &Catalog, input: impl Read) -> Result<EpisodeTable, FormatError> {
    let mut reader = csv::Reader::from_reader(input);
    let header: Vec<String> = reader.headers().map_err(|error| line_fault(&error))?.iter().map(str::to_owned).collect();
    let mut rows: Vec<Vec<Option<String>>> = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|error| line_fault(&error))?;
        rows.push(record.iter().map(|cell| Some(cell.to_owned())).collect());
    }
    let (header, rows) = without_index(header, rows);
    // The header is line 1; without quoted line breaks, row i is line i + 2.
    assemble(catalog, &header, rows, 2)
}

/// The columns without the row numbers that pandas writes before them.
fn without_index(
    mut header: Vec<String>,
    mut rows: Vec<Vec<Option<String>>>,
) -> (Vec<String>, Vec<Vec<Option<String>>>) {
    let is_number = |(at, row): (usize, &Vec<Option<String>>)| row[0].as_deref() == Some(&*at.to_string());
    let is_unnamed = header.first().is_some_and(|name| name.is_empty() || name == "Unnamed: 0");
    if is_unnamed && rows.iter().enumerate().all(is_number) {
        header.remove(0);
        for row in &mut *rows {
            row.remove(0);
        }
    }
    (header, rows)
}

fn line_fault(error: &csv::Error) -> FormatError {
    let line = error.position().map_or(1, |position| usize::try_from(position.line()).unwrap_or(usize::MAX));
    FormatError::Line { line, reason: error.to_string() }
}

const MOST_COLUMNS: Limit = Limit::new("columns in a file of scores", 2000);

/// Builds a table from rows of cells; `None` and empty cells are nulls.
pub(super) fn assemble(
    catalog: &Catalog,
    header: &[String],
    rows: Vec<Vec<Option<String>>>,
    first_line: usize,
) -> Result<EpisodeTable, FormatError> {
    if header.iter().any(|name| name == "t") {
        return Err(FormatError::Steps);
    }
    MOST_COLUMNS.check(header.len() as u64).map_err(std::io::Error::from)?;
    let names: Vec<&str> = header.iter().map(String::as_str).collect();
    check_unique(&names)?;
    let mut positions = [0; 5];
    for (position, name) in positions.iter_mut().zip(KEYS) {
        *position = header.iter().position(|column| column == name).ok_or_else(|| {
            let found =
                if header.is_empty() { "no column".to_owned() } else { format!("the columns {}", header.join(", ")) };
            FormatError::column(name, "a key column of scores", found)
        })?;
    }
    let is_label = |(_, name): &(usize, &String)| !KEYS.contains(&name.as_str()) && *name != DECLARED_KEY;
    let is_metric = |(_, name): &(usize, &String)| catalog.metric.contains_key(*name);
    let (metrics, others): (Vec<_>, Vec<_>) = header.iter().enumerate().partition(is_metric);
    let labels: Vec<_> = others.into_iter().filter(is_label).collect();
    let declared_at = header.iter().position(|name| name == DECLARED_KEY);
    let names = |columns: &[(usize, &String)]| columns.iter().map(|(_, name)| (*name).clone()).collect();
    let mut builder =
        TableBuilder::new(Header { catalog: catalog.clone(), labels: names(&labels), metrics: names(&metrics) });
    let (mut declared, mut experiments) = (None::<Declared>, BTreeMap::new());
    for (at, row) in rows.into_iter().enumerate() {
        let line = first_line + at;
        let cell = |position: usize| row.get(position)?.as_deref().filter(|cell| !cell.is_empty());
        let key = |at: usize| cell(positions[at]).ok_or_else(|| invalid(line, KEYS[at], "a value", ""));
        let number = |at: usize| integer(key(at)?, line, KEYS[at]);
        let value = |(position, name): &(usize, &String)| {
            cell(*position).map(|text| stored(text, line, name, catalog.metric[*name].decimals)).transpose()
        };
        let (experiment, model, seed, run, episode_id) = (key(2)?, key(1)?, number(3)?, number(4)?, key(0)?);
        let values: Vec<Option<i64>> = metrics.iter().map(value).collect::<Result<_, _>>()?;
        let key = KeyRef { experiment, model, seed, run, episode_id };
        builder.push(key, labels.iter().map(|(position, _)| cell(*position)), values);
        if let Some(text) = declared_at.and_then(cell) {
            let found = DeclaredText::parse(text)?;
            experiments.extend(found.experiments);
            declared = Some(match declared {
                Some(whole) => whole.joined(found.declared),
                None => found.declared,
            });
        }
    }
    let mut table = EpisodeTable { declared: declared.unwrap_or_default(), ..builder.finish() };
    table.catalog.declare(experiments);
    Ok(table)
}

pub(super) fn check_unique(names: &[&str]) -> Result<(), FormatError> {
    match names.iter().enumerate().find(|(at, name)| names[..*at].contains(name)) {
        None => Ok(()),
        Some((_, name)) => Err(FormatError::column(name, "one column of that name", "more than one")),
    }
}

fn invalid(line: usize, column: &str, expected: &'static str, found: &str) -> FormatError {
    FormatError::Value { line, column: column.to_owned(), expected, found: found.to_owned() }
}

/// The stored value of a metric with decimals; texts with more digits are refused, except zeros.
fn stored(text: &str, line: usize, column: &str, decimals: u8) -> Result<i64, FormatError> {
    if decimals == 0 {
        return integer(text, line, column);
    }
    let number = text.parse::<Decimal>().ok().and_then(|number| number.with_places(decimals.into()));
    let units = number.and_then(|number| i64::try_from(number.units()).ok());
    units.ok_or_else(|| invalid(line, column, "a number with the digits of the metric", text))
}

/// An integer as data frames write it: `1.0` beside missing values, and `True` or `False`.
fn integer<T: std::str::FromStr>(text: &str, line: usize, column: &str) -> Result<T, FormatError> {
    let whole = match text {
        "True" | "true" => "1",
        "False" | "false" => "0",
        text => text
            .split_once('.')
            .filter(|(_, zeros)| zeros.bytes().all(|zero| zero == b'0'))
            .map_or(text, |(whole, _)| whole),
    };
    whole.parse().map_err(|_| invalid(line, column, "an integer", text))
}

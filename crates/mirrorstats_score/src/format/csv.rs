//! The episode table as comma-separated values.

use std::collections::BTreeMap;
use std::io::{Read, Write};

use super::{DECLARED_KEY, DeclaredText, FormatError};
use crate::tables::builder::TableBuilder;
use crate::tables::table::{Declared, EpisodeTable, Header, KeyRef};
use mirrorstats_exact::budget::Limit;
use mirrorstats_metric::catalogs::catalog::Catalog;

pub(super) use crate::tables::columns::KEYS;

pub(super) fn write(table: &EpisodeTable, out: impl Write) -> Result<(), FormatError> {
    let mut writer = csv::Writer::from_writer(out);
    let header = table.header();
    let columns = header.labels.iter().chain(&header.metrics).map(String::as_str);
    let declared = DeclaredText::of_table(table)?;
    writer.write_record(KEYS.into_iter().chain(columns).chain(declared.as_ref().map(|_| DECLARED_KEY))).map_err(io)?;
    for (row, key) in table.keys.iter().enumerate() {
        for text in [key.episode_id, key.model, key.experiment] {
            writer.write_field(text).map_err(io)?;
        }
        for number in [key.seed, key.run] {
            writer.write_field(number.to_string()).map_err(io)?;
        }
        for label in &table.labels {
            writer.write_field(label.values.get(row).unwrap_or_default()).map_err(io)?;
        }
        for metric in &table.metrics {
            writer.write_field(metric.get(row).map_or_else(String::new, |value| value.to_string())).map_err(io)?;
        }
        if let Some(declared) = &declared {
            writer.write_field(if row == 0 { declared.as_str() } else { "" }).map_err(io)?;
        }
        writer.write_record(None::<&[u8]>).map_err(io)?;
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
        *position = header.iter().position(|column| column == name).ok_or_else(|| FormatError::Column {
            column: name.to_owned(),
            expected: "a key column of scores",
            found: if header.is_empty() {
                "no column".to_owned()
            } else {
                format!("the columns {}", header.join(", "))
            },
        })?;
    }
    let is_metric = |name: &&String| catalog.metric.contains_key(*name);
    let metric_names: Vec<&String> = header.iter().filter(is_metric).collect();
    let label_names: Vec<&String> = header
        .iter()
        .filter(|name| !is_metric(name) && !KEYS.contains(&name.as_str()) && *name != DECLARED_KEY)
        .collect();
    let mut declared: Option<Declared> = None;
    let mut experiments = BTreeMap::new();
    let declared_at = header.iter().position(|name| name == DECLARED_KEY);
    let column = |name: &String| header.iter().position(|column| column == name).unwrap_or_default();
    let header = Header {
        catalog: catalog.clone(),
        labels: label_names.iter().map(|name| (*name).clone()).collect(),
        metrics: metric_names.iter().map(|name| (*name).clone()).collect(),
    };
    let mut builder = TableBuilder::new(header);
    for (at, row) in rows.into_iter().enumerate() {
        let line = first_line + at;
        let cell = |position: usize| row.get(position)?.as_deref().filter(|cell| !cell.is_empty());
        let [episode_id, model, experiment, seed, run] = positions;
        let key = KeyRef {
            experiment: required(cell(experiment), line, "experiment")?,
            model: required(cell(model), line, "model")?,
            seed: integer(required(cell(seed), line, "seed")?, line, "seed")?,
            run: integer(required(cell(run), line, "run")?, line, "run")?,
            episode_id: required(cell(episode_id), line, "episode_id")?,
        };
        let value = |name: &&String| cell(column(name)).map(|text| integer(text, line, name)).transpose();
        let metrics: Vec<Option<i64>> = metric_names.iter().map(value).collect::<Result<_, _>>()?;
        builder.push(key, label_names.iter().map(|name| cell(column(name))), metrics);
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
        Some((_, name)) => Err(FormatError::Column {
            column: (*name).to_owned(),
            expected: "one column of that name",
            found: "more than one".to_owned(),
        }),
    }
}

fn invalid(line: usize, column: &str, expected: &'static str, found: &str) -> FormatError {
    FormatError::Value { line, column: column.to_owned(), expected, found: found.to_owned() }
}

fn required<'a>(cell: Option<&'a str>, line: usize, column: &str) -> Result<&'a str, FormatError> {
    cell.ok_or_else(|| invalid(line, column, "a value", ""))
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

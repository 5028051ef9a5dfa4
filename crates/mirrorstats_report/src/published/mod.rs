//! Published cells: a CSV file with the columns `experiment,model,metric,mean,se,emphasis`.
//!
//! Mean and standard error are as printed, both empty if the value is undefined (`--` counts as empty); emphasis is
//! `bold`, `underline` or empty. Columns may be in any order; other columns are ignored.

pub mod audit;
pub mod comparison;
pub mod errata;

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Serialize;

use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::input;
use mirrorstats_exact::number::Decimal;
use mirrorstats_exact::suggest::nearest;
use mirrorstats_tables::{Emphasis, text_of};

pub const COLUMNS: [&str; 6] = ["experiment", "model", "metric", "mean", "se", "emphasis"];

/// The name of a cell.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, JsonSchema)]
pub struct CellLabel {
    /// The experiment.
    pub experiment: String,
    /// The model.
    pub model: String,
    /// The metric.
    pub metric: String,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PrintedCell {
    /// The mean; `None` if undefined.
    pub mean: Option<Decimal>,
    /// Its standard error; `None` if undefined.
    pub se: Option<Decimal>,
    pub emphasis: Emphasis,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Published {
    pub cells: Vec<(CellLabel, PrintedCell)>,
}

#[derive(Debug, thiserror::Error)]
pub enum PublishedError {
    #[error("published table {}: cannot read the file: {source}", path.display())]
    Unreadable { path: PathBuf, source: io::Error },
    #[error("published table {}{}: {fault}", path.display(), line.map(|line| format!(", line {line}")).unwrap_or_default())]
    Malformed { path: PathBuf, line: Option<u64>, fault: PublishedFault },
}

#[derive(Debug, thiserror::Error)]
pub enum PublishedFault {
    #[error("not a CSV file: {0}")]
    NotCsv(::csv::Error),
    #[error("no column `{column}`: expected the columns {}{}", COLUMNS.join(", "), .hint)]
    MissingColumn { column: &'static str, hint: String },
    #[error("the column `{column}` occurs twice: keep one")]
    RepeatedColumn { column: &'static str },
    #[error("column `{column}`: expected a name, found nothing")]
    NoName { column: &'static str },
    #[error("column `{column}`: expected a plain decimal number such as `0.57`, or nothing, found `{found}`")]
    NotANumber { column: &'static str, found: String },
    #[error("column `se`: expected nothing, as the mean is empty, found `{found}`")]
    StrayStandardError { found: String },
    #[error("column `emphasis`: expected `bold`, `underline` or nothing, found `{found}`")]
    UnknownEmphasis { found: String },
    #[error("{experiment}, {model}, {metric}: duplicate cell, first on line {first}; keep one")]
    RepeatedCell { experiment: String, model: String, metric: String, first: u64 },
    #[error("no cells: expected one line per cell after the header")]
    NoCells,
}

/// A line has fewer than 100 bytes, and a table a few hundred lines.
const LARGEST: Limit = Limit::new("bytes of a published table", 16 << 20);

pub fn read(path: &Path) -> Result<Published, PublishedError> {
    let bytes =
        input::bytes(path, LARGEST).map_err(|source| PublishedError::Unreadable { path: path.to_owned(), source })?;
    parse(&bytes).map_err(|(line, fault)| PublishedError::Malformed { path: path.to_owned(), line, fault })
}

type Fault = (Option<u64>, PublishedFault);

fn parse(bytes: &[u8]) -> Result<Published, Fault> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut reader = ::csv::Reader::from_reader(bytes);
    let columns = Columns::find(reader.headers().map_err(not_csv)?).map_err(|fault| (Some(1), fault))?;
    let mut cells = Vec::new();
    let mut first_lines: BTreeMap<CellLabel, u64> = BTreeMap::new();
    for record in reader.records() {
        let record = record.map_err(not_csv)?;
        let line = record.position().map_or(0, ::csv::Position::line);
        let (name, cell) = columns.cell(&record).map_err(|fault| (Some(line), fault))?;
        if let Some(&first) = first_lines.get(&name) {
            let [experiment, model, metric] = [name.experiment, name.model, name.metric].map(|name| visible(&name));
            return Err((Some(line), PublishedFault::RepeatedCell { experiment, model, metric, first }));
        }
        first_lines.insert(name.clone(), line);
        cells.push((name, cell));
    }
    if cells.is_empty() { Err((None, PublishedFault::NoCells)) } else { Ok(Published { cells }) }
}

fn not_csv(error: ::csv::Error) -> Fault {
    (error.position().map(::csv::Position::line), PublishedFault::NotCsv(error))
}

/// The position of each of [`COLUMNS`].
struct Columns([usize; 6]);

impl Columns {
    fn find(header: &::csv::StringRecord) -> Result<Self, PublishedFault> {
        let mut places = [0; 6];
        for (place, column) in places.iter_mut().zip(COLUMNS) {
            let mut found = header.iter().enumerate().filter(|(_, name)| name.trim() == column);
            let Some((at, _)) = found.next() else {
                let strangers = header.iter().filter(|name| !COLUMNS.contains(name));
                let hint =
                    nearest(column, strangers).map(|name| format!("; is it the one called `{}`?", visible(name)));
                return Err(PublishedFault::MissingColumn { column, hint: hint.unwrap_or_default() });
            };
            if found.next().is_some() {
                return Err(PublishedFault::RepeatedColumn { column });
            }
            *place = at;
        }
        Ok(Self(places))
    }

    fn cell(&self, record: &::csv::StringRecord) -> Result<(CellLabel, PrintedCell), PublishedFault> {
        let name = |at: usize| match record[self.0[at]].trim() {
            "" => Err(PublishedFault::NoName { column: COLUMNS[at] }),
            text => Ok(text_of(text).to_owned()),
        };
        let number = |at: usize| match record[self.0[at]].trim() {
            "" | "--" => Ok(None),
            text => match text.parse::<Decimal>() {
                Ok(number) => Ok(Some(number)),
                Err(_) => Err(PublishedFault::NotANumber { column: COLUMNS[at], found: visible(text) }),
            },
        };
        let label = CellLabel { experiment: name(0)?, model: name(1)?, metric: name(2)? };
        let (mean, se, emphasis) = (number(3)?, number(4)?, record[self.0[5]].trim());
        let unknown = || PublishedFault::UnknownEmphasis { found: visible(emphasis) };
        let cell = PrintedCell { mean, se, emphasis: Emphasis::named(emphasis).ok_or_else(unknown)? };
        match cell.se.filter(|_| cell.mean.is_none()) {
            Some(se) => Err(PublishedFault::StrayStandardError { found: se.to_string() }),
            None => Ok((label, cell)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{PublishedError, parse};

    fn message(text: &str) -> String {
        let (line, fault) = parse(text.as_bytes()).unwrap_err();
        PublishedError::Malformed { path: "t.csv".into(), line, fault }.to_string()
    }

    const HEADER: &str = "experiment,model,metric,mean,se,emphasis\n";

    fn line(line: &str) -> String {
        message(&format!("{HEADER}E1,a,TSA,0.10,0.07,\n{line}\n"))
    }

    #[test]
    fn each_fault_names_its_place_and_what_to_expect() {
        let faults = [
            message(""),
            message(HEADER),
            message("experiment,model,metric,average,se,emphasis\nE1,a,T,1,1,\n"),
            message("experiment,model,metric,means,se,emphasis\nE1,a,T,1,1,\n"),
            message("mean,experiment,model,metric,mean,se,emphasis\n"),
            line("E1,b,TSA,0.1x,0.07,"),
            line("E1,b,TSA,0.1,1e3,"),
            line("E1,b,TSA,,0.07,"),
            line("E1,b,TSA,0.10,0.07,italic"),
            line("E1,,TSA,0.10,0.07,"),
            line("E1,a,TSA,0.20,0.07,"),
            line("E1,a,TSA,0.20"),
            line("E1,a\u{1b},TSA,\u{1b}[31m,0.07,"),
        ];
        insta::assert_snapshot!(faults.join("\n"));
    }

    #[test]
    fn a_published_table_that_is_not_text_is_refused() {
        let bytes = [HEADER.as_bytes(), b"E1,a\xff,TSA,0.10,0.07,\n"].concat();
        let (line, fault) = parse(&bytes).unwrap_err();
        assert!(matches!((line, fault), (Some(2), super::PublishedFault::NotCsv(_))));
    }

    #[test]
    fn other_spellings_of_the_same_table_are_read() {
        let plain = parse(format!("{HEADER}E1,a,TSA,0.10,0.07,bold\nE1,b,SC,,,\n").as_bytes()).unwrap();
        let windows =
            "\u{feff}experiment,model,metric,mean,se,emphasis\r\nE1,a,TSA,0.10,0.07,bold\r\nE1,b,SC,--,--,\r\n";
        let shuffled = "note,se,mean,metric,model,experiment,emphasis\nx,0.07,0.10,TSA,a,E1,bold\ny,,,SC,b,E1,\n";
        assert_eq!(parse(windows.as_bytes()).unwrap(), plain);
        assert_eq!(parse(shuffled.as_bytes()).unwrap(), plain);
        assert_eq!(plain.cells[1].1.mean, None);
    }
}

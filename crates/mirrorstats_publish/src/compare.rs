//! Compares a published file with the same file made again: cell by cell, value by value, or line by line.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::Path;

use mirrorstats_exact::format::counted;
use mirrorstats_exact::hash;
use mirrorstats_score::format::{self, Format, Partition};
use mirrorstats_study::verify::{Difference, Kind};
use serde_json::Value;

use crate::PublishError;
use crate::frames::{FRAMES, hashes};

/// The most differences that are listed of a file.
const LISTED: usize = 10;
/// The characters shown of a long line.
const SHOWN: usize = 80;

/// A place in a file, and what the two files have there.
struct Cell {
    place: String,
    published: String,
    found: String,
}

/// The differences of two files of one path; empty if their bytes are equal.
pub(crate) fn compare(published: &Path, again: &Path, path: &str) -> Result<Vec<Difference>, PublishError> {
    let [old, new] = [published, again].map(|file| fs::read(file).map_err(PublishError::file(file)));
    let (old, new) = (old?, new?);
    if old == new {
        return Ok(Vec::new());
    }
    let mut cells = match path.rsplit('.').next() {
        Some("parquet") if path.starts_with(FRAMES) => maps(hashes(published), hashes(again)),
        Some("parquet") => scores(published, again),
        Some("csv") => tables(&old, &new),
        Some("json") => json(&old, &new),
        _ => lines(&old, &new),
    };
    if cells.is_empty() {
        let of = |bytes: &[u8]| format!("{} bytes with the SHA-256 {}", bytes.len(), hash::of_bytes(bytes));
        cells.push(Cell { place: "its bytes".to_owned(), published: of(&old), found: of(&new) });
    }
    let rest = cells.len().saturating_sub(LISTED);
    let mut differences: Vec<Difference> = cells.into_iter().take(LISTED).map(|cell| changed(path, cell)).collect();
    if let Some(last) = differences.last_mut().filter(|_| rest > 0) {
        last.found = format!("{} (and {})", last.found, counted(rest as u64, "more difference"));
    }
    Ok(differences)
}

fn changed(path: &str, Cell { place, published, found }: Cell) -> Difference {
    Difference { path: path.to_owned(), kind: Kind::Changed, cell: Some(place), expected: found, found: published }
}

fn scores(old: &Path, new: &Path) -> Vec<Cell> {
    let text = |path: &Path| {
        let table = format::read_parquet(File::open(path).ok()?, &Partition::default()).ok()?;
        let mut text = Vec::new();
        format::write(&table, Format::Csv, &mut text).ok()?;
        Some(text)
    };
    text(old).zip(text(new)).map(|(old, new)| tables(&old, &new)).unwrap_or_default()
}

/// Cells are named by their line and column, and by the first fields of the line.
fn tables(old: &[u8], new: &[u8]) -> Vec<Cell> {
    let read = |bytes: &[u8]| -> Vec<csv::StringRecord> {
        let reader = csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(bytes);
        reader.into_records().map_while(Result::ok).collect()
    };
    let (old, new) = (read(old), read(new));
    let mut cells = Vec::new();
    for line in 0..old.len().max(new.len()) {
        let (before, after) = (old.get(line), new.get(line));
        let row = after.or(before);
        let named: Vec<&str> = row.into_iter().flatten().take(3).collect();
        for column in 0..before.map_or(0, csv::StringRecord::len).max(after.map_or(0, csv::StringRecord::len)) {
            let of = |row: Option<&csv::StringRecord>| row.and_then(|row| row.get(column)).unwrap_or("").to_owned();
            let (published, found) = (of(before), of(after));
            if published != found {
                let name = new.first().and_then(|header| header.get(column)).unwrap_or("");
                let place = format!("line {}, column `{name}` ({})", line + 1, named.join(", "));
                cells.push(Cell { place, published, found });
            }
        }
    }
    cells
}

fn json(old: &[u8], new: &[u8]) -> Vec<Cell> {
    fn flat(value: &Value, place: &str, into: &mut BTreeMap<String, String>) {
        match value {
            Value::Object(map) => map.iter().for_each(|(key, value)| flat(value, &format!("{place}/{key}"), into)),
            Value::Array(list) => {
                list.iter().zip(0..).for_each(|(value, at)| flat(value, &format!("{place}/{at}"), into));
            }
            leaf => drop(into.insert(place.to_owned(), leaf.to_string())),
        }
    }
    let [old, new] = [old, new].map(|text| {
        let mut into = BTreeMap::new();
        if let Ok(value) = serde_json::from_slice::<Value>(text) {
            flat(&value, "", &mut into);
        }
        into
    });
    maps(old, new)
}

fn maps(mut old: BTreeMap<String, String>, new: BTreeMap<String, String>) -> Vec<Cell> {
    let mut cells = Vec::new();
    for (place, found) in new {
        let published = old.remove(&place).unwrap_or_else(|| "none".to_owned());
        if published != found {
            cells.push(Cell { place, published, found });
        }
    }
    cells.extend(old.into_iter().map(|(place, published)| Cell { place, published, found: "none".to_owned() }));
    cells
}

fn lines(old: &[u8], new: &[u8]) -> Vec<Cell> {
    let (Ok(old), Ok(new)) = (str::from_utf8(old), str::from_utf8(new)) else { return Vec::new() };
    let (old, new): (Vec<&str>, Vec<&str>) = (old.split('\n').collect(), new.split('\n').collect());
    let mut cells = Vec::new();
    for at in 0..old.len().max(new.len()) {
        let [published, found] = [&old, &new].map(|lines| lines.get(at).copied().unwrap_or("(no line)"));
        if published != found {
            let same = published.chars().zip(found.chars()).take_while(|(a, b)| a == b).count();
            let from = same.saturating_sub(SHOWN / 2);
            let shown = |line: &str| line.chars().skip(from).take(SHOWN).collect::<String>();
            let place = format!("line {}, character {}", at + 1, same + 1);
            cells.push(Cell { place, published: shown(published), found: shown(found) });
        }
    }
    cells
}

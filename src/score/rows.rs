//! Rows of the episode table on their way from the order of the files into the order of the table.
//!
//! Rule: a row is bytes that compare as its key does, so that sorting knows no column. Rows beyond a fixed amount of
//! memory are put away as sorted runs ([`crate::base::runs`]); how many there are changes nothing but the time.
//!
//! ```text
//! title    experiment 00 00  model 00 00
//! record   seed  run  episode_id 00 00  labels  metrics
//! ```
//!
//! Zero bytes within a text are followed by FF, integers are big-endian with the sign bit turned over.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::io;

use arrow::array::{
    Array, ArrayAccessor as _, ArrayRef, AsArray as _, Int64Array, RecordBatch, StringArray, TypedDictionaryArray,
};
use arrow::datatypes::{DataType, Float64Type, Int32Type, Int64Type};
use memchr::memchr;

use super::engine::Scores;
use super::table::{EpisodeKey, EpisodeRow, Header};
use crate::base::runs::{self, Merge, Place, Run, Runs, Section};
use crate::trace::scan::EPISODE_COLUMNS;

/// Bytes of rows that are held in memory before they are put away.
const MEMORY: usize = 17 << 20;

/// Bytes of rows that are sorted at a time.
const SORTED: usize = 1 << 20;

/// What a row takes, about.
const USUAL_BYTES: usize = 64;

/// Some rows as bytes.
#[derive(Debug, Default)]
pub struct Rows {
    bytes: Vec<u8>,
    /// The rows of each title, in the order of their coming.
    titled: Vec<(Vec<u8>, Vec<Record>)>,
}

/// A row among the bytes.
#[derive(Clone, Copy, Debug)]
struct Record {
    place: Place,
    /// The bytes of its seed and run, which decide most comparisons.
    numbers: u64,
}

impl Rows {
    /// The scores of the episodes of one batch.
    pub fn of(episodes: &RecordBatch, scores: &Scores, labels: &[String]) -> Self {
        let keys = KeyColumns::of(episodes);
        let column = |name: &String| episodes.column_by_name(name).expect("the projection asks for this column");
        let labels: Vec<&ArrayRef> = labels.iter().map(column).collect();
        let metrics = Metrics::of(&scores.metrics, scores.kept.len());
        let mut bytes = Vec::with_capacity(scores.kept.len() * USUAL_BYTES);
        let mut titled: Vec<(Vec<u8>, Vec<Record>)> = Vec::new();
        let mut known: HashMap<[Option<i32>; 2], usize> = HashMap::new();
        let mut rows = scores.kept.iter().copied().enumerate().peekable();
        // Experiment and model seldom change from row to row.
        while let Some(&(_, first)) = rows.peek() {
            let names = keys.names(first);
            let title = *known.entry(names).or_insert_with(|| {
                titled.push((keys.title(first), Vec::new()));
                titled.len() - 1
            });
            let records = &mut titled[title].1;
            while let Some((at, row)) = rows.next_if(|(_, row)| keys.names(*row) == names) {
                let start = bytes.len();
                let numbers = keys.numbers(row);
                bytes.extend_from_slice(&numbers.to_be_bytes());
                put_text(&mut bytes, text(keys.episode_id, row).unwrap_or_default());
                for label in &labels {
                    put_label(&mut bytes, shown(label, row).as_deref());
                }
                metrics.put(&mut bytes, at);
                let place = Place { start: narrow(start), length: narrow(bytes.len() - start) };
                records.push(Record { place, numbers });
            }
        }
        Self { bytes, titled }
    }
}

fn narrow(count: usize) -> u32 {
    u32::try_from(count).expect("rows are sorted some thousands at a time, and each is a few names and numbers")
}

/// Sorts rows as they come, in bounded memory.
pub struct RowSorter {
    header: Header,
    /// The bytes of rows that are not sorted yet, and where those of each title are.
    bytes: Vec<u8>,
    titled: BTreeMap<Vec<u8>, Vec<Record>>,
    sorted: Vec<Run>,
    runs: Runs,
    at_a_time: usize,
    memory: usize,
}

impl RowSorter {
    /// A sorter without rows.
    pub fn new(header: Header) -> Self {
        Self {
            header,
            bytes: Vec::new(),
            titled: BTreeMap::new(),
            sorted: Vec::new(),
            runs: Runs::default(),
            at_a_time: SORTED,
            memory: MEMORY,
        }
    }

    /// Adds rows.
    ///
    /// # Errors
    /// When rows cannot be put away.
    pub fn add(&mut self, rows: &Rows) -> io::Result<()> {
        if self.bytes.len() + rows.bytes.len() > self.at_a_time {
            self.sort();
            if self.sorted.iter().map(Run::size).sum::<usize>() >= self.memory {
                self.runs.put_away(std::mem::take(&mut self.sorted))?;
            }
            self.bytes.reserve(self.at_a_time);
        }
        let offset = narrow(self.bytes.len());
        self.bytes.extend_from_slice(&rows.bytes);
        for (title, records) in &rows.titled {
            self.titled.entry(title.clone()).or_default().extend(records.iter().map(|record| {
                let place = Place { start: record.place.start + offset, ..record.place };
                Record { place, ..*record }
            }));
        }
        Ok(())
    }

    /// Makes a sorted run of the rows that have come since the last one.
    fn sort(&mut self) {
        let bytes = std::mem::take(&mut self.bytes);
        let (mut sections, mut places): (Vec<Section>, Vec<Place>) = (Vec::new(), Vec::new());
        places.reserve_exact(self.titled.values().map(Vec::len).sum());
        for (title, mut records) in std::mem::take(&mut self.titled) {
            let rest = |record: &Record| &bytes[record.place.range()];
            // Rows of one file mostly come in order, which this sort makes use of.
            records.sort_by(|a, b| a.numbers.cmp(&b.numbers).then_with(|| rest(a).cmp(rest(b))));
            places.extend(records.iter().map(|record| record.place));
            sections.push(Section { title, end: places.len() });
        }
        self.sorted.push(Run::new(bytes, sections, places));
    }

    /// All rows in order.
    ///
    /// # Errors
    /// When rows that were put away cannot be read.
    pub fn finish(mut self) -> io::Result<SortedRows> {
        self.sort();
        let merge = self.runs.merge(self.sorted)?;
        Ok(SortedRows { header: self.header, merge, row: EpisodeRow::default() })
    }
}

/// The rows of a table, one after the other.
pub struct SortedRows {
    header: Header,
    merge: Merge,
    row: EpisodeRow,
}

impl SortedRows {
    /// What stands above them.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The next row.
    ///
    /// # Errors
    /// When rows that were put away cannot be read.
    pub fn next_row(&mut self) -> io::Result<Option<&EpisodeRow>> {
        let Some(runs::Record { title, bytes }) = self.merge.next()? else { return Ok(None) };
        let EpisodeRow { key, labels, metrics } = &mut self.row;
        let EpisodeKey { experiment, model, seed, run, episode_id } = key;
        if let Some(title) = title {
            let mut title = Bytes(title);
            title.text(experiment)?;
            title.text(model)?;
        }
        let mut record = Bytes(bytes);
        *seed = record.int()?;
        *run = record.int()?;
        record.text(episode_id)?;
        labels.resize(self.header.labels.len(), None);
        labels.iter_mut().try_for_each(|label| record.label(label))?;
        record.metrics(self.header.metrics.len(), metrics)?;
        Ok(Some(&self.row))
    }
}

/// The keys of some rows of [`crate::trace::scan::EpisodeBatch::episodes`].
pub(super) fn keys(episodes: &RecordBatch, rows: impl IntoIterator<Item = usize>) -> Vec<EpisodeKey> {
    let columns = KeyColumns::of(episodes);
    let owned = |column: TextColumn<'_>, row| text(column, row).unwrap_or_default().to_owned();
    let key = |row: usize| EpisodeKey {
        experiment: owned(columns.experiment, row),
        model: owned(columns.model, row),
        seed: columns.seed(row),
        run: columns.run(row),
        episode_id: owned(columns.episode_id, row),
    };
    rows.into_iter().map(key).collect()
}

/// The key columns of a batch.
struct KeyColumns<'a> {
    experiment: TextColumn<'a>,
    model: TextColumn<'a>,
    seed: &'a Int64Array,
    run: &'a Int64Array,
    episode_id: TextColumn<'a>,
}

/// A dictionary whose values are known to be texts.
type TextColumn<'a> = TypedDictionaryArray<'a, Int32Type, StringArray>;

impl<'a> KeyColumns<'a> {
    fn of(episodes: &'a RecordBatch) -> Self {
        let column = |name: &str| episodes.column_by_name(name).expect("every batch has the key columns");
        let [episode_id, model, experiment, seed, run] = EPISODE_COLUMNS.map(column);
        Self {
            experiment: texts(experiment),
            model: texts(model),
            seed: seed.as_primitive(),
            run: run.as_primitive(),
            episode_id: texts(episode_id),
        }
    }

    fn seed(&self, row: usize) -> i32 {
        i32::try_from(self.seed.value(row)).unwrap_or_default()
    }

    fn run(&self, row: usize) -> i32 {
        i32::try_from(self.run.value(row)).unwrap_or_default()
    }

    /// Experiment and model as keys of this batch.
    fn names(&self, row: usize) -> [Option<i32>; 2] {
        [self.experiment, self.model].map(|column| column.keys().is_valid(row).then(|| column.keys().value(row)))
    }

    fn title(&self, row: usize) -> Vec<u8> {
        let mut title = Vec::new();
        put_text(&mut title, text(self.experiment, row).unwrap_or_default());
        put_text(&mut title, text(self.model, row).unwrap_or_default());
        title
    }

    /// Seed and run, as a number that compares as they do.
    fn numbers(&self, row: usize) -> u64 {
        // The scan has checked that seed and run fit.
        let ordered = |value: i32| u64::from((value ^ i32::MIN).cast_unsigned());
        ordered(self.seed(row)) << 32 | ordered(self.run(row))
    }
}

fn texts(column: &ArrayRef) -> TextColumn<'_> {
    column.as_dictionary().downcast_dict().expect("the values of every text column are texts")
}

/// The text at a row of a text column; `None` for null.
fn text(column: TextColumn<'_>, row: usize) -> Option<&str> {
    column.is_valid(row).then(|| column.value(row))
}

/// The value at a row of any column as text; `None` for null.
fn shown(column: &ArrayRef, row: usize) -> Option<Cow<'_, str>> {
    if column.is_null(row) {
        return None;
    }
    match column.data_type() {
        DataType::Boolean => Some(column.as_boolean().value(row).to_string().into()),
        DataType::Int64 => Some(column.as_primitive::<Int64Type>().value(row).to_string().into()),
        DataType::Float64 => Some(column.as_primitive::<Float64Type>().value(row).to_string().into()),
        _ => text(texts(column), row).map(Cow::from),
    }
}

/// Ends a text, and sorts before anything that could stand there.
const END: [u8; 2] = [0, 0];
/// A zero byte within a text.
const ZERO: [u8; 2] = [0, 0xFF];

fn put_text(bytes: &mut Vec<u8>, text: &str) {
    let mut rest = text.as_bytes();
    while let Some(zero) = memchr(0, rest) {
        bytes.extend_from_slice(&rest[..zero]);
        bytes.extend_from_slice(&ZERO);
        rest = &rest[zero + 1..];
    }
    bytes.extend_from_slice(rest);
    bytes.extend_from_slice(&END);
}

const NO_LABEL: u8 = 0;
const LABEL: u8 = 1;

fn put_label(bytes: &mut Vec<u8>, label: Option<&str>) {
    match label {
        None => bytes.push(NO_LABEL),
        Some(text) => {
            bytes.push(LABEL);
            put_text(bytes, text);
        }
    }
}

/// An undefined metric.
const UNDEFINED: u8 = 0xFF;
/// A metric whose value follows in eight bytes behind the codes of all; any other code is the value.
const LARGE: u8 = 0xFE;

/// The metrics of some rows, to be written as bytes: a code each, then the values that no code stands for.
struct Metrics<'a> {
    metrics: &'a [Int64Array],
    /// The codes of all rows, row by row.
    codes: Vec<u8>,
}

impl<'a> Metrics<'a> {
    fn of(metrics: &'a [Int64Array], rows: usize) -> Self {
        let mut codes = vec![UNDEFINED; rows * metrics.len()];
        for (first, metric) in metrics.iter().enumerate() {
            let codes = codes.iter_mut().skip(first).step_by(metrics.len());
            match metric.nulls() {
                None => codes.zip(metric.values()).for_each(|(place, value)| *place = code(*value)),
                Some(nulls) => codes
                    .zip(metric.values().iter().zip(nulls))
                    .for_each(|(place, (value, defined))| *place = if defined { code(*value) } else { UNDEFINED }),
            }
        }
        Self { metrics, codes }
    }

    fn put(&self, bytes: &mut Vec<u8>, row: usize) {
        let count = self.metrics.len();
        let codes = &self.codes[row * count..(row + 1) * count];
        bytes.extend_from_slice(codes);
        for (metric, _) in self.metrics.iter().zip(codes).filter(|(_, code)| **code == LARGE) {
            bytes.extend_from_slice(&metric.value(row).to_le_bytes());
        }
    }
}

fn code(value: i64) -> u8 {
    u8::try_from(value).map_or(LARGE, |small| small.min(LARGE))
}

/// What is left of a row's bytes.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn take(&mut self, length: usize) -> io::Result<&[u8]> {
        let (taken, rest) = self.0.split_at_checked(length).ok_or_else(damaged)?;
        self.0 = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> io::Result<[u8; N]> {
        self.take(N)?.try_into().map_err(|_| damaged())
    }

    /// Reads a text into a buffer.
    fn text(&mut self, text: &mut String) -> io::Result<()> {
        text.clear();
        loop {
            let until = memchr(0, self.0).ok_or_else(damaged)?;
            text.push_str(str::from_utf8(self.take(until)?).map_err(|_| damaged())?);
            match self.array()? {
                END => return Ok(()),
                _ => text.push('\0'),
            }
        }
    }

    fn int(&mut self) -> io::Result<i32> {
        Ok(i32::from_be_bytes(self.array()?) ^ i32::MIN)
    }

    fn label(&mut self, label: &mut Option<String>) -> io::Result<()> {
        match self.array()? {
            [NO_LABEL] => {
                *label = None;
                Ok(())
            }
            _ => self.text(label.get_or_insert_default()),
        }
    }

    /// Reads so many metrics, the last ones of a row.
    fn metrics(mut self, count: usize, metrics: &mut Vec<Option<i64>>) -> io::Result<()> {
        let (codes, rest) = self.0.split_at_checked(count).ok_or_else(damaged)?;
        self.0 = rest;
        metrics.clear();
        for code in codes {
            metrics.push(match *code {
                UNDEFINED => None,
                LARGE => Some(i64::from_le_bytes(self.array()?)),
                small => Some(small.into()),
            });
        }
        Ok(())
    }
}

fn damaged() -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, "a temporary file was changed by another program")
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow::array::{DictionaryArray, Int64Array};
    use proptest::collection::vec;
    use proptest::option;
    use proptest::prelude::*;

    use super::*;
    use crate::metric::definitions::Definitions;
    use crate::score::run::schema_columns;

    fn header() -> Header {
        let catalog = Definitions::from_toml("none", "", &schema_columns()).unwrap().catalog;
        Header { catalog, labels: vec!["distractors".into()], metrics: vec!["A".into(), "B".into()] }
    }

    fn row() -> impl Strategy<Value = EpisodeRow> {
        let name = || proptest::string::string_regex("[a\u{0}\u{1}é\u{ff}]{0,3}").unwrap();
        let number = || prop_oneof![-2..3, Just(i32::MIN), Just(i32::MAX)];
        let metric = || option::of(prop_oneof![-1..3_i64, 252..258_i64, Just(i64::MIN), Just(i64::MAX)]);
        let key =
            (name(), name(), number(), number(), name()).prop_map(|(experiment, model, seed, run, episode_id)| {
                EpisodeKey { experiment, model, seed, run, episode_id }
            });
        (key, option::of(0..3_i64), vec(metric(), 2)).prop_map(|(key, distractors, metrics)| EpisodeRow {
            key,
            labels: vec![distractors.map(|number| number.to_string())],
            metrics,
        })
    }

    /// Rows as one batch gives them.
    fn batch(rows: &[EpisodeRow]) -> Rows {
        let texts = |of: fn(&EpisodeKey) -> &str| {
            let texts = rows.iter().map(|row| Some(of(&row.key)));
            Arc::new(texts.collect::<DictionaryArray<Int32Type>>()) as ArrayRef
        };
        let ints = |of: fn(&EpisodeKey) -> i32| {
            Arc::new(rows.iter().map(|row| i64::from(of(&row.key))).collect::<Int64Array>()) as ArrayRef
        };
        let distractors: Int64Array =
            rows.iter().map(|row| row.labels[0].as_ref().map(|label| label.parse::<i64>().unwrap())).collect();
        let episodes = RecordBatch::try_from_iter_with_nullable([
            ("episode_id", texts(|key| &key.episode_id), false),
            ("model", texts(|key| &key.model), false),
            ("experiment", texts(|key| &key.experiment), false),
            ("seed", ints(|key| key.seed), false),
            ("run", ints(|key| key.run), false),
            ("distractors", Arc::new(distractors), true),
        ]);
        let metrics = (0..2).map(|metric| rows.iter().map(|row| row.metrics[metric]).collect()).collect();
        let scores = Scores { kept: (0..rows.len()).collect(), metrics };
        Rows::of(&episodes.unwrap(), &scores, &["distractors".to_owned()])
    }

    proptest! {
        #[test]
        fn rows_come_out_as_they_went_in_and_in_the_order_of_keys(
            rows in vec(row(), 1..30), batches in 1_usize..10, at_a_time in 1_usize..200, memory in 1_usize..400,
        ) {
            let mut sorter = RowSorter { at_a_time, memory, ..RowSorter::new(header()) };
            for some in rows.chunks(rows.len().div_ceil(batches)) {
                sorter.add(&batch(some)).unwrap();
            }
            let mut sorted = sorter.finish().unwrap();
            let mut found = Vec::new();
            while let Some(row) = sorted.next_row().unwrap() {
                found.push(row.clone());
            }
            prop_assert!(found.is_sorted_by_key(|row| row.key.clone()));
            let by_all = |row: &EpisodeRow| (row.key.clone(), row.labels.clone(), row.metrics.clone());
            let mut expected = rows;
            expected.sort_by_key(by_all);
            found.sort_by_key(by_all);
            prop_assert_eq!(found, expected);
        }
    }
}
